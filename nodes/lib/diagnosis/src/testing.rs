//! A drive for unit tests.

#![allow(clippy::unwrap_used)]

use gripsight_estimation::split;
use gripsight_model::{BASE, EffectId, Flexible, Recording, Site};
use gripsight_signals::StateSequence;
use gripsight_vehicle::{
    Input, OwnTires, PacejkaParameters, SingleTrack, State as Motion, VehicleParameters,
};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use crate::around::Around;
use crate::columns::Columns;
use crate::engine::Engine;
use crate::hypotheses::terms;
use crate::infer::FIRST;
use crate::joint::{Joint, Weighed};
use crate::trust::TireTrust;

const DT_S: f64 = 0.01;

pub(crate) fn tires() -> OwnTires {
    OwnTires::assumed(&PacejkaParameters::from_array([7.0, 1.5, 1.0, 0.1, 8.0, 1.4, 0.95, -0.2]))
}

/// The nominal car's drive over wheels that follow the recorded command with a time constant.
pub(crate) fn drive(vehicle: &VehicleParameters, lag_s: f64) -> Recording {
    const SAMPLES: usize = 2400;
    let car = SingleTrack::new(vehicle, &tires().assumed_effective());
    let random = &mut rand_chacha::ChaCha8Rng::seed_from_u64(9);
    let mut noise = |size: f64| -> f64 {
        let normal: f64 = StandardNormal.sample(random);
        size * normal
    };
    let command = |k: usize| {
        let t_s = k as f64 * DT_S;
        0.10 * (2.1 * t_s).sin() + 0.05 * (9.0 * t_s).sin() + 0.03 * (17.0 * t_s).sin()
    };
    let v_x_mps = |k: usize| 4.0 + (0.7 * k as f64 * DT_S).sin();
    let mut wheel_rad = vec![0.0];
    for k in 1..SAMPLES {
        let follow = if lag_s > 0.0 { 1.0 - (-DT_S / lag_s).exp() } else { 1.0 };
        let before: f64 = wheel_rad[k - 1];
        wheel_rad.push(before + follow * (command(k - 1) - before));
    }
    let input = |k: usize| Input { v_x_mps: v_x_mps(k), steering_rad: wheel_rad[k] };
    let mut x = Motion { v_y_mps: 0.0, yaw_rate_radps: 0.0 };
    let mut sequence = StateSequence::default();
    for k in 0..SAMPLES {
        sequence.time_s.push((k as f64 * DT_S) as f32);
        sequence.v_x_mps.push(v_x_mps(k) as f32);
        sequence.v_y_mps.push((x.v_y_mps + noise(0.01)) as f32);
        sequence.yaw_rate_radps.push((x.yaw_rate_radps + noise(0.02)) as f32);
        sequence.steering_rad.push(command(k) as f32);
        x = car.step(x, &input(k), &input((k + 1).min(SAMPLES - 1)), DT_S, 0.0025);
    }
    Recording::new(&sequence).unwrap()
}

/// A drive with a lag, everything linearised around its best tires.
pub(crate) fn with_around<T>(lag_s: f64, then: impl FnOnce(&Around<'_, '_>, &Weighed) -> T) -> T {
    let vehicle = VehicleParameters::f1tenth();
    let recording = drive(&vehicle, lag_s);
    let engine = Engine::new(&recording, &vehicle, tires(), TireTrust::file());
    let windows = split(&recording, true).training;
    let null = engine.fit(&[], &engine.blank(), None, &windows, 15);
    let mut library: Vec<EffectId> = EffectId::background().collect();
    library.extend([EffectId::SteeringLag, EffectId::SteeringRateLimit, EffectId::VyBias]);
    let flexible = Flexible::new(&recording, 0.1, vehicle.wheelbase_m(), &Site::ALL);
    let columns = Columns::new(library.clone(), flexible);
    let mut values = columns.blank(&engine);
    values[..BASE].copy_from_slice(&null.parameters[..BASE]);
    let joint = Joint::around(&engine, &columns, &values, &null.starts, &windows).unwrap();
    let scale = vec![1.0; recording.channels.len()];
    let weighed = joint.weighed(&scale);
    let terms = terms(&engine, &columns, &values, &library);
    let around = Around {
        engine: &engine,
        columns: &columns,
        terms: &terms,
        values: &values,
        starts: &null.starts,
        windows: &windows,
        dispersion: 1.0,
        joint: &joint,
        scale: &scale,
    };
    then(&around, &weighed)
}

/// The configuration with some effects.
pub(crate) fn configured(around: &Around<'_, '_>, effects: &[EffectId]) -> Vec<usize> {
    let mut chosen = vec![0; around.terms.len()];
    for effect in effects {
        chosen[FIRST + around.columns.effects.iter().position(|e| e == effect).unwrap()] = 1;
    }
    chosen
}
