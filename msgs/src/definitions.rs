//! The text of every `.msg` file, built into the crate.

macro_rules! definitions {
    ($($directory:literal: $package:literal { $($name:literal)* })*) => {
        &[$($((
            concat!($package, "/msg/", $name),
            include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/", $directory, "/", $name, ".msg")),
        ),)*)*]
    };
}

/// Full name and text of every message type.
const DEFINITIONS: &[(&str, &str)] = definitions! {
    "msg": "gripsight_msgs" {
        "DriveNext"
        "Excitation"
        "ExtendedModel"
        "FrictionPrior"
        "GapChange"
        "GapEffect"
        "GapParameter"
        "GapRegion"
        "GapReport"
        "Grip"
        "Handshake"
        "IdentificationProgress"
        "Interval"
        "Longitudinal"
        "LongitudinalLimit"
        "MagicFormula"
        "PacejkaParams"
        "PeakFriction"
        "Range"
        "Residual"
        "ResidualModel"
        "SignalCorrections"
        "StateSequence"
        "TirePosterior"
    }
    "standard/ackermann_msgs": "ackermann_msgs" { "AckermannDrive" "AckermannDriveStamped" }
    "standard/builtin_interfaces": "builtin_interfaces" { "Duration" "Time" }
    "standard/diagnostic_msgs": "diagnostic_msgs" { "DiagnosticArray" "DiagnosticStatus" "KeyValue" }
    "standard/geometry_msgs": "geometry_msgs" { "Point" "Pose" "PoseWithCovariance" "Quaternion" "Twist" "TwistWithCovariance" "Vector3" }
    "standard/nav_msgs": "nav_msgs" { "Odometry" }
    "standard/rcl_interfaces": "rcl_interfaces" { "FloatingPointRange" "IntegerRange" "ListParametersResult" "Log" "Parameter" "ParameterDescriptor" "ParameterEvent" "ParameterValue" "SetParametersResult" }
    "standard/rosgraph_msgs": "rosgraph_msgs" { "Clock" }
    "standard/sensor_msgs": "sensor_msgs" { "CompressedImage" "Image" "Imu" "JointState" }
    "standard/std_msgs": "std_msgs" { "Header" }
};

/// The text of the `.msg` file of a type, or `None` for a type that is not known here.
/// `type_name` is the full name, such as `gripsight_msgs/msg/PacejkaParams`.
pub fn definition(type_name: &str) -> Option<&'static str> {
    DEFINITIONS.iter().find(|(name, _)| *name == type_name).map(|(_, text)| *text)
}

/// Full names of all message types known here.
pub fn type_names() -> impl Iterator<Item = &'static str> {
    DEFINITIONS.iter().map(|(name, _)| *name)
}
