//! The car of a result's folder.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, bail};
use gripsight_diagnosis::ExtendedModelFile;
use gripsight_identification::export::{checked_tires, read_text};
use gripsight_identification::{Nuisance, SignalCorrections, Status};
use gripsight_model::{CarFile, EffectId, OutsideTerm};
use gripsight_vehicle::{OwnTires, PacejkaParameters, TirePosterior, VehicleParameters};
use serde::Deserialize;

const POSTERIOR: &str = "posterior.json";

/// The part of gap.json that tells the car.
#[derive(Deserialize)]
struct Diagnosed {
    vehicle: VehicleParameters,
}

/// The part of identification.json that tells the car.
#[derive(Deserialize)]
struct Identified {
    status: Status,
    vehicle: VehicleParameters,
    found: PacejkaParameters,
    signals: SignalCorrections,
    nuisance: Nuisance,
}

/// The car of a result, and whether its tires are its own: fitted to the signals as recorded.
pub(crate) fn car(result: &Path) -> anyhow::Result<(CarFile, bool)> {
    let read = |name: &str| {
        let path = result.join(name);
        read_text(&path).with_context(|| format!("cannot read {}", path.display()))
    };
    let of = |name: &str| format!("cannot use {}", result.join(name).display());
    if result.join("gap.json").is_file() {
        let not_one = || format!("{}: it does not tell the car: diagnose again", of("gap.json"));
        let diagnosed: Diagnosed = serde_json::from_str(&read("gap.json")?).with_context(not_one)?;
        let vehicle = diagnosed.vehicle.checked().with_context(|| of("gap.json"))?;
        let text = read("extended_model.yaml")
            .context("there is no model in it: the data could not tell, or a simulator was diagnosed")?;
        let model = ExtendedModelFile::from_yaml(&text).with_context(|| of("extended_model.yaml"))?;
        let effects = model.usual.into_iter().chain(model.effects).collect();
        return Ok((CarFile { vehicle, tires: model.tires, effects }, false));
    }
    if !result.join("identification.json").is_file() {
        bail!("{} is not the folder of an identification or a diagnosis", result.display());
    }
    let identified: Identified = serde_json::from_str(&read("identification.json")?)
        .with_context(|| format!("{}: it is not one of this version", of("identification.json")))?;
    if identified.status == Status::Rejected {
        bail!("that identification was rejected: its tires are not known");
    }
    let Identified { vehicle, found, signals, nuisance, .. } = identified;
    let vehicle = vehicle.checked().with_context(|| of("identification.json"))?;
    if !result.join(POSTERIOR).is_file() {
        let found = checked_tires(found).with_context(|| of("identification.json"))?;
        let tires = OwnTires::assumed(&found);
        return Ok((CarFile { vehicle, tires, effects: effects_of(&signals, nuisance.relaxation_m) }, false));
    }
    let posterior = crate::diagnose::posterior(&result.join(POSTERIOR))?;
    Ok((own_car(vehicle, &posterior, &signals)?, true))
}

/// The car with its own tires and what was fitted along with them. They were fitted to the signals as recorded and have taken on what shows as other
/// tires do; what pulls to one side no tire can take on.
fn own_car(
    vehicle: VehicleParameters,
    posterior: &TirePosterior,
    signals: &SignalCorrections,
) -> anyhow::Result<CarFile> {
    let none = SignalCorrections::NONE;
    let one_sided = SignalCorrections {
        steering_delay_s: none.steering_delay_s,
        steering_gain: none.steering_gain,
        v_y_lever_arm_m: none.v_y_lever_arm_m,
        ..*signals
    };
    let mut effects = effects_of(&one_sided, 0.0);
    for p in &posterior.parameters {
        if let Some((name, parameter)) = p.name.split_once('.')
            && EffectId::by_name(name).is_some()
        {
            effects.entry(name.to_owned()).or_default().insert(parameter.to_owned(), p.mean);
        }
    }
    Ok(CarFile { vehicle, tires: posterior.tires()?, effects })
}

/// What was taken out of the signals, and the lag of the tires, as effects.
fn effects_of(signals: &SignalCorrections, relaxation_m: f64) -> BTreeMap<String, BTreeMap<String, f64>> {
    [
        (OutsideTerm::SteeringDelay, signals.steering_delay_s.max(0.0)),
        (OutsideTerm::SteeringGain, signals.steering_gain - 1.0),
        (OutsideTerm::SteeringOffset, signals.steering_offset_rad),
        (OutsideTerm::VYLeverArm, signals.v_y_lever_arm_m),
        (OutsideTerm::VYBias, signals.v_y_bias_mps),
        (OutsideTerm::YawRateBias, signals.yaw_rate_bias_radps),
        (OutsideTerm::Relaxation, relaxation_m.max(0.0)),
    ]
    .into_iter()
    .filter(|(_, size)| *size != 0.0)
    .filter_map(|(term, size)| {
        let spec = EffectId::of_outside(term)?.spec();
        Some((spec.name.to_owned(), BTreeMap::from([(spec.parameters[0].name.to_owned(), size)])))
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use gripsight_vehicle::PosteriorParameter;

    use super::*;

    fn own(car: &CarFile, term: OutsideTerm) -> Option<f64> {
        let effects = car.effects().unwrap();
        effects.iter().find(|(e, _)| e.spec().outside == Some(term)).map(|(_, own)| own[0])
    }

    #[test]
    fn what_own_tires_have_taken_on_is_not_counted_twice() {
        let tires = OwnTires::from_parameters(&[9.0, 1.5, 1.0, 0.1, 8.0, 1.4, 0.9, -0.2]);
        let mut parameters = PosteriorParameter::of_tires(&tires);
        let relaxation = EffectId::of_outside(OutsideTerm::Relaxation).unwrap().spec();
        let name = format!("{}.{}", relaxation.name, relaxation.parameters[0].name);
        parameters.push(PosteriorParameter { name, unit: "m".to_owned(), mean: 0.06 });
        let posterior = TirePosterior {
            status: String::new(),
            vehicle_hash: String::new(),
            covariance: vec![vec![0.0; parameters.len()]; parameters.len()],
            parameters,
            data: Vec::new(),
        };
        let signals = SignalCorrections {
            steering_delay_s: 0.04,
            steering_gain: 0.9,
            v_y_lever_arm_m: 0.1,
            steering_offset_rad: 0.01,
            yaw_rate_bias_radps: -0.02,
            ..SignalCorrections::NONE
        };
        let car = own_car(VehicleParameters::f1tenth(), &posterior.checked().unwrap(), &signals).unwrap();
        assert_eq!(car.tires, tires);
        for (term, size) in [
            (OutsideTerm::SteeringDelay, None),
            (OutsideTerm::SteeringGain, None),
            (OutsideTerm::VYLeverArm, None),
            (OutsideTerm::SteeringOffset, Some(0.01)),
            (OutsideTerm::YawRateBias, Some(-0.02)),
            (OutsideTerm::Relaxation, Some(0.06)),
        ] {
            assert_eq!(own(&car, term), size, "{term:?}");
        }
    }

    #[test]
    fn what_was_taken_out_of_the_signals_is_in_the_car_again() {
        let signals =
            SignalCorrections { steering_delay_s: 0.04, steering_gain: 0.9, ..SignalCorrections::NONE };
        let car = CarFile {
            vehicle: VehicleParameters::f1tenth(),
            tires: OwnTires::from_parameters(&[9.0, 1.5, 1.0, 0.1, 8.0, 1.4, 0.9, -0.2]),
            effects: effects_of(&signals, 0.05),
        };
        assert_eq!(car.effects().unwrap().len(), 3);
        let of = |term: OutsideTerm| own(&car, term).unwrap();
        let mut steering = [0.1; 20];
        EffectId::of_outside(OutsideTerm::SteeringGain).unwrap().steer(
            &[of(OutsideTerm::SteeringGain)],
            &mut steering,
            0.01,
        );
        assert!((steering[0] - 0.09).abs() < 1e-12);
        assert_eq!((of(OutsideTerm::SteeringDelay), of(OutsideTerm::Relaxation)), (0.04, 0.05));
    }
}
