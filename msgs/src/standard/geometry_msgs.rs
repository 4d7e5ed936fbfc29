//! Messages of the package `geometry_msgs`.

use serde::{Deserialize, Serialize};

use crate::Message;

/// A position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// First coordinate (m).
    pub x: f64,
    /// Second coordinate (m).
    pub y: f64,
    /// Third coordinate (m).
    pub z: f64,
}

impl Message for Point {
    const TYPE: &'static str = "geometry_msgs/msg/Point";
}

/// A position and an orientation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Position.
    pub position: Point,
    /// Orientation.
    pub orientation: Quaternion,
}

impl Message for Pose {
    const TYPE: &'static str = "geometry_msgs/msg/Pose";
}

/// A pose and how certain it is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    /// The pose.
    pub pose: Pose,
    /// 6 x 6 by rows: x, y, z, turns about x, y, z (m^2, rad^2).
    pub covariance: [[f64; 6]; 6],
}

impl Message for PoseWithCovariance {
    const TYPE: &'static str = "geometry_msgs/msg/PoseWithCovariance";
}

/// A rotation as a unit quaternion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    /// First imaginary part.
    pub x: f64,
    /// Second imaginary part.
    pub y: f64,
    /// Third imaginary part.
    pub z: f64,
    /// Real part.
    pub w: f64,
}

impl Default for Quaternion {
    /// No rotation.
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
    }
}

impl Message for Quaternion {
    const TYPE: &'static str = "geometry_msgs/msg/Quaternion";
}

/// A linear and an angular velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Linear velocity (m/s).
    pub linear: Vector3,
    /// Angular velocity (rad/s).
    pub angular: Vector3,
}

impl Message for Twist {
    const TYPE: &'static str = "geometry_msgs/msg/Twist";
}

/// A twist and how certain it is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TwistWithCovariance {
    /// The twist.
    pub twist: Twist,
    /// 6 x 6 by rows: x, y, z, turns about x, y, z (m^2/s^2, rad^2/s^2).
    pub covariance: [[f64; 6]; 6],
}

impl Message for TwistWithCovariance {
    const TYPE: &'static str = "geometry_msgs/msg/TwistWithCovariance";
}

/// A direction and size; the unit is that of the field that holds it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    /// First component.
    pub x: f64,
    /// Second component.
    pub y: f64,
    /// Third component.
    pub z: f64,
}

impl Message for Vector3 {
    const TYPE: &'static str = "geometry_msgs/msg/Vector3";
}
