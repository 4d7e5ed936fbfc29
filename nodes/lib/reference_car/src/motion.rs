//! The true motion and forces at an instant, between two steps.

use serde::{Deserialize, Serialize};

use crate::plant_state::{Evaluation, PlantState};
use crate::track::TrackPosition;

/// True motion of the true centre of gravity.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// Time since the start of the run.
    pub time_s: f64,
    /// Position.
    pub x_m: f64,
    /// Position.
    pub y_m: f64,
    /// Heading, not wrapped.
    pub heading_rad: f64,
    /// Longitudinal speed.
    pub v_x_mps: f64,
    /// Lateral speed.
    pub v_y_mps: f64,
    /// Yaw rate.
    pub yaw_rate_radps: f64,
    /// Yaw acceleration.
    pub yaw_acceleration_radps2: f64,
    /// Specific force along the car, in the road plane.
    pub specific_x_mps2: f64,
    /// Specific force to the left, in the road plane.
    pub specific_y_mps2: f64,
    /// Roll angle of the body, left side up positive.
    pub roll_rad: f64,
    /// Pitch angle of the body, squat positive.
    pub pitch_rad: f64,
    /// Angle of the front road wheels.
    pub steering_rad: f64,
    /// Lateral speed as the odometry's filter and delay leave it.
    pub reported_v_y_mps: f64,
    /// Wheel speeds: front left, front right, rear left, rear right.
    pub wheel_radps: [f64; 4],
}

/// What a wheel does.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct WheelTruth {
    /// Longitudinal force in the wheel's frame.
    pub f_x_n: f64,
    /// Lateral force in the wheel's frame.
    pub f_y_n: f64,
    /// Normal load.
    pub f_z_n: f64,
    /// Slip angle, positive when it pushes left.
    pub slip_angle_rad: f64,
    /// Longitudinal slip.
    pub slip_ratio: f64,
    /// Friction of the road under it.
    pub road_friction: f64,
}

/// Everything true at one instant.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct TruthSample {
    /// Motion.
    pub motion: Motion,
    /// Wheels: front left, front right, rear left, rear right.
    pub wheels: [WheelTruth; 4],
    /// Distance along the track, or driven on an open plane.
    pub station_m: f64,
    /// Distance to the left of the centre line.
    pub offset_m: f64,
    /// Bank of the road, left side high positive.
    pub bank_rad: f64,
    /// Slope of the road, uphill positive.
    pub slope_rad: f64,
    /// Sum of the driving or braking forces asked of the wheels.
    pub force_command_n: f64,
}

fn mix(from: f64, to: f64, share: f64) -> f64 {
    from + share * (to - from)
}

impl Motion {
    pub(crate) fn new(time_s: f64, s: &PlantState, e: &Evaluation, reported_v_y_mps: f64) -> Self {
        Self {
            time_s,
            x_m: s.x_m,
            y_m: s.y_m,
            heading_rad: s.heading_rad,
            v_x_mps: s.v_x_mps,
            v_y_mps: s.v_y_mps,
            yaw_rate_radps: s.yaw_rate_radps,
            yaw_acceleration_radps2: e.yaw_acceleration_radps2,
            specific_x_mps2: e.specific_x_mps2,
            specific_y_mps2: e.specific_y_mps2,
            roll_rad: s.roll_rad,
            pitch_rad: s.pitch_rad,
            steering_rad: e.wheels[0].steering_rad,
            reported_v_y_mps,
            wheel_radps: s.wheel_radps,
        }
    }

    /// The motion at `time_s`, linear between two instants.
    pub(crate) fn between(from: &Self, to: &Self, time_s: f64) -> Self {
        let span_s = to.time_s - from.time_s;
        let share = if span_s > 0.0 { (time_s - from.time_s) / span_s } else { 1.0 };
        let m = |pick: fn(&Self) -> f64| mix(pick(from), pick(to), share);
        Self {
            time_s,
            x_m: m(|s| s.x_m),
            y_m: m(|s| s.y_m),
            heading_rad: m(|s| s.heading_rad),
            v_x_mps: m(|s| s.v_x_mps),
            v_y_mps: m(|s| s.v_y_mps),
            yaw_rate_radps: m(|s| s.yaw_rate_radps),
            yaw_acceleration_radps2: m(|s| s.yaw_acceleration_radps2),
            specific_x_mps2: m(|s| s.specific_x_mps2),
            specific_y_mps2: m(|s| s.specific_y_mps2),
            roll_rad: m(|s| s.roll_rad),
            pitch_rad: m(|s| s.pitch_rad),
            steering_rad: m(|s| s.steering_rad),
            reported_v_y_mps: m(|s| s.reported_v_y_mps),
            wheel_radps: std::array::from_fn(|i| mix(from.wheel_radps[i], to.wheel_radps[i], share)),
        }
    }
}

impl TruthSample {
    pub(crate) fn new(
        motion: Motion,
        e: &Evaluation,
        friction: [f64; 4],
        place: TrackPosition,
        road: (f64, f64),
        force_command_n: f64,
    ) -> Self {
        Self {
            motion,
            wheels: std::array::from_fn(|i| {
                let wheel = &e.wheels[i];
                WheelTruth {
                    f_x_n: wheel.force.f_x_n,
                    f_y_n: wheel.force.f_y_n,
                    f_z_n: wheel.load_n,
                    slip_angle_rad: wheel.tan_alpha_now.atan(),
                    slip_ratio: wheel.kappa,
                    road_friction: friction[i],
                }
            }),
            station_m: place.station_m,
            offset_m: place.offset_m,
            bank_rad: road.0,
            slope_rad: road.1,
            force_command_n,
        }
    }

    /// The truth at `time_s`, linear between two instants; the place along the track is the nearer one's.
    pub(crate) fn between(from: &Self, to: &Self, time_s: f64) -> Self {
        let motion = Motion::between(&from.motion, &to.motion, time_s);
        let span_s = to.motion.time_s - from.motion.time_s;
        let share = if span_s > 0.0 { (time_s - from.motion.time_s) / span_s } else { 1.0 };
        let near = if share < 0.5 { from } else { to };
        let wheels = std::array::from_fn(|i| {
            let m = |pick: fn(&WheelTruth) -> f64| mix(pick(&from.wheels[i]), pick(&to.wheels[i]), share);
            WheelTruth {
                f_x_n: m(|w| w.f_x_n),
                f_y_n: m(|w| w.f_y_n),
                f_z_n: m(|w| w.f_z_n),
                slip_angle_rad: m(|w| w.slip_angle_rad),
                slip_ratio: m(|w| w.slip_ratio),
                road_friction: m(|w| w.road_friction),
            }
        });
        Self { motion, wheels, ..*near }
    }

    /// Sum of the front tires' longitudinal forces, lateral forces and loads.
    pub fn front_axle_n(&self) -> [f64; 3] {
        axle(&self.wheels[0], &self.wheels[1])
    }

    /// Sum of the rear tires' longitudinal forces, lateral forces and loads.
    pub fn rear_axle_n(&self) -> [f64; 3] {
        axle(&self.wheels[2], &self.wheels[3])
    }
}

fn axle(left: &WheelTruth, right: &WheelTruth) -> [f64; 3] {
    [left.f_x_n + right.f_x_n, left.f_y_n + right.f_y_n, left.f_z_n + right.f_z_n]
}
