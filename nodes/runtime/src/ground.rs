//! What a node stands on: its parameters' values from outside, and its endpoints in DDS.

use std::time::Duration;

use ros2_client::{Context, MessageTypeName, Name, NodeName, NodeOptions, ros2};
use rustdds::policy::{Durability, History};
use rustdds::{DomainParticipantBuilder, QosPolicies, QosPolicyBuilder};

use crate::args::Args;
use crate::environment::Environment;
use crate::error::Error;
use crate::names::Identity;
use crate::parameter_file::parameters_for;
use crate::parameters::{Given, Origin};
use crate::qos::Qos;
use crate::type_hashes::user_data;
use crate::value::ParameterValue;

/// DDS is looked after this often.
const WATCH_PERIOD: Duration = Duration::from_secs(1);

/// Resolves once DDS no longer runs. RustDDS 0.15.1 ends its threads where a system call is interrupted, which happens to a process
/// that was stopped and goes on: after Ctrl-Z and `fg`, beneath a debugger. Only a command that nobody takes any more shows it.
pub(crate) async fn stopped(participant: rustdds::DomainParticipant) {
    let mut looks = tokio::time::interval(WATCH_PERIOD);
    while !is_stopped(&participant) {
        looks.tick().await;
    }
}

/// Whether DDS no longer runs.
pub(crate) fn is_stopped(participant: &rustdds::DomainParticipant) -> bool {
    participant.assert_liveliness().is_err()
}

/// Parameters from the files, then those of the command line, which win.
pub(crate) fn overrides(args: &Args, name: &str, identity: &Identity) -> Result<Vec<Given>, Error> {
    let full_name = identity.fully_qualified();
    let mut found = Vec::new();
    for path in &args.parameter_files {
        let of_file = |reason: String| Error::ParameterFile { path: path.clone(), reason };
        let text = std::fs::read_to_string(path).map_err(|error| of_file(error.to_string()))?;
        found.extend(parameters_for(path, &text, &full_name).map_err(of_file)?);
    }
    let is_ours = |node: &str| node == name || node == identity.name || node == full_name;
    for given in args.parameters.iter().filter(|given| given.node.as_deref().is_none_or(is_ours)) {
        let value =
            ParameterValue::parse(&given.value).map_err(|reason| Error::parameter(&given.name, reason))?;
        let origin = Origin { place: "command line".to_owned(), is_own: given.node.is_some() };
        found.push(Given { name: given.name.clone(), value, origin });
    }
    Ok(found)
}

pub(crate) fn context(environment: &Environment) -> Result<Context, Error> {
    rustdds::discovery::set_endpoint_user_data(user_data);
    rustdds::dds::set_topic_qos(other_qos);
    let mut builder = DomainParticipantBuilder::new(environment.domain_id);
    if environment.localhost_only {
        builder = builder.with_only_networks([std::net::Ipv4Addr::LOCALHOST]);
    }
    let participant = builder.build().map_err(|error| Error::create("DDS participant", error))?;
    Context::from_domain_participant(participant).map_err(|error| Error::create("ROS 2 context", error))
}

/// The quality of service of what ros2-client 0.12.1 creates otherwise than ROS 2 does: it keeps one parameter event for those who join later,
/// which makes a recorder that meets it first ask for as much of nodes that have nothing to give. Source: `rmw_qos_profile_parameter_events`.
fn other_qos(dds_topic: &str) -> Option<QosPolicies> {
    (dds_topic == "rt/parameter_events").then(|| {
        QosPolicyBuilder::new()
            .durability(Durability::Volatile)
            .reliable(rustdds::Duration::ZERO)
            .history(History::KeepLast { depth: 1000 })
            .build()
    })
}

/// The ros2-client node, without the services that this crate supplies itself.
pub(crate) fn ros_node(context: &Context, identity: &Identity) -> Result<ros2_client::Node, Error> {
    let full_name = identity.fully_qualified();
    let name = NodeName::new(&identity.namespace, &identity.name)
        .map_err(|error| Error::Name { name: full_name.clone(), reason: error.to_string() })?;
    let options = NodeOptions::new()
        .enable_rosout(false)
        .start_parameter_services(false)
        .allow_undeclared_parameters(true);
    context.new_node(name, options).map_err(|error| Error::create(format!("node {full_name}"), error))
}

pub(crate) fn ros_topic(
    node: &ros2_client::Node,
    topic: &str,
    type_name: &str,
    qos: Qos,
) -> Result<rustdds::Topic, ros2::CreateError> {
    let wrong = |reason: String| ros2::CreateError::BadParameter { reason };
    let name = Name::parse(topic).map_err(|error| wrong(error.to_string()))?;
    let (package, type_name) = type_name
        .split_once("/msg/")
        .ok_or_else(|| wrong(format!("`{type_name}` is not of the form package/msg/Type")))?;
    node.create_topic(&name, MessageTypeName::new(package, type_name), &qos.profile())
}
