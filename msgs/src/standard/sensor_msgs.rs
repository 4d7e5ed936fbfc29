//! Messages of the package `sensor_msgs`.

use serde::{Deserialize, Serialize};

use super::geometry_msgs::Quaternion;
use super::geometry_msgs::Vector3;
use super::std_msgs::Header;
use crate::Message;

/// A compressed picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CompressedImage {
    /// Time of exposure; optical frame.
    pub header: Header,
    /// Jpeg or png, maybe with the pixel layout.
    pub format: String,
    /// The compressed file.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}

impl Message for CompressedImage {
    const TYPE: &'static str = "sensor_msgs/msg/CompressedImage";
}

/// A picture, row by row.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Image {
    /// Time of exposure; optical frame.
    pub header: Header,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// Layout of a pixel, e.g. rgb8.
    pub encoding: String,
    /// 1 when multi-byte values are big-endian.
    pub is_bigendian: u8,
    /// Length of a row, padding included (byte).
    pub step: u32,
    /// Step * height bytes.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}

impl Message for Image {
    const TYPE: &'static str = "sensor_msgs/msg/Image";
}

/// A reading of an inertial sensor. A covariance that begins with -1 says: not measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Imu {
    /// Time and frame of the measurement.
    pub header: Header,
    /// Orientation.
    pub orientation: Quaternion,
    /// 3 x 3 by rows (rad^2).
    pub orientation_covariance: [[f64; 3]; 3],
    /// Angular velocity (rad/s).
    pub angular_velocity: Vector3,
    /// 3 x 3 by rows (rad^2/s^2).
    pub angular_velocity_covariance: [[f64; 3]; 3],
    /// Specific force (m/s^2).
    pub linear_acceleration: Vector3,
    /// 3 x 3 by rows (m^2/s^4).
    pub linear_acceleration_covariance: [[f64; 3]; 3],
}

impl Message for Imu {
    const TYPE: &'static str = "sensor_msgs/msg/Imu";
}

/// The state of joints, here wheels. Each array is empty or as long as name.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointState {
    /// Time of measurement.
    pub header: Header,
    /// Names of the joints.
    pub name: Vec<String>,
    /// Angles (rad).
    pub position: Vec<f64>,
    /// Rates (rad/s).
    pub velocity: Vec<f64>,
    /// Torques (N m).
    pub effort: Vec<f64>,
}

impl Message for JointState {
    const TYPE: &'static str = "sensor_msgs/msg/JointState";
}
