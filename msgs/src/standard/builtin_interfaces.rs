//! Messages of the package `builtin_interfaces`.

use serde::{Deserialize, Serialize};

use crate::Message;

/// A length of time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Duration {
    /// Whole seconds, rounded down (s).
    pub sec: i32,
    /// The rest, below 1e9 (ns).
    pub nanosec: u32,
}

impl Message for Duration {
    const TYPE: &'static str = "builtin_interfaces/msg/Duration";
}

/// A point in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Time {
    /// Whole seconds since the epoch of the clock (s).
    pub sec: i32,
    /// The rest, below 1e9 (ns).
    pub nanosec: u32,
}

impl Message for Time {
    const TYPE: &'static str = "builtin_interfaces/msg/Time";
}
