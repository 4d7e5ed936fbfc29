//! The Foxglove and PlotJuggler layouts name topics and fields that the suite has.

use std::collections::BTreeSet;

use gripsight_msgs::definition;
use gripsight_msgs::idl::{self, Base};

/// The topics that a layout may draw, under the names the suite uses by default.
const TOPICS: &[(&str, &str)] = &[
    ("/odom", "nav_msgs/msg/Odometry"),
    ("/drive", "ackermann_msgs/msg/AckermannDriveStamped"),
    ("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray"),
    ("/telemetry/excitation", "gripsight_msgs/msg/Excitation"),
    ("/s4_residual/residual", "gripsight_msgs/msg/Residual"),
    ("/identifier/candidate", "gripsight_msgs/msg/PacejkaParams"),
    ("/identifier/pacejka", "gripsight_msgs/msg/PacejkaParams"),
    ("/identifier/progress", "gripsight_msgs/msg/IdentificationProgress"),
    ("/camera_prior/friction", "gripsight_msgs/msg/FrictionPrior"),
    ("/gap_diagnosis/report", "gripsight_msgs/msg/GapReport"),
];

/// The strings between double quotes that begin like a topic.
fn topic_paths(text: &str) -> BTreeSet<String> {
    text.split('"').skip(1).step_by(2).filter(|s| s.starts_with('/')).map(|s| s.replace('.', "/")).collect()
}

/// Follows `fields` from the message `type_name`; what is wrong with them, if anything.
fn follow(type_name: &str, fields: &[&str]) -> Result<(), String> {
    let Some((first, rest)) = fields.split_first() else { return Ok(()) };
    let text = definition(type_name).ok_or(format!("no definition of {type_name}"))?;
    let known = idl::parse(type_name, text).map_err(|error| error.to_string())?;
    let field = known.iter().find(|field| field.name == *first);
    match &field.ok_or(format!("{type_name} has no field {first}"))?.base {
        Base::Message(inner) => follow(inner, rest),
        _ if rest.is_empty() => Ok(()),
        _ => Err(format!("{type_name}: {first} is a plain field")),
    }
}

fn check(text: &str) {
    let paths = topic_paths(text);
    assert!(paths.len() > 10, "only {} paths found: is this a layout?", paths.len());
    for path in paths {
        let (topic, type_name) = TOPICS
            .iter()
            .filter(|(topic, _)| path == *topic || path.starts_with(&format!("{topic}/")))
            .max_by_key(|(topic, _)| topic.len())
            .unwrap_or_else(|| panic!("{path}: no such topic"));
        let fields: Vec<_> = path[topic.len()..].split('/').filter(|field| !field.is_empty()).collect();
        follow(type_name, &fields).unwrap_or_else(|error| panic!("{path}: {error}"));
    }
}

#[test]
fn the_foxglove_layout_names_what_there_is() {
    check(include_str!("../../launch_scripts/layouts/foxglove.json"));
}

#[test]
fn the_plotjuggler_layout_names_what_there_is() {
    check(include_str!("../../launch_scripts/layouts/plotjuggler.xml"));
}
