//! The reports of the sensors.

use gripsight_signals::Measurement;
use serde::{Deserialize, Serialize};

use crate::track::wrap_angle;

/// A stamped report of one sensor. SI units, REP-103.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "sensor", rename_all = "snake_case")]
pub enum SensorSample {
    /// Pose and twist of the nominal centre of gravity.
    Odometry(OdometrySample),
    /// What the driver asked for; it holds until the next.
    Drive(DriveSample),
    /// Accelerations and yaw rate.
    Imu(ImuSample),
    /// Wheel speeds.
    Wheels(WheelSample),
}

/// Pose in the map frame, twist in the car's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OdometrySample {
    /// Time since the start of the run.
    pub stamp_s: f64,
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
}

/// A drive command.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DriveSample {
    /// Time since the start of the run.
    pub stamp_s: f64,
    /// Road-wheel angle.
    pub steering_rad: f64,
    /// Speed aimed at.
    pub speed_mps: f64,
    /// Longitudinal force asked of the tires over the nominal mass.
    pub acceleration_mps2: f64,
}

/// Specific force and yaw rate; at rest on level ground the vertical acceleration is g.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ImuSample {
    /// Time since the start of the run.
    pub stamp_s: f64,
    /// Forward.
    pub a_x_mps2: f64,
    /// Left.
    pub a_y_mps2: f64,
    /// Up.
    pub a_z_mps2: f64,
    /// Yaw rate.
    pub yaw_rate_radps: f64,
}

/// Speeds of the wheels: front left, front right, rear left, rear right.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WheelSample {
    /// Time since the start of the run.
    pub stamp_s: f64,
    /// Wheel speeds.
    pub wheel_radps: [f64; 4],
}

impl SensorSample {
    /// Time since the start of the run.
    pub fn stamp_s(&self) -> f64 {
        match self {
            Self::Odometry(s) => s.stamp_s,
            Self::Drive(s) => s.stamp_s,
            Self::Imu(s) => s.stamp_s,
            Self::Wheels(s) => s.stamp_s,
        }
    }

    /// The report as telemetry, its stamp counted from `start_ns`.
    pub fn measurement(&self, start_ns: i64) -> Measurement {
        let stamp_ns = start_ns + (self.stamp_s() * 1e9).round() as i64;
        match self {
            Self::Odometry(s) => Measurement::Odometry(gripsight_signals::OdometrySample {
                stamp_ns,
                x_m: s.x_m,
                y_m: s.y_m,
                yaw_rad: wrap_angle(s.heading_rad),
                v_x_mps: s.v_x_mps,
                v_y_mps: s.v_y_mps,
                yaw_rate_radps: s.yaw_rate_radps,
            }),
            Self::Drive(s) => Measurement::Drive(gripsight_signals::DriveSample {
                stamp_ns,
                steering_angle_rad: s.steering_rad,
                speed_mps: s.speed_mps,
                acceleration_mps2: s.acceleration_mps2,
            }),
            Self::Imu(s) => Measurement::Imu(gripsight_signals::ImuSample {
                stamp_ns,
                a_x_mps2: s.a_x_mps2,
                a_y_mps2: s.a_y_mps2,
                yaw_rate_radps: s.yaw_rate_radps,
            }),
            Self::Wheels(s) => Measurement::Wheels(gripsight_signals::WheelsSample {
                stamp_ns,
                speed: s.wheel_radps,
                effort_nm: None,
            }),
        }
    }
}
