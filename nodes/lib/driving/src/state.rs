//! What goes into a driver and comes out, and the car a moment later.

use std::collections::VecDeque;

use gripsight_vehicle::{Input, PacejkaParameters, SingleTrack, State, VehicleParameters};

/// Slower than this the slip angles of a measured state are noise.
const SLOW_MPS: f64 = 1.0;

/// What odometry says of the car.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarState {
    /// When.
    pub stamp_s: f64,
    /// Position of the centre of gravity.
    pub x_m: f64,
    /// Position of the centre of gravity.
    pub y_m: f64,
    /// Heading.
    pub heading_rad: f64,
    /// Forward speed.
    pub v_x_mps: f64,
    /// Speed to the left.
    pub v_y_mps: f64,
    /// Yaw rate.
    pub yaw_rate_radps: f64,
}

impl CarState {
    /// Whether all fields are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let Self { stamp_s, x_m, y_m, heading_rad, v_x_mps, v_y_mps, yaw_rate_radps } = *self;
        [stamp_s, x_m, y_m, heading_rad, v_x_mps, v_y_mps, yaw_rate_radps].iter().all(|v| v.is_finite())
    }

    /// Slip angle of the rear axle.
    pub(crate) fn rear_slip_rad(&self, vehicle: &VehicleParameters) -> f64 {
        let behind_mps = vehicle.l_r_m * self.yaw_rate_radps - self.v_y_mps;
        behind_mps.atan2(self.v_x_mps.max(SLOW_MPS))
    }

    /// Direction of travel; of a car that hardly moves, whose v_y is noise, about its heading.
    pub(crate) fn course_rad(&self) -> f64 {
        self.heading_rad + self.v_y_mps.atan2(self.v_x_mps.max(SLOW_MPS))
    }
}

/// What a driver asks of the car.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DriveCommand {
    /// Steering command, as the actuator takes it.
    pub steering_rad: f64,
    /// Speed aimed at.
    pub speed_mps: f64,
    /// Longitudinal acceleration, feed-forward and feedback together.
    pub acceleration_mps2: f64,
}

/// A road-wheel angle asked from a stamp on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Asked {
    pub(crate) from_s: f64,
    pub(crate) angle_rad: f64,
    pub(crate) acceleration_mps2: f64,
}

/// Step of the wheels and of the prediction.
const STEP_S: f64 = 0.01;
/// Time constants of a lag after which it is over.
const SETTLED: f64 = 4.0;

/// From a command until the wheels are where it wants them.
pub(crate) fn settles_s(delay_s: f64, lag_s: f64) -> f64 {
    delay_s + SETTLED * lag_s
}

/// The wheels' angle at a time: each angle acts `delay_s` after it was asked for, and the wheels follow it with a lag. `None`: nothing was asked for.
pub(crate) fn wheels_rad(asked: &VecDeque<Asked>, time_s: f64, delay_s: f64, lag_s: f64) -> Option<f64> {
    let at = |then_s: f64| {
        let acting = asked.iter().rev().find(|a| a.from_s <= then_s - delay_s + 1e-9);
        acting.or_else(|| asked.front()).map(|a| a.angle_rad)
    };
    let steps = (settles_s(0.0, lag_s) / STEP_S).ceil();
    let follows = 1.0 - (-STEP_S / lag_s.max(1e-9)).exp();
    let mut wheels = at(time_s - steps * STEP_S)?;
    for step in (0..steps as usize).rev() {
        wheels += follows * (at(time_s - step as f64 * STEP_S)? - wheels);
    }
    Some(wheels)
}

/// The car `age_s + delay_s + lead_s` later, by the single-track model with the commands that are still on their way. `lacks`: accelerations of v_y and of
/// the yaw rate beyond the model's.
pub(crate) fn predict(
    now: &CarState,
    (age_s, delay_s, lag_s): (f64, f64, f64),
    lead_s: f64,
    lacks: [f64; 2],
    asked: &VecDeque<Asked>,
    vehicle: &VehicleParameters,
    tires: &PacejkaParameters,
) -> CarState {
    const SUBSTEP_S: f64 = 0.002;
    let car = SingleTrack::new(vehicle, tires);
    let mut at = *now;
    let ahead_s = age_s + delay_s + lead_s;
    let steps = (ahead_s / STEP_S).ceil();
    let dt_s = ahead_s / steps.max(1.0);
    for _ in 0..steps as usize {
        // What acts at this instant was asked one delay before.
        let then_s = at.stamp_s - delay_s;
        let acting = asked.iter().rev().find(|a| a.from_s <= then_s + 1e-9);
        let acting = acting.or_else(|| asked.front());
        let a_x = acting.map_or(0.0, |a| a.acceleration_mps2);
        let angle_rad = wheels_rad(asked, at.stamp_s, delay_s, lag_s).unwrap_or(0.0);
        let input = Input { v_x_mps: at.v_x_mps, steering_rad: angle_rad };
        let from = State { v_y_mps: at.v_y_mps, yaw_rate_radps: at.yaw_rate_radps };
        let mut to = car.step(from, &input, &input, dt_s, SUBSTEP_S);
        to.v_y_mps += dt_s * lacks[0];
        to.yaw_rate_radps += dt_s * lacks[1];
        let v_y = 0.5 * (from.v_y_mps + to.v_y_mps);
        let heading = at.heading_rad + 0.25 * dt_s * (from.yaw_rate_radps + to.yaw_rate_radps);
        let (sin, cos) = heading.sin_cos();
        at.x_m += dt_s * (at.v_x_mps * cos - v_y * sin);
        at.y_m += dt_s * (at.v_x_mps * sin + v_y * cos);
        at.heading_rad += 0.5 * dt_s * (from.yaw_rate_radps + to.yaw_rate_radps);
        at.v_x_mps = (at.v_x_mps + dt_s * a_x).max(0.0);
        (at.v_y_mps, at.yaw_rate_radps) = (to.v_y_mps, to.yaw_rate_radps);
        at.stamp_s += dt_s;
    }
    at
}
