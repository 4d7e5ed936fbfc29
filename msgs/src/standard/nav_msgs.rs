//! Messages of the package `nav_msgs`.

use serde::{Deserialize, Serialize};

use super::geometry_msgs::PoseWithCovariance;
use super::geometry_msgs::TwistWithCovariance;
use super::std_msgs::Header;
use crate::Message;

/// Where the car is and how it moves.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Odometry {
    /// Time of measurement; frame of the pose.
    pub header: Header,
    /// Frame of the twist: the body.
    pub child_frame_id: String,
    /// Pose in header.frame_id.
    pub pose: PoseWithCovariance,
    /// Velocity in child_frame_id.
    pub twist: TwistWithCovariance,
}

impl Message for Odometry {
    const TYPE: &'static str = "nav_msgs/msg/Odometry";
}
