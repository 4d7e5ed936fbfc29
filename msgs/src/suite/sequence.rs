//! Windows of the car's motion.

use serde::{Deserialize, Serialize};

use crate::standard::std_msgs::Header;
use crate::{Handshake, Message, Range};

macro_rules! message {
    ($($name:ident, $clock:ident, $required:literal, $kind:ident, $unit:literal, $meaning:literal;)*) => {
        /// A window of the car's motion, one array per channel, on three clocks: the samples' (`time_s`), the commands'
        /// (`command_time_s`), and that of a localisation with a topic of its own (`pose_time_s`); each array is as long as its clock's.
        /// A channel that is not recorded is empty. Stamps and positions are relative to the first sample.
        /// A sequence that is too long for one message travels in chunks that share `handshake.sequence_id`.
        ///
        /// The channels are those of the one table, [`gripsight_signals::for_each_channel`].
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
            $(#[doc = concat!("`", $unit, "`: ", $meaning)] pub $name: Vec<f32>,)*
        }

        impl StateSequence {
            /// The channels, in the order of [`gripsight_signals::CHANNELS`].
            #[must_use]
            pub fn channels_mut(&mut self) -> Vec<&mut Vec<f32>> {
                vec![$(&mut self.$name),*]
            }
        }
    };
}

gripsight_signals::for_each_channel!(message);

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
