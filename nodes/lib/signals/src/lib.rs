//! What the car reported, and nothing about why.
//!
//! The way of the data: [`Measurement`]s of several topics, each with its own stamps, are put on the stamps of the odometry
//! by the [`Aligner`]; the [`WindowCutter`] cuts the aligned [`TelemetrySample`]s into [`StateSequence`]s (float32, the unit of
//! work of the whole suite, live and offline; both by the [`Sequencer`]); [`segments`] turns a sequence into evenly sampled stretches without gaps;
//! [`DataHealth`] says what is wrong with it.
//!
//! Frames follow REP-103: x forward, y left, z up; left steer and left yaw are positive.

mod align;
mod channels;
mod checks;
mod cut;
mod error;
mod excitation;
mod health;
mod joined;
mod layout;
mod mask;
mod measurement;
mod pose;
mod segment;
mod sequence;
mod sequencer;
mod signal;
mod topic;
mod window;

pub use align::{AlignConfig, Aligner, Pushed};
pub use channels::{CHANNELS, Channel, Clock, Kind};
pub use checks::{Check, Checks, Finding, Pair, Unchecked, cross_check, lateral_speed_check, steering_check};
pub use error::SignalError;
pub use excitation::Excitation;
pub use health::{DataHealth, FrozenSpan, Gap, stands_still};
pub use joined::Joined;
pub use layout::Layout;
pub use mask::{BadKind, BadSpan, Masked, masked};
pub use measurement::{
    DriveSample, ImuSample, MappedSample, Measurement, OdometrySample, PoseSample, TelemetrySample,
    WheelsSample,
};
pub use pose::{is_dead_reckoning, is_integral_of_twist, pose_delay_s, yaw_rates};
pub use segment::{Segment, segments};
pub use sequence::{Commands, Poses, StateSequence};
pub use sequencer::{Sequencer, Taken, stamp_s};
pub use signal::{Join, Signal, Values};
pub use topic::{Pace, Spikes, TopicHealth};
pub use window::{WindowConfig, WindowCutter};

/// Nanoseconds in a second.
pub const NS_PER_S: f64 = 1e9;

/// The wheels' order in every array of four: front left, front right, rear left, rear right.
pub const WHEELS: [&str; 4] = ["front_left", "front_right", "rear_left", "rear_right"];
