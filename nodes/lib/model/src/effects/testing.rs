//! An instant and a window of a drive to try effects on.

use gripsight_vehicle::VehicleParameters;

use super::Effect;
use crate::terms::{Car, Moment, Motion, Outputs};

/// Step between samples.
pub(super) const DT_S: f64 = 0.01;

pub(super) fn car() -> Car<f64> {
    Car::nominal(&VehicleParameters::f1tenth(), [1.0, 1.0])
}

/// Braking in a left turn.
pub(super) fn moment() -> Moment<f64> {
    Moment {
        v_x_mps: 5.0,
        yaw_rate_radps: 1.2,
        steering_rad: 0.1,
        a_y_mps2: 6.0,
        rolled_a_y_mps2: 5.0,
        front_use: 0.6,
        a_x_mps2: -2.0,
        carried_a_x_mps2: -2.0,
        force_x_mps2: -2.0,
        minutes: 2.0,
        lap_share: 0.3,
        lap_m: 60.0,
        place_rad: 1.9,
    }
}

fn wave(size: f64, phase: f64) -> Vec<f64> {
    (0..50).map(|k| size * (f64::from(k) * 0.2 + phase).sin()).collect()
}

/// Steering angles to both sides.
pub(super) fn steering() -> Vec<f64> {
    wave(0.1, 0.0)
}

/// A motion with all its signals.
pub(super) fn outputs() -> Outputs<f64> {
    Outputs {
        dt_s: DT_S,
        v_y_mps: wave(0.2, 0.3),
        yaw_rate_radps: wave(1.0, 0.7),
        yaw_acceleration_radps2: wave(4.0, 1.1),
        a_y_mps2: wave(5.0, 1.5),
        a_x_mps2: wave(2.0, 1.9),
        v_x_mps: wave(0.3, 2.3),
        heading_rad: wave(0.5, 2.7),
    }
}

/// Fails unless an effect at its null values leaves everything exactly as it is.
pub(super) fn assert_absent_at_null<E: Effect>() {
    let null: Vec<f64> = E::SPEC.parameters.iter().map(|p| p.null).collect();
    let at = moment();
    let mut angles = steering();
    E::steer(&null, &mut angles, DT_S);
    assert_eq!(angles, steering());
    E::steer_held(&null, &mut angles, DT_S);
    assert_eq!(angles, steering());
    let mut changed = car();
    E::car(&null, &mut changed);
    assert_eq!(format!("{changed:?}"), format!("{:?}", car()));
    let mut axles = car().axles_at_rest();
    E::loads(&null, &car(), &at, &mut axles);
    E::grip(&null, &car(), &at, &mut axles);
    assert_eq!(format!("{axles:?}"), format!("{:?}", car().axles_at_rest()));
    let mut motion = Motion::none();
    E::motion(&null, &car(), &at, &mut motion);
    assert_eq!(format!("{motion:?}"), format!("{:?}", Motion::<f64>::none()));
    let mut sensed = outputs();
    E::sense(&null, &mut sensed);
    assert_eq!(format!("{sensed:?}"), format!("{:?}", outputs()));
}
