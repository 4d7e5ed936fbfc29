//! The structs and the `.msg` files say the same: names, types and order of all fields.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop")]

use std::collections::BTreeSet;

use gripsight_msgs::idl::{self, Base, Multiplicity};
use gripsight_msgs::standard::{
    ackermann_msgs, builtin_interfaces, diagnostic_msgs, nav_msgs, rcl_interfaces, rosgraph_msgs, sensor_msgs,
};
use gripsight_msgs::{
    Excitation, ExtendedModel, FrictionPrior, GapReport, Grip, IdentificationProgress, Message,
    PacejkaParams, Residual, ResidualModel, StateSequence, TirePosterior, definition, schema, type_names,
};
use serde_reflection::{ContainerFormat, Format, Named, Registry, Tracer, TracerConfig};

/// The structs as serde sees them. Those nested in others come along.
fn registry() -> Registry {
    let mut tracer = Tracer::new(TracerConfig::default());
    macro_rules! trace {
        ($($message:ty),* $(,)?) => { $(tracer.trace_simple_type::<$message>().unwrap();)* };
    }
    trace!(
        Excitation,
        ExtendedModel,
        FrictionPrior,
        GapReport,
        Grip,
        IdentificationProgress,
        PacejkaParams,
        Residual,
        ResidualModel,
        StateSequence,
        TirePosterior,
        ackermann_msgs::AckermannDriveStamped,
        builtin_interfaces::Duration,
        diagnostic_msgs::DiagnosticArray,
        nav_msgs::Odometry,
        rcl_interfaces::ListParametersResult,
        rcl_interfaces::Log,
        rcl_interfaces::ParameterDescriptor,
        rcl_interfaces::ParameterEvent,
        rcl_interfaces::SetParametersResult,
        rosgraph_msgs::Clock,
        sensor_msgs::CompressedImage,
        sensor_msgs::Image,
        sensor_msgs::Imu,
        sensor_msgs::JointState,
    );
    tracer.registry().unwrap()
}

/// What serde should see of a field of a `.msg` file. A square matrix is written as rows in a row.
fn format(field: &idl::Field) -> Format {
    let element = match &field.base {
        Base::Primitive(name) => match *name {
            "bool" => Format::Bool,
            "byte" | "uint8" => Format::U8,
            "int8" => Format::I8,
            "uint16" => Format::U16,
            "int16" => Format::I16,
            "uint32" => Format::U32,
            "int32" => Format::I32,
            "uint64" => Format::U64,
            "int64" => Format::I64,
            "float32" => Format::F32,
            "float64" => Format::F64,
            _ => Format::Str,
        },
        Base::BoundedString(_) => Format::Str,
        Base::Message(name) => Format::TypeName(name.rsplit('/').next().unwrap().into()),
    };
    let array = |content: Format, size: usize| Format::TupleArray { content: Box::new(content), size };
    match field.multiplicity {
        Multiplicity::One => element,
        Multiplicity::Array(36) => array(array(element, 6), 6),
        Multiplicity::Array(9) => array(array(element, 3), 3),
        Multiplicity::Array(count) => array(element, usize::try_from(count).unwrap()),
        Multiplicity::Bounded(_) | Multiplicity::Sequence if element == Format::U8 => Format::Bytes,
        Multiplicity::Bounded(_) | Multiplicity::Sequence => Format::Seq(Box::new(element)),
    }
}

#[test]
fn structs_and_files_agree() {
    let registry = registry();
    let short_names: BTreeSet<&str> = type_names().map(|name| name.rsplit('/').next().unwrap()).collect();
    assert_eq!(short_names.len(), type_names().count(), "two types of one name cannot be told apart here");
    assert_eq!(registry.keys().map(String::as_str).collect::<BTreeSet<_>>(), short_names);
    for type_name in type_names() {
        let fields = idl::parse(type_name, definition(type_name).unwrap()).unwrap();
        let expected: Vec<Named<Format>> =
            fields.iter().map(|field| Named { name: field.name.clone(), value: format(field) }).collect();
        let short_name = type_name.rsplit('/').next().unwrap();
        assert_eq!(registry[short_name], ContainerFormat::Struct(expected), "{type_name}");
    }
}

#[test]
fn constants_agree() {
    fn value(type_name: &str, constant: &str) -> u8 {
        let line = definition(type_name)
            .unwrap()
            .lines()
            .find(|line| line.contains(&format!(" {constant}=")))
            .unwrap_or_else(|| panic!("{type_name} has no {constant}"));
        line.split(['=', ' ']).nth(2).unwrap().parse().unwrap()
    }
    macro_rules! check {
        ($($message:ty { $($constant:ident)* })*) => {$($(
            assert_eq!(value(<$message>::TYPE, stringify!($constant)), <$message>::$constant);
        )*)*};
    }
    check! {
        FrictionPrior { CONFIGURED CAMERA }
        PacejkaParams { PROPOSED ACCEPTED REJECTED }
        IdentificationProgress { WAITING PREPARING TRAINING SWEEPING FITTING FINISHED GIVEN_UP }
        diagnostic_msgs::DiagnosticStatus { OK WARN ERROR STALE }
        rcl_interfaces::Log { DEBUG INFO WARN ERROR FATAL }
    }
}

#[test]
fn every_field_of_the_suite_has_a_comment() {
    for type_name in type_names().filter(|name| name.starts_with("gripsight_msgs/")) {
        for line in definition(type_name).unwrap().lines().filter(|line| !line.trim().is_empty()) {
            assert!(line.contains('#'), "{type_name}: {line}");
        }
    }
}

#[test]
fn a_schema_holds_every_nested_type_once() {
    let text = schema(PacejkaParams::TYPE).unwrap();
    let separator = "=".repeat(80);
    let parts: Vec<&str> = text.split(&format!("{separator}\nMSG: ")).collect();
    assert_eq!(parts[0], definition(PacejkaParams::TYPE).unwrap());
    let nested: Vec<&str> = parts[1..].iter().map(|part| part.lines().next().unwrap()).collect();
    assert_eq!(
        nested,
        [
            "builtin_interfaces/Time",
            "gripsight_msgs/Handshake",
            "gripsight_msgs/Interval",
            "gripsight_msgs/Longitudinal",
            "gripsight_msgs/LongitudinalLimit",
            "gripsight_msgs/MagicFormula",
            "gripsight_msgs/PeakFriction",
            "gripsight_msgs/Range",
            "gripsight_msgs/SignalCorrections",
            "std_msgs/Header",
        ]
    );
}

#[test]
fn cmake_lists_every_message() {
    let cmake = include_str!("../CMakeLists.txt");
    let listed: BTreeSet<&str> =
        cmake.lines().filter_map(|line| line.trim().strip_prefix("\"msg/")).collect();
    let known: BTreeSet<String> = type_names()
        .filter_map(|name| name.strip_prefix("gripsight_msgs/msg/"))
        .map(|name| format!("{name}.msg\""))
        .collect();
    assert_eq!(listed, known.iter().map(String::as_str).collect());
}

/// The message's arrays are the one table's channels, in its order, with its units and meanings.
#[test]
fn a_sequence_carries_the_channels_of_the_table() {
    let text = definition(StateSequence::TYPE).unwrap();
    let arrays: Vec<(&str, &str)> = text
        .lines()
        .filter_map(|line| line.strip_prefix("float32[] ")?.split_once(" # "))
        .map(|(name, comment)| (name.trim(), comment))
        .collect();
    let table: Vec<(&str, String)> =
        gripsight_signals::CHANNELS.iter().map(|c| (c.name, format!("[{}] {}", c.unit, c.meaning))).collect();
    assert_eq!(arrays, table.iter().map(|(n, c)| (*n, c.as_str())).collect::<Vec<_>>());
}
