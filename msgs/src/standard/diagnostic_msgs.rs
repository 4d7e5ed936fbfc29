//! Messages of the package `diagnostic_msgs`.

use serde::{Deserialize, Serialize};

use super::std_msgs::Header;
use crate::Message;

/// The states of several parts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DiagnosticArray {
    /// Time of the report.
    pub header: Header,
    /// One entry per part.
    pub status: Vec<DiagnosticStatus>,
}

impl Message for DiagnosticArray {
    const TYPE: &'static str = "diagnostic_msgs/msg/DiagnosticArray";
}

/// The state of one part.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// One of the above.
    pub level: u8,
    /// Part that reports.
    pub name: String,
    /// State in words.
    pub message: String,
    /// Device.
    pub hardware_id: String,
    /// Figures behind it.
    pub values: Vec<KeyValue>,
}

impl DiagnosticStatus {
    /// See the message.
    pub const OK: u8 = 0;
    /// See the message.
    pub const WARN: u8 = 1;
    /// See the message.
    pub const ERROR: u8 = 2;
    /// See the message.
    pub const STALE: u8 = 3;
}

impl Message for DiagnosticStatus {
    const TYPE: &'static str = "diagnostic_msgs/msg/DiagnosticStatus";
}

/// A named value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KeyValue {
    /// Name.
    pub key: String,
    /// Value as text.
    pub value: String,
}

impl Message for KeyValue {
    const TYPE: &'static str = "diagnostic_msgs/msg/KeyValue";
}
