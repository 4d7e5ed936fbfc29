//! Telemetry to ROS messages: the inverse of [`crate::decode`].

use gripsight_msgs::standard::ackermann_msgs::{AckermannDrive, AckermannDriveStamped};
use gripsight_msgs::standard::builtin_interfaces::Time;
use gripsight_msgs::standard::geometry_msgs::{Point, Quaternion, Vector3};
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::sensor_msgs::{CompressedImage, Imu, JointState};
use gripsight_msgs::standard::std_msgs::Header;
use gripsight_signals::{DriveSample, ImuSample, OdometrySample, WheelsSample};

/// The names that [`wheels`] gives the joints, in the order of [`gripsight_signals::WHEELS`].
pub const WHEEL_JOINTS: [&str; 4] = ["wheel_fl", "wheel_fr", "wheel_rl", "wheel_rr"];

const NS_PER_S: i64 = 1_000_000_000;
const STANDARD_GRAVITY_MPS2: f64 = 9.806_65;

/// A ROS stamp; a time beyond its range (the year 2038) becomes its end.
#[must_use]
pub fn time(stamp_ns: i64) -> Time {
    let sec = stamp_ns.div_euclid(NS_PER_S).clamp(i32::MIN.into(), i32::MAX.into()) as i32;
    Time { sec, nanosec: stamp_ns.rem_euclid(NS_PER_S) as u32 }
}

/// A turn about the upward axis.
#[must_use]
pub fn quaternion(yaw_rad: f64) -> Quaternion {
    let (z, w) = (yaw_rad / 2.0).sin_cos();
    Quaternion { x: 0.0, y: 0.0, z, w }
}

fn header(stamp_ns: i64, frame_id: &str) -> Header {
    Header { stamp: time(stamp_ns), frame_id: frame_id.to_owned() }
}

/// Odometry with its pose in `map` and its twist in `base_link`; covariances zero (unknown).
#[must_use]
pub fn odometry(sample: &OdometrySample) -> Odometry {
    let mut message = Odometry { header: header(sample.stamp_ns, "map"), ..Odometry::default() };
    message.child_frame_id = "base_link".to_owned();
    message.pose.pose.position = Point { x: sample.x_m, y: sample.y_m, z: 0.0 };
    message.pose.pose.orientation = quaternion(sample.yaw_rad);
    message.twist.twist.linear = Vector3 { x: sample.v_x_mps, y: sample.v_y_mps, z: 0.0 };
    message.twist.twist.angular = Vector3 { x: 0.0, y: 0.0, z: sample.yaw_rate_radps };
    message
}

/// A drive command.
#[must_use]
pub fn drive(sample: &DriveSample) -> AckermannDriveStamped {
    AckermannDriveStamped {
        header: header(sample.stamp_ns, "base_link"),
        drive: AckermannDrive {
            steering_angle: sample.steering_angle_rad as f32,
            speed: sample.speed_mps as f32,
            acceleration: sample.acceleration_mps2 as f32,
            ..AckermannDrive::default()
        },
    }
}

/// An inertial reading on a level road, gravity alone upward, without orientation (covariance -1: not measured).
#[must_use]
pub fn imu(sample: &ImuSample) -> Imu {
    let mut message = Imu { header: header(sample.stamp_ns, "base_link"), ..Imu::default() };
    message.orientation.w = 1.0;
    message.orientation_covariance[0][0] = -1.0;
    message.angular_velocity.z = sample.yaw_rate_radps;
    message.linear_acceleration.x = sample.a_x_mps2;
    message.linear_acceleration.y = sample.a_y_mps2;
    message.linear_acceleration.z = STANDARD_GRAVITY_MPS2;
    message
}

/// Wheel speeds, and torques where known.
#[must_use]
pub fn wheels(sample: &WheelsSample) -> JointState {
    JointState {
        header: header(sample.stamp_ns, "base_link"),
        name: WHEEL_JOINTS.map(str::to_owned).to_vec(),
        position: Vec::new(),
        velocity: sample.speed.to_vec(),
        effort: sample.effort_nm.map(|e| e.to_vec()).unwrap_or_default(),
    }
}

/// A picture that is a JPEG file already.
#[must_use]
pub fn jpeg(stamp_ns: i64, file: Vec<u8>) -> CompressedImage {
    CompressedImage { header: header(stamp_ns, "camera"), format: "jpeg".to_owned(), data: file }
}
