//! The text of a message type that a bag does not carry: the suite's own, those of types that stacks often record (a bag of Humble carries
//! none), or `.msg` files beside the bag, which go before both.

use std::collections::BTreeSet;
use std::path::Path;

use crate::storage::read_text;

/// The text of a type with those of the types in it, as a bag carries it; `None` where it is not found.
///
/// Looked for in the bag's folder and the one above it, as `package/msg/Type.msg`, `package/Type.msg`, `msg/Type.msg` or `Type.msg`.
pub(crate) fn find(type_name: &str, beside: &Path) -> Option<String> {
    let mut text = definition(type_name, beside)?;
    let mut known = BTreeSet::from([type_name.to_owned()]);
    let mut waiting = nested(type_name, &text);
    while let Some(name) = waiting.pop() {
        if !known.insert(name.clone()) {
            continue;
        }
        // What is not found is said by whoever reads the layout.
        let Some(inner) = definition(&name, beside) else { continue };
        waiting.extend(nested(&name, &inner));
        text.push_str(&format!("\n{}\nMSG: {}\n{inner}", "=".repeat(80), name.replacen("/msg/", "/", 1)));
    }
    Some(text)
}

fn definition(type_name: &str, beside: &Path) -> Option<String> {
    let (package, name) = (type_name.split('/').next()?, type_name.rsplit('/').next()?);
    let folder = if beside.is_dir() { Some(beside) } else { beside.parent() };
    let folders = folder.into_iter().chain(folder.and_then(Path::parent));
    let places = [
        format!("{package}/msg/{name}.msg"),
        format!("{package}/{name}.msg"),
        format!("msg/{name}.msg"),
        format!("{name}.msg"),
    ];
    folders
        .flat_map(|folder| places.iter().map(|place| folder.join(place)))
        .find_map(|path| read_text(&path).ok())
        .or_else(|| gripsight_msgs::definition(type_name).map(str::to_owned))
        .or_else(|| COMMON.iter().find(|(known, _)| *known == type_name).map(|(_, text)| (*text).to_owned()))
}

/// Fields of types that cars often record and the suite does not exchange, as ROS 2 Humble and Jazzy, the VESC driver and Autoware lay them out.
const COMMON: &[(&str, &str)] = &[
    ("std_msgs/msg/Float32", "float32 data"),
    ("std_msgs/msg/Float64", "float64 data"),
    ("std_msgs/msg/Int32", "int32 data"),
    ("geometry_msgs/msg/PoseStamped", "std_msgs/Header header\nPose pose"),
    ("geometry_msgs/msg/PoseWithCovarianceStamped", "std_msgs/Header header\nPoseWithCovariance pose"),
    ("geometry_msgs/msg/TwistStamped", "std_msgs/Header header\nTwist twist"),
    ("geometry_msgs/msg/TwistWithCovarianceStamped", "std_msgs/Header header\nTwistWithCovariance twist"),
    ("geometry_msgs/msg/Vector3Stamped", "std_msgs/Header header\nVector3 vector"),
    ("vesc_msgs/msg/VescStateStamped", "std_msgs/Header header\nVescState state"),
    (
        "vesc_msgs/msg/VescState",
        "float64 temp_fet\nfloat64 temp_motor\nfloat64 current_motor\nfloat64 current_input\nfloat64 avg_id\nfloat64 avg_iq\n\
         float64 duty_cycle\nfloat64 speed\nfloat64 voltage_input\nint32 displacement\nint32 distance_traveled\nint32 fault_code",
    ),
    (
        "autoware_vehicle_msgs/msg/VelocityReport",
        "std_msgs/Header header\nfloat32 longitudinal_velocity\nfloat32 lateral_velocity\nfloat32 heading_rate",
    ),
    (
        "autoware_auto_vehicle_msgs/msg/VelocityReport",
        "std_msgs/Header header\nfloat32 longitudinal_velocity\nfloat32 lateral_velocity\nfloat32 heading_rate",
    ),
    (
        "autoware_vehicle_msgs/msg/SteeringReport",
        "builtin_interfaces/Time stamp\nfloat32 steering_tire_angle",
    ),
    (
        "autoware_auto_vehicle_msgs/msg/SteeringReport",
        "builtin_interfaces/Time stamp\nfloat32 steering_tire_angle",
    ),
    (
        "autoware_control_msgs/msg/Control",
        "builtin_interfaces/Time stamp\nbuiltin_interfaces/Time control_time\nLateral lateral\nLongitudinal longitudinal",
    ),
    (
        "autoware_control_msgs/msg/Lateral",
        "builtin_interfaces/Time stamp\nbuiltin_interfaces/Time control_time\nfloat32 steering_tire_angle\n\
         float32 steering_tire_rotation_rate\nbool is_defined_steering_tire_rotation_rate",
    ),
    (
        "autoware_control_msgs/msg/Longitudinal",
        "builtin_interfaces/Time stamp\nbuiltin_interfaces/Time control_time\nfloat32 velocity\nfloat32 acceleration\nfloat32 jerk\n\
         bool is_defined_acceleration\nbool is_defined_jerk",
    ),
];

/// The message types that a text names, by their full names.
fn nested(type_name: &str, text: &str) -> Vec<String> {
    let package = type_name.split('/').next().unwrap_or_default();
    text.lines()
        .filter_map(|line| line.split('#').next()?.split_whitespace().next())
        .map(|kind| kind.split('[').next().unwrap_or(kind))
        .filter(|kind| {
            kind.rsplit('/').next().is_some_and(|n| n.starts_with(|c: char| c.is_ascii_uppercase()))
        })
        .map(|kind| match kind.rsplit_once('/') {
            Some((of, name)) => format!("{}/msg/{name}", of.trim_end_matches("/msg")),
            None if kind == "Header" => "std_msgs/msg/Header".to_owned(),
            None => format!("{package}/msg/{kind}"),
        })
        .collect()
}
