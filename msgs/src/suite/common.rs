//! What several messages share.

use serde::{Deserialize, Serialize};

use crate::Message;

/// What ties the messages of one identification run together. A receiver acts on a message only
/// when these fields fit what it holds; lost, late and repeated messages then do no harm.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Handshake {
    /// Names one run of the identification; unique per start of the sender.
    pub run_id: String,
    /// The StateSequence that the message is about: the stamp of its first sample in ns.
    pub sequence_id: u64,
    /// Turn of the outer loop, 0 = the start of the run.
    pub iteration: u32,
    /// Changes with any of the vehicle parameters in use (64 bits, hexadecimal).
    pub vehicle_hash: String,
    /// Seed of everything random in the run.
    pub seed: u64,
}

impl Message for Handshake {
    const TYPE: &'static str = "gripsight_msgs/msg/Handshake";
}

/// An estimate with its 90 % interval. The unit is that of the field that holds it.
/// Bounds that are not known are NaN.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Best estimate.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

impl Message for Interval {
    const TYPE: &'static str = "gripsight_msgs/msg/Interval";
}

/// Two ends of what was visited. The unit is that of the field that holds it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Range {
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
}

impl Message for Range {
    const TYPE: &'static str = "gripsight_msgs/msg/Range";
}
