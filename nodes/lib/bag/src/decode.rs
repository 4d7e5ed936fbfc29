//! ROS messages to telemetry: the one conversion, used live (from structs) and offline (from CDR bytes).
//!
//! Frames are REP-103's: the twist in the car's frame (x forward, y left), the inertial unit mounted along it.

use gripsight_msgs::Message;
use gripsight_msgs::standard::ackermann_msgs::AckermannDriveStamped;
use gripsight_msgs::standard::builtin_interfaces::Time;
use gripsight_msgs::standard::geometry_msgs::Quaternion;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::sensor_msgs::{Imu, JointState};
use gripsight_signals::{DriveSample, ImuSample, Measurement, OdometrySample, WheelsSample};

use crate::{BagError, Role, from_cdr};

/// A stamp in nanoseconds since the epoch of its clock.
#[must_use]
pub fn stamp_ns(stamp: Time) -> i64 {
    i64::from(stamp.sec) * 1_000_000_000 + i64::from(stamp.nanosec)
}

/// The heading in a quaternion, in (-pi, pi]. Its length does not matter.
#[must_use]
pub fn yaw_rad(q: &Quaternion) -> f64 {
    (2.0 * (q.w * q.z + q.x * q.y)).atan2(q.w * q.w + q.x * q.x - q.y * q.y - q.z * q.z)
}

/// Pose and velocity; covariances are not used.
#[must_use]
pub fn odometry(message: &Odometry) -> OdometrySample {
    let pose = &message.pose.pose;
    let twist = &message.twist.twist;
    OdometrySample {
        stamp_ns: stamp_ns(message.header.stamp),
        x_m: pose.position.x,
        y_m: pose.position.y,
        yaw_rad: yaw_rad(&pose.orientation),
        v_x_mps: twist.linear.x,
        v_y_mps: twist.linear.y,
        yaw_rate_radps: twist.angular.z,
    }
}

/// Steering, speed and acceleration as commanded.
#[must_use]
pub fn drive(message: &AckermannDriveStamped) -> DriveSample {
    DriveSample {
        stamp_ns: stamp_ns(message.header.stamp),
        steering_angle_rad: message.drive.steering_angle.into(),
        speed_mps: message.drive.speed.into(),
        acceleration_mps2: message.drive.acceleration.into(),
    }
}

/// Acceleration and yaw rate; `None` where a covariance that begins with -1 says that one of them is not measured.
#[must_use]
pub fn imu(message: &Imu) -> Option<ImuSample> {
    let measured = |covariance: &[[f64; 3]; 3]| covariance[0][0] >= 0.0;
    (measured(&message.linear_acceleration_covariance) && measured(&message.angular_velocity_covariance))
        .then(|| ImuSample {
            stamp_ns: stamp_ns(message.header.stamp),
            a_x_mps2: message.linear_acceleration.x,
            a_y_mps2: message.linear_acceleration.y,
            yaw_rate_radps: message.angular_velocity.z,
        })
}

/// Wheel speeds, and torques where all four are there; `None` where the joints are not the four wheels.
///
/// A joint is a wheel by its name, in any case and between any separators: `fl`, `fr`, `rl`, `rr` (or `bl`, `br`) as a part of
/// its own, or `front`/`rear`/`back` with `left`/`right`: `wheel_fl`, `front_left_wheel`, `wheel_front_left_joint`. A lone
/// `wheel_speed` (one encoder on the motor) is none of the four and gives `None`.
///
/// # Errors
/// [`BagError::ArrayLength`] where speeds or torques are neither absent nor one per name.
pub fn wheels(message: &JointState) -> Result<Option<WheelsSample>, BagError> {
    let Some(places) = wheel_places(&message.name) else { return Ok(None) };
    let expected = message.name.len();
    let four = |field, values: &[f64]| {
        if values.is_empty() {
            Ok(None)
        } else if values.len() == expected {
            Ok(Some(places.map(|place| values[place])))
        } else {
            let type_name = JointState::TYPE;
            Err(BagError::ArrayLength { type_name, field, got: values.len(), expected })
        }
    };
    let effort_nm = four("effort", &message.effort)?;
    let speed = four("velocity", &message.velocity)?;
    Ok(speed.map(|speed| WheelsSample { stamp_ns: stamp_ns(message.header.stamp), speed, effort_nm }))
}

/// Where the four wheels stand among the joints, in the order of [`gripsight_signals::WHEELS`].
fn wheel_places(names: &[String]) -> Option<[usize; 4]> {
    let mut places = [None; 4];
    for (place, name) in names.iter().enumerate() {
        if let Some(wheel) = wheel_of(name) {
            places[wheel].get_or_insert(place);
        }
    }
    let [Some(fl), Some(fr), Some(rl), Some(rr)] = places else { return None };
    Some([fl, fr, rl, rr])
}

pub(crate) fn wheel_of(name: &str) -> Option<usize> {
    let name = name.to_lowercase();
    let parts: Vec<&str> = name.split(|c: char| !c.is_ascii_alphabetic()).collect();
    let short = parts.iter().find_map(|part| match *part {
        "fl" => Some(0),
        "fr" => Some(1),
        "rl" | "bl" => Some(2),
        "rr" | "br" => Some(3),
        _ => None,
    });
    let either = |a: &str, b: &str| match (name.contains(a), name.contains(b)) {
        (true, false) => Some(0),
        (false, true) => Some(1),
        _ => None,
    };
    let axle = either("front", "rear").or_else(|| name.contains("back").then_some(1));
    short.or_else(|| Some(2 * axle? + either("left", "right")?))
}

/// One message of a stream, from its CDR bytes. `None`: the message says nothing about the stream (see [`imu`], [`wheels`]).
///
/// # Errors
/// [`BagError`] where the bytes are not of the stream's type.
pub fn measurement(role: Role, cdr: &[u8]) -> Result<Option<Measurement>, BagError> {
    Ok(match role {
        Role::Odom => Some(Measurement::Odometry(odometry(&from_cdr(cdr)?))),
        Role::Drive => Some(Measurement::Drive(drive(&from_cdr(cdr)?))),
        Role::Imu => imu(&from_cdr(cdr)?).map(Measurement::Imu),
        Role::Wheels => wheels(&from_cdr(cdr)?)?.map(Measurement::Wheels),
    })
}
