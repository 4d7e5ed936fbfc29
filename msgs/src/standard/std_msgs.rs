//! Messages of the package `std_msgs`.

use serde::{Deserialize, Serialize};

use super::builtin_interfaces::Time;
use crate::Message;

/// Time and frame of what a message holds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Time of measurement.
    pub stamp: Time,
    /// Coordinate frame.
    pub frame_id: String,
}

impl Message for Header {
    const TYPE: &'static str = "std_msgs/msg/Header";
}
