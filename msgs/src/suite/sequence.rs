//! Windows of the car's motion.

use serde::{Deserialize, Serialize};

use crate::standard::std_msgs::Header;
use crate::{Handshake, Message, Range};

/// A window of the car's motion, one array per channel, all of one length.
/// A channel that is not recorded is empty. Stamps and positions are relative to the first sample.
/// A sequence that is too long for one message travels in chunks that share `handshake.sequence_id`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StateSequence {
    /// Stamp of the first sample of the whole sequence; frame of the pose.
    pub header: Header,
    /// Run and number of the sequence.
    pub handshake: Handshake,
    /// Number of this part, counted from 0.
    pub chunk: u32,
    /// Parts in all, at least 1.
    pub chunks: u32,
    /// After header.stamp (s).
    pub time_s: Vec<f32>,
    /// Forward speed (m/s).
    pub v_x_mps: Vec<f32>,
    /// Lateral speed, left positive (m/s).
    pub v_y_mps: Vec<f32>,
    /// Yaw rate, left turn positive (rad/s).
    pub yaw_rate_radps: Vec<f32>,
    /// Steering angle as commanded or measured, left positive (rad).
    pub steering_rad: Vec<f32>,
    /// Position, relative to the first sample (m).
    pub x_m: Vec<f32>,
    /// Position, relative to the first sample (m).
    pub y_m: Vec<f32>,
    /// Heading in the frame of the pose, unwrapped (rad).
    pub yaw_rad: Vec<f32>,
    /// Specific force of the inertial sensor, forward positive (m/s^2).
    pub a_x_mps2: Vec<f32>,
    /// Specific force of the inertial sensor, left positive (m/s^2).
    pub a_y_mps2: Vec<f32>,
    /// Yaw rate of the inertial sensor, left turn positive (rad/s).
    pub gyro_yaw_rate_radps: Vec<f32>,
    /// Commanded speed (m/s).
    pub command_speed_mps: Vec<f32>,
    /// Commanded acceleration (m/s^2).
    pub command_acceleration_mps2: Vec<f32>,
    /// Front left wheel, forward positive (rad/s).
    pub wheel_speed_fl_radps: Vec<f32>,
    /// Front right wheel, forward positive (rad/s).
    pub wheel_speed_fr_radps: Vec<f32>,
    /// Rear left wheel, forward positive (rad/s).
    pub wheel_speed_rl_radps: Vec<f32>,
    /// Rear right wheel, forward positive (rad/s).
    pub wheel_speed_rr_radps: Vec<f32>,
    /// Torque on both front wheels together, driving positive (N m).
    pub wheel_effort_front_nm: Vec<f32>,
    /// Torque on both rear wheels together, driving positive (N m).
    pub wheel_effort_rear_nm: Vec<f32>,
}

impl Message for StateSequence {
    const TYPE: &'static str = "gripsight_msgs/msg/StateSequence";
}

/// How much a StateSequence can tell about the tires, and what was wrong with its samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Excitation {
    /// Stamp of the first sample of the sequence.
    pub header: Header,
    /// The sequence that this is about.
    pub handshake: Handshake,
    /// True when the sequence is worth an identification.
    pub sufficient: bool,
    /// Why it is not; empty when sufficient.
    pub reason: String,
    /// Length of the sequence (s).
    pub duration_s: f64,
    /// Samples in the sequence.
    pub samples: u32,
    /// Places where samples are missing.
    pub gaps: u32,
    /// Samples left out: not finite, out of order or repeated.
    pub rejected_samples: u32,
    /// Mean forward speed (m/s).
    pub v_x_mean_mps: f64,
    /// Range of the forward speed (m/s).
    pub v_x_mps: Range,
    /// Range of v_x times yaw rate, left positive (m/s^2).
    pub lateral_acceleration_mps2: Range,
    /// Range of the steering angle (rad).
    pub steering_rad: Range,
    /// Root mean square of the steering rate (rad/s).
    pub steering_rate_rms_radps: f64,
    /// Root mean square of the lateral speed; 0: not measured (m/s).
    pub v_y_rms_mps: f64,
}

impl Message for Excitation {
    const TYPE: &'static str = "gripsight_msgs/msg/Excitation";
}
