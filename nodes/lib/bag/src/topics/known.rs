//! Message types whose fields are known: what a topic's name alone maps, and what is proposed first.

use gripsight_signals::Signal;

/// What a topic is good for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Group {
    /// Speeds and yaw rate in the car's frame.
    Motion,
    /// What was commanded.
    Command,
    /// A steering sensor.
    Steering,
    /// Inertial unit.
    Imu,
    /// Wheel speeds.
    Wheels,
    /// Position and heading.
    Pose,
}

/// A message type and where its signals stand.
pub(crate) struct KnownType {
    pub(crate) name: &'static str,
    pub(crate) group: Group,
    pub(crate) fields: &'static [(Signal, &'static str)],
}

use Signal::{
    AccelerationCommand, ForwardAcceleration, ForwardSpeed, Gyro, Heading, LateralAcceleration, LateralSpeed,
    MeasuredSteering, SpeedCommand, Steering, X, Y, YawRate,
};

const TWIST: &[(Signal, &str)] =
    &[(ForwardSpeed, "twist.linear.x"), (LateralSpeed, "twist.linear.y"), (YawRate, "twist.angular.z")];
const TWIST_IN_TWIST: &[(Signal, &str)] = &[
    (ForwardSpeed, "twist.twist.linear.x"),
    (LateralSpeed, "twist.twist.linear.y"),
    (YawRate, "twist.twist.angular.z"),
];
const POSE: &[(Signal, &str)] =
    &[(X, "pose.position.x"), (Y, "pose.position.y"), (Heading, "pose.orientation")];
const POSE_IN_POSE: &[(Signal, &str)] =
    &[(X, "pose.pose.position.x"), (Y, "pose.pose.position.y"), (Heading, "pose.pose.orientation")];

/// Fields as the packages' `.msg` files have them; the best of each group first.
pub(crate) const KNOWN_TYPES: &[KnownType] = &[
    KnownType { name: "nav_msgs/msg/Odometry", group: Group::Motion, fields: TWIST_IN_TWIST },
    KnownType {
        name: "autoware_vehicle_msgs/msg/VelocityReport",
        group: Group::Motion,
        fields: &[
            (ForwardSpeed, "longitudinal_velocity"),
            (LateralSpeed, "lateral_velocity"),
            (YawRate, "heading_rate"),
        ],
    },
    KnownType {
        name: "autoware_auto_vehicle_msgs/msg/VelocityReport",
        group: Group::Motion,
        fields: &[
            (ForwardSpeed, "longitudinal_velocity"),
            (LateralSpeed, "lateral_velocity"),
            (YawRate, "heading_rate"),
        ],
    },
    KnownType {
        name: "geometry_msgs/msg/TwistWithCovarianceStamped",
        group: Group::Motion,
        fields: TWIST_IN_TWIST,
    },
    KnownType { name: "geometry_msgs/msg/TwistStamped", group: Group::Motion, fields: TWIST },
    KnownType {
        name: "ackermann_msgs/msg/AckermannDriveStamped",
        group: Group::Command,
        fields: &[
            (Steering, "drive.steering_angle"),
            (SpeedCommand, "drive.speed"),
            (AccelerationCommand, "drive.acceleration"),
        ],
    },
    KnownType {
        name: "ackermann_msgs/msg/AckermannDrive",
        group: Group::Command,
        fields: &[
            (Steering, "steering_angle"),
            (SpeedCommand, "speed"),
            (AccelerationCommand, "acceleration"),
        ],
    },
    KnownType {
        name: "autoware_control_msgs/msg/Control",
        group: Group::Command,
        fields: &[
            (Steering, "lateral.steering_tire_angle"),
            (SpeedCommand, "longitudinal.velocity"),
            (AccelerationCommand, "longitudinal.acceleration"),
        ],
    },
    KnownType {
        name: "autoware_auto_control_msgs/msg/AckermannControlCommand",
        group: Group::Command,
        fields: &[
            (Steering, "lateral.steering_tire_angle"),
            (SpeedCommand, "longitudinal.speed"),
            (AccelerationCommand, "longitudinal.acceleration"),
        ],
    },
    KnownType {
        name: "autoware_vehicle_msgs/msg/SteeringReport",
        group: Group::Steering,
        fields: &[(MeasuredSteering, "steering_tire_angle")],
    },
    KnownType {
        name: "autoware_auto_vehicle_msgs/msg/SteeringReport",
        group: Group::Steering,
        fields: &[(MeasuredSteering, "steering_tire_angle")],
    },
    KnownType {
        name: "sensor_msgs/msg/Imu",
        group: Group::Imu,
        fields: &[
            (ForwardAcceleration, "linear_acceleration.x"),
            (LateralAcceleration, "linear_acceleration.y"),
            (Gyro, "angular_velocity.z"),
        ],
    },
    KnownType {
        name: "geometry_msgs/msg/PoseWithCovarianceStamped",
        group: Group::Pose,
        fields: POSE_IN_POSE,
    },
    KnownType { name: "geometry_msgs/msg/PoseStamped", group: Group::Pose, fields: POSE },
    KnownType { name: "nav_msgs/msg/Odometry", group: Group::Pose, fields: POSE_IN_POSE },
];

/// Where a known type holds a signal.
pub(crate) fn field_of(type_name: &str, signal: Signal) -> Option<&'static str> {
    KNOWN_TYPES
        .iter()
        .filter(|known| known.name == type_name)
        .find_map(|known| known.fields.iter().find(|(s, _)| *s == signal))
        .map(|&(_, field)| field)
}

/// The signals that a known type holds for a group.
pub(crate) fn fields_of(type_name: &str, group: Group) -> &'static [(Signal, &'static str)] {
    KNOWN_TYPES
        .iter()
        .find(|known| known.name == type_name && known.group == group)
        .map_or(&[], |known| known.fields)
}
