//! A recording as the car would have made it without the effects of a model: what its tires are to be identified from.
//!
//! The recorded steering becomes the angle of the road wheels, the recorded speed the true one. What the other effects do to motion and
//! sensors is the difference of two rollouts on that steering and speed, of the extended model and of the same without its effects. Both
//! start from the measured state some time before, so that the start is forgotten. That difference is taken off the signals.

use gripsight_model::{Car, Recording, Window};
use gripsight_signals::StateSequence;
use gripsight_vehicle::VehicleParameters;

use crate::engine::Engine;
use crate::trust::TireTrust;
use crate::{ExtendedModelFile, GapError};

/// Time that both rollouts have to forget their start.
const RUN_IN_S: f64 = 1.0;
/// Time over which their difference is used.
const USED_S: f64 = 1.0;

/// What is added to the signals of a stretch.
struct Correction {
    start_time_s: f64,
    dt_s: f64,
    steering_rad: Vec<f64>,
    v_y_mps: Vec<f64>,
    yaw_rate_radps: Vec<f64>,
    a_y_mps2: Vec<f64>,
}

/// Takes the effects of a model out of a recording. Samples in stretches too short for the model are left out.
///
/// # Errors
/// What is wrong with telemetry or model file; [`GapError::NotFinite`] where the model without its effects cannot follow the drive.
pub fn without_effects(
    sequence: &StateSequence,
    vehicle: &VehicleParameters,
    model: &ExtendedModelFile,
) -> Result<StateSequence, GapError> {
    let recorded = Recording::new(sequence)?;
    let (held, usual) = model.parameters()?;
    let mut car = Car::nominal(vehicle, [model.tires.front.d, model.tires.rear.d]);
    let mut true_inputs = recorded.clone();
    for (effect, own) in &held {
        effect.car(own, &mut car);
        for run in &mut true_inputs.runs {
            run.steer(*effect, own);
        }
    }
    let speed_factor: f64 = car.speed_factor;
    for run in &mut true_inputs.runs {
        run.v_x_mps.iter_mut().for_each(|v| *v *= speed_factor);
    }
    let trust = TireTrust::file();
    let extended =
        Engine { held, usual: usual.clone(), ..Engine::new(&recorded, vehicle, model.tires, trust) };
    let plain = Engine { usual, ..Engine::new(&true_inputs, vehicle, model.tires, trust) };
    let corrections = (0..recorded.runs.len())
        .map(|segment| correction(&extended, &plain, segment))
        .collect::<Result<Vec<_>, _>>()?;
    Ok(applied(sequence, &corrections, speed_factor))
}

fn correction(extended: &Engine<'_>, plain: &Engine<'_>, segment: usize) -> Result<Correction, GapError> {
    let (recorded, true_run) = (&extended.recording.runs[segment], &plain.recording.runs[segment]);
    let samples = |time_s: f64| (time_s / recorded.dt_s).round().max(1.0) as usize;
    let models = [extended, plain].map(|engine| {
        let nominal = engine.nominal_model();
        (engine.model(&nominal.effects, None), nominal.parameters)
    });
    let difference = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<f64>>();
    let mut out = Correction {
        start_time_s: recorded.start_time_s,
        dt_s: recorded.dt_s,
        steering_rad: difference(&true_run.steering_rad, &recorded.steering_rad),
        v_y_mps: Vec::new(),
        yaw_rate_radps: Vec::new(),
        a_y_mps2: Vec::new(),
    };
    let mut used = 0;
    while used < recorded.len() {
        let to = (used + samples(USED_S)).min(recorded.len());
        let from = used.saturating_sub(samples(RUN_IN_S));
        let window = Window { segment, from, len: to - from };
        let start = [recorded.smooth[0][from], recorded.smooth[1][from]];
        let [with, without] = models.each_ref().map(|(model, p)| model.predict(p, start, &window));
        for (target, a, b) in [
            (&mut out.v_y_mps, &without.v_y_mps, &with.v_y_mps),
            (&mut out.yaw_rate_radps, &without.yaw_rate_radps, &with.yaw_rate_radps),
            (&mut out.a_y_mps2, &without.a_y_mps2, &with.a_y_mps2),
        ] {
            target.extend(difference(&a[used - from..], &b[used - from..]));
        }
        used = to;
    }
    let finite =
        [&out.v_y_mps, &out.yaw_rate_radps, &out.a_y_mps2].iter().all(|c| c.iter().all(|v| v.is_finite()));
    if finite { Ok(out) } else { Err(GapError::NotFinite) }
}

fn applied(sequence: &StateSequence, corrections: &[Correction], speed_factor: f64) -> StateSequence {
    let mut out = sequence.clone();
    let mut kept = vec![false; sequence.len()];
    for (i, &time_s) in sequence.time_s.iter().enumerate() {
        let Some((here, place)) = corrections.iter().find_map(|c| Some((c, c.place(f64::from(time_s))?)))
        else {
            continue;
        };
        kept[i] = true;
        let add = |channel: &mut Vec<f32>, correction: &[f64]| {
            if let Some(value) = channel.get_mut(i) {
                *value = (f64::from(*value) + between(correction, place)) as f32;
            }
        };
        add(&mut out.steering_rad, &here.steering_rad);
        add(&mut out.v_y_mps, &here.v_y_mps);
        add(&mut out.yaw_rate_radps, &here.yaw_rate_radps);
        add(&mut out.gyro_yaw_rate_radps, &here.yaw_rate_radps);
        add(&mut out.a_y_mps2, &here.a_y_mps2);
        out.v_x_mps[i] = (f64::from(out.v_x_mps[i]) * speed_factor) as f32;
    }
    out.retain(|i| kept[i]);
    // What is left is the wheels' angle, and no command.
    out.command_steering_rad.clear();
    out
}

impl Correction {
    /// Where a time lies in the stretch, in samples.
    fn place(&self, time_s: f64) -> Option<f64> {
        const ROUNDING: f64 = 1e-3;
        let place = (time_s - self.start_time_s) / self.dt_s;
        let last = (self.v_y_mps.len() - 1) as f64;
        (place > -ROUNDING && place < last + ROUNDING).then(|| place.clamp(0.0, last))
    }
}

fn between(series: &[f64], place: f64) -> f64 {
    let left = place.floor() as usize;
    let right = (left + 1).min(series.len() - 1);
    series[left] + (series[right] - series[left]) * (place - left as f64)
}
