//! Messages of the package `rcl_interfaces`.

use serde::{Deserialize, Serialize};

use super::builtin_interfaces::Time;
use crate::Message;

/// The range of a double parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FloatingPointRange {
    /// Smallest value.
    pub from_value: f64,
    /// Largest value.
    pub to_value: f64,
    /// Step; 0: any value between.
    pub step: f64,
}

impl Message for FloatingPointRange {
    const TYPE: &'static str = "rcl_interfaces/msg/FloatingPointRange";
}

/// The range of an integer parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IntegerRange {
    /// Smallest value.
    pub from_value: i64,
    /// Largest value.
    pub to_value: i64,
    /// Step; 0: any value between.
    pub step: u64,
}

impl Message for IntegerRange {
    const TYPE: &'static str = "rcl_interfaces/msg/IntegerRange";
}

/// Names of parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ListParametersResult {
    /// Full names.
    pub names: Vec<String>,
    /// Their prefixes.
    pub prefixes: Vec<String>,
}

impl Message for ListParametersResult {
    const TYPE: &'static str = "rcl_interfaces/msg/ListParametersResult";
}

/// A line of a log.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Log {
    /// Time of the line.
    pub stamp: Time,
    /// One of the above.
    pub level: u8,
    /// Logger.
    pub name: String,
    /// Text.
    pub msg: String,
    /// Source file.
    pub file: String,
    /// Source function.
    pub function: String,
    /// Source line.
    pub line: u32,
}

impl Log {
    /// See the message.
    pub const DEBUG: u8 = 10;
    /// See the message.
    pub const INFO: u8 = 20;
    /// See the message.
    pub const WARN: u8 = 30;
    /// See the message.
    pub const ERROR: u8 = 40;
    /// See the message.
    pub const FATAL: u8 = 50;
}

impl Message for Log {
    const TYPE: &'static str = "rcl_interfaces/msg/Log";
}

/// A named parameter.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Name.
    pub name: String,
    /// Value.
    pub value: ParameterValue,
}

impl Message for Parameter {
    const TYPE: &'static str = "rcl_interfaces/msg/Parameter";
}

/// What a parameter is and may be.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParameterDescriptor {
    /// Name.
    pub name: String,
    /// As in ParameterValue.
    #[serde(rename = "type")]
    pub kind: u8,
    /// Meaning and unit.
    pub description: String,
    /// Rules that the ranges cannot say.
    pub additional_constraints: String,
    /// True when it cannot change while the node runs.
    pub read_only: bool,
    /// True when the type may change.
    pub dynamic_typing: bool,
    /// Range of a double.
    pub floating_point_range: Vec<FloatingPointRange>,
    /// Range of an integer.
    pub integer_range: Vec<IntegerRange>,
}

impl Message for ParameterDescriptor {
    const TYPE: &'static str = "rcl_interfaces/msg/ParameterDescriptor";
}

/// A change of a node's parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParameterEvent {
    /// Time of the change.
    pub stamp: Time,
    /// Full name of the node.
    pub node: String,
    /// Declared.
    pub new_parameters: Vec<Parameter>,
    /// Changed.
    pub changed_parameters: Vec<Parameter>,
    /// Removed.
    pub deleted_parameters: Vec<Parameter>,
}

impl Message for ParameterEvent {
    const TYPE: &'static str = "rcl_interfaces/msg/ParameterEvent";
}

/// The value of a parameter: `type` says which of the fields counts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParameterValue {
    /// 0 not set, 1 bool, 2 integer, 3 double, 4 string, 5 to 9 arrays of byte, bool, integer, double,
    /// string.
    #[serde(rename = "type")]
    pub kind: u8,
    /// Value of type 1.
    pub bool_value: bool,
    /// Value of type 2.
    pub integer_value: i64,
    /// Value of type 3.
    pub double_value: f64,
    /// Value of type 4.
    pub string_value: String,
    /// Value of type 5.
    #[serde(with = "serde_bytes")]
    pub byte_array_value: Vec<u8>,
    /// Value of type 6.
    pub bool_array_value: Vec<bool>,
    /// Value of type 7.
    pub integer_array_value: Vec<i64>,
    /// Value of type 8.
    pub double_array_value: Vec<f64>,
    /// Value of type 9.
    pub string_array_value: Vec<String>,
}

impl Message for ParameterValue {
    const TYPE: &'static str = "rcl_interfaces/msg/ParameterValue";
}

/// What became of a request to set parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetParametersResult {
    /// True when they were set.
    pub successful: bool,
    /// Why not.
    pub reason: String,
}

impl Message for SetParametersResult {
    const TYPE: &'static str = "rcl_interfaces/msg/SetParametersResult";
}
