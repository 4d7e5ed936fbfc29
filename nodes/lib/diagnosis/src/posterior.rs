//! The car's own tires: their fit to a drive, and what they say of another one.

use gripsight_estimation::selection::Term;
use gripsight_estimation::split;
use gripsight_model::{BASE, EffectId, Flexible, Site, TIRES};
use gripsight_signals::{DataHealth, StateSequence};
use gripsight_vehicle::{OwnTires, PacejkaParameters, PosteriorParameter, TirePosterior, VehicleParameters};

use crate::around::Around;
use crate::budget::large_slip_rad;
use crate::columns::Columns;
use crate::diagnose::{SEARCH_WINDOWS, fit_tires, fitted_null};
use crate::engine::{Engine, Sized};
use crate::hypotheses::terms;
use crate::infer::{noise_scale, repeated};
use crate::joint::Joint;
use crate::sizes::own_covariance;
use crate::trust::TireTrust;
use crate::usable::{Usable, usable};
use crate::{GapError, Request};

/// Names of a tire's parameters, in the order of the fit.
const TIRE: [&str; 4] = ["stiffness", "c", "d", "e"];
const AXLES: [&str; 2] = ["front", "rear"];
/// Status of an identification whose drive reached the peak.
const PEAK_REACHED: &str = "accepted";

/// Fits the car's own tires to a drive. `start`: effective tires that the drive has given, which are near, or none: then from several. `status` and `vehicle_hash` of the
/// identification that they go along with: where it is not `accepted` the drive did not reach the peak, and the covariance says that nothing is known of it.
///
/// # Errors
/// [`GapError`] where the drive cannot tell, or the fit does not end at finite numbers.
pub fn own_tires(
    sequence: &StateSequence,
    vehicle: &VehicleParameters,
    start: Option<PacejkaParameters>,
    (status, vehicle_hash): (&str, &str),
) -> Result<TirePosterior, GapError> {
    let Usable { recording, windows } = usable(&Request::new(sequence, vehicle), &DataHealth::of(sequence)?)?;
    let tires = match start {
        Some(effective) => OwnTires::assumed(&effective),
        None => fit_tires(&recording, vehicle, &windows.training)?,
    };
    let mut engine = Engine::new(&recording, vehicle, tires, TireTrust::free());
    let windows = split(&recording, false).training.thinned(SEARCH_WINDOWS);
    let null = fitted_null(&engine, &windows)?;
    let slip_rad = large_slip_rad(&engine, &windows);
    let flexible = Flexible::new(&recording, slip_rad, vehicle.wheelbase_m(), &Site::ALL);
    let columns = Columns::new(EffectId::background().collect(), flexible);
    let mut values = columns.blank(&engine);
    values[..BASE].copy_from_slice(&null.parameters[..BASE]);
    for &effect in &columns.effects {
        if let (Some(own), Some(range)) = (null.of(effect), columns.of_effect(effect)) {
            values[range].copy_from_slice(own);
        }
    }
    let joint =
        Joint::around(&engine, &columns, &values, &null.starts, &windows).ok_or(GapError::NotFinite)?;
    let terms = terms(&engine, &columns, &values, &[]);
    let open: Vec<usize> = terms.iter().map(|t: &Term| t.log_weights.len() - 1).collect();
    let base = engine.sigma.clone();
    let scale = noise_scale(&mut engine, &joint, &base, &terms, &open).ok_or(GapError::NotFinite)?;
    let weighed = joint.weighed(&scale);
    let dispersion = repeated(&weighed, &terms, &open).ok_or(GapError::NotFinite)?;
    let around = Around {
        engine: &engine,
        columns: &columns,
        terms: &terms,
        values: &values,
        starts: &null.starts,
        windows: &windows,
        dispersion,
        joint: &joint,
        scale: &scale,
    };
    // Tires and what every car has; how long a command is held is nobody's to inherit.
    let used: Vec<usize> = (0..TIRES).chain(BASE..columns.first_flexible()).collect();
    let mut covariance = own_covariance(&around, &weighed, &used).ok_or(GapError::NotFinite)?;
    if status != PEAK_REACHED {
        // What the fit says of slips that were not driven is the formula's, not the tires'; and a peak in the wrong place takes the stiffness along.
        let formula = TireTrust { stiffness: TireTrust::file().stiffness, ..TireTrust::free() };
        let mean = std::array::from_fn(|j| values[j]);
        for (j, (sigma, _)) in formula.sigmas(&mean).into_iter().enumerate() {
            covariance[j][j] += sigma * sigma;
        }
    }
    let mut parameters = PosteriorParameter::of_tires(&OwnTires::from_parameters(&values[..TIRES]));
    for &effect in &columns.effects {
        parameters.extend(effect.spec().parameters.iter().map(|p| PosteriorParameter {
            name: format!("{}.{}", effect.name(), p.name),
            unit: p.unit.to_owned(),
            mean: 0.0,
        }));
    }
    parameters.iter_mut().zip(&used).for_each(|(p, &column)| p.mean = values[column]);
    Ok(TirePosterior {
        status: status.to_owned(),
        vehicle_hash: vehicle_hash.to_owned(),
        parameters,
        covariance,
        data: seconds(sequence),
    })
}

/// What every car has, at the mean.
pub(crate) fn usual(posterior: &TirePosterior) -> Result<Sized, GapError> {
    let own = |effect: EffectId| {
        let parameters = effect.spec().parameters.iter();
        let values = parameters.map(|p| posterior.mean(&format!("{}.{}", effect.name(), p.name)));
        Ok((effect, values.collect::<Result<Vec<f64>, _>>()?))
    };
    EffectId::background().map(own).collect()
}

/// How far the tires are trusted on another drive: as well as this one knows them, and no better than tires stay the same.
pub(crate) fn trust(posterior: &TirePosterior) -> Result<TireTrust, GapError> {
    let most = TireTrust::free();
    let mut trust = TireTrust::drive();
    for axle in AXLES {
        let mut at = [0; 4];
        for (place, p) in at.iter_mut().zip(TIRE) {
            *place = posterior.place(&format!("{axle}.{p}"))?;
        }
        let mean = |i: usize| posterior.parameters[at[i]].mean;
        let sigma = |i: usize| posterior.covariance[at[i]][at[i]].sqrt();
        trust.stiffness = trust.stiffness.max(sigma(0) / mean(0)).min(most.stiffness);
        trust.shape = trust.shape.max(sigma(1)).min(most.shape);
        trust.peak = trust.peak.max(sigma(2) / mean(2)).min(most.peak);
        trust.curvature = trust.curvature.max(sigma(3)).min(most.curvature);
    }
    Ok(trust)
}

/// Whether any second of a drive is one that the tires were fitted on.
pub(crate) fn is_of(posterior: &TirePosterior, sequence: &StateSequence) -> bool {
    seconds(sequence).iter().any(|second| posterior.data.contains(second))
}

/// A hash of every whole second, by its own stamps: a part cut from a drive is known again.
fn seconds(sequence: &StateSequence) -> Vec<String> {
    const NS: i64 = 1_000_000_000;
    let second = |i: usize| {
        (sequence.start_stamp_ns + (f64::from(sequence.time_s[i]) * NS as f64) as i64).div_euclid(NS)
    };
    let mut out: Vec<(i64, u64)> = Vec::new();
    for i in 0..sequence.len() {
        let at = second(i);
        if out.last().is_none_or(|last| last.0 != at) {
            out.push((at, 0xcbf2_9ce4_8422_2325));
        }
        let Some(last) = out.last_mut() else { continue };
        // FNV-1a: nothing here needs to resist an attacker. What is estimated differs with the drive around it; what is recorded does not.
        for bits in [sequence.v_x_mps[i], sequence.yaw_rate_radps[i]].map(f32::to_bits) {
            last.1 = (last.1 ^ u64::from(bits)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    // The first and the last are seldom whole.
    let whole = out.len().saturating_sub(1);
    out.get(1..whole.max(1)).unwrap_or_default().iter().map(|(_, hash)| format!("{hash:016x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn posterior() -> TirePosterior {
        let tires = AXLES.iter().flat_map(|axle| TIRE.iter().map(move |p| format!("{axle}.{p}")));
        let usual = EffectId::background()
            .flat_map(|e| e.spec().parameters.iter().map(move |p| format!("{}.{}", e.name(), p.name)));
        let parameters: Vec<PosteriorParameter> = tires
            .chain(usual)
            .map(|name| PosteriorParameter { name, unit: "1".to_owned(), mean: 2.0 })
            .collect();
        let n = parameters.len();
        let row = |i: usize| (0..n).map(|j| if i == j { 0.01 } else { 0.0 }).collect();
        TirePosterior {
            status: "accepted".to_owned(),
            vehicle_hash: "0".to_owned(),
            parameters,
            covariance: (0..n).map(row).collect(),
            data: Vec::new(),
        }
    }

    #[test]
    fn trust_follows_the_covariance_between_what_stays_and_what_is_known_without() {
        let mut of = posterior();
        let known = trust(&of).unwrap();
        approx::assert_relative_eq!(known.peak, 0.05, epsilon = 1e-12);
        approx::assert_relative_eq!(known.stiffness, 0.05, epsilon = 1e-12);
        // What an axle knows less well is what both are trusted by.
        of.covariance[4][4] = 0.04;
        approx::assert_relative_eq!(trust(&of).unwrap().stiffness, 0.1, epsilon = 1e-12);
        of.covariance.iter_mut().flatten().for_each(|c| *c = 0.0);
        assert_eq!(trust(&of).unwrap(), TireTrust::drive());
        // A peak that nothing is known of is none to tell another grip from.
        of.covariance[2][2] = 1.0;
        assert!(!trust(&of).unwrap().knows_the_peak());
    }

    #[test]
    fn a_part_of_a_drive_is_known_again_and_another_drive_is_not() {
        let drive = |shift: f32| {
            let time_s: Vec<f32> = (0..1000).map(|k| k as f32 * 0.01).collect();
            let series = |of: &dyn Fn(f32) -> f32| time_s.iter().map(|t| of(t + shift)).collect::<Vec<f32>>();
            StateSequence {
                start_stamp_ns: 5_000_000_000,
                v_x_mps: series(&|t| 5.0 + t.sin()),
                yaw_rate_radps: series(&|t| t.cos()),
                v_y_mps: series(&|_| 0.0),
                steering_rad: series(&|_| 0.0),
                time_s: time_s.clone(),
                ..StateSequence::default()
            }
        };
        let of = TirePosterior { data: seconds(&drive(0.0)), ..posterior() };
        let mut part = drive(0.0);
        let kept: Vec<bool> = part.time_s.iter().map(|t| (3.5..7.2).contains(t)).collect();
        part.retain(|i| kept[i]);
        assert!(is_of(&of, &part));
        assert!(!is_of(&of, &drive(0.5)));
    }
}
