//! Messages of the package `rosgraph_msgs`.

use serde::{Deserialize, Serialize};

use super::builtin_interfaces::Time;
use crate::Message;

/// The time of the simulation or replay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Clock {
    /// Now.
    pub clock: Time,
}

impl Message for Clock {
    const TYPE: &'static str = "rosgraph_msgs/msg/Clock";
}
