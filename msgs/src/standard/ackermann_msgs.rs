//! Messages of the package `ackermann_msgs`.

use serde::{Deserialize, Serialize};

use super::std_msgs::Header;
use crate::Message;

/// A command to a car with a steered front axle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AckermannDrive {
    /// Angle of the virtual front wheel, left positive (rad).
    pub steering_angle: f32,
    /// Rate of that angle; 0: as fast as possible (rad/s).
    pub steering_angle_velocity: f32,
    /// Forward speed (m/s).
    pub speed: f32,
    /// Forward acceleration (m/s^2).
    pub acceleration: f32,
    /// Forward jerk (m/s^3).
    pub jerk: f32,
}

impl Message for AckermannDrive {
    const TYPE: &'static str = "ackermann_msgs/msg/AckermannDrive";
}

/// A stamped command to a car with a steered front axle.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AckermannDriveStamped {
    /// Time of the command.
    pub header: Header,
    /// The command.
    pub drive: AckermannDrive,
}

impl Message for AckermannDriveStamped {
    const TYPE: &'static str = "ackermann_msgs/msg/AckermannDriveStamped";
}
