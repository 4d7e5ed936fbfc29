//! The environment variables of ROS 2 that decide whom a node can hear.
//!
//! Not implemented, and warned about: `ROS_STATIC_PEERS`, `ROS_DISCOVERY_SERVER`, the range
//! `OFF`, which here still finds nodes on the same machine, an `RMW_IMPLEMENTATION` that is not known, and security where the strategy
//! permits nodes without it. Where the strategy enforces it no node starts: this one could only run open.
//! Source: <https://docs.ros.org/en/jazzy/Tutorials/Advanced/Improved-Dynamic-Discovery.html>

use ros2_client::ServiceMapping;

use crate::Error;

/// What the environment says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Environment {
    /// DDS domain, `ROS_DOMAIN_ID`.
    pub(crate) domain_id: u16,
    /// True when only this machine is to be heard.
    pub(crate) localhost_only: bool,
    /// How services are mapped to DDS: as `RMW_IMPLEMENTATION` does; where it is not set, or not known, in both ways, each for the
    /// peers that speak it.
    pub(crate) service_mappings: Vec<ServiceMapping>,
}

impl Environment {
    /// Reads the environment through `get`, which gives a variable's value.
    ///
    /// # Errors
    /// [`Error::Environment`] for a value that ROS 2 does not allow, [`Error::Security`] where security is enforced.
    pub(crate) fn read(get: impl Fn(&str) -> Option<String>) -> Result<Self, Error> {
        let get = |name: &str| get(name).filter(|value| !value.is_empty());
        if security(get) == Some(Security::Enforced) {
            return Err(Error::Security);
        }
        let domain_id = match get("ROS_DOMAIN_ID") {
            None => 0,
            Some(value) => value.parse().ok().filter(|id| *id <= 232).ok_or(Error::Environment {
                name: "ROS_DOMAIN_ID",
                value,
                expected: "a number from 0 to 232",
            })?,
        };
        let localhost_only = match get("ROS_LOCALHOST_ONLY").as_deref() {
            Some("1") => true,
            _ => match get("ROS_AUTOMATIC_DISCOVERY_RANGE") {
                None => false,
                Some(value) => match value.to_ascii_uppercase().as_str() {
                    "LOCALHOST" | "OFF" => true,
                    "SUBNET" | "SYSTEM_DEFAULT" => false,
                    _ => {
                        let expected = "SUBNET, LOCALHOST, OFF or SYSTEM_DEFAULT";
                        return Err(Error::Environment {
                            name: "ROS_AUTOMATIC_DISCOVERY_RANGE",
                            value,
                            expected,
                        });
                    }
                },
            },
        };
        let service_mappings = match get("RMW_IMPLEMENTATION").as_deref() {
            Some("rmw_cyclonedds_cpp") => vec![ServiceMapping::Cyclone],
            Some(name) if KNOWN_MIDDLEWARE.contains(&name) => vec![ServiceMapping::Enhanced],
            _ => vec![ServiceMapping::Enhanced, ServiceMapping::Cyclone],
        };
        Ok(Self { domain_id, localhost_only, service_mappings })
    }
}

/// What the environment asks of a node that cannot secure its topics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Security {
    /// A node that cannot may run open.
    Permitted,
    /// It must not run.
    Enforced,
}

/// `None` where security is not asked for. The spelling of values is taken loosely: better refuse than run open.
/// Source: <https://docs.ros.org/en/jazzy/Tutorials/Advanced/Security/Introducing-ros2-security.html>
fn security(get: impl Fn(&str) -> Option<String>) -> Option<Security> {
    let is =
        |name: &str, value: &str| get(name).is_some_and(|given| given.trim().eq_ignore_ascii_case(value));
    let is_enabled = is("ROS_SECURITY_ENABLE", "true");
    let is_enforced = is("ROS_SECURITY_STRATEGY", "enforce");
    is_enabled.then_some(if is_enforced { Security::Enforced } else { Security::Permitted })
}

/// How a middleware speaks, where it is known: it maps services as Fast DDS does, or is CycloneDDS.
const KNOWN_MIDDLEWARE: [&str; 4] =
    ["rmw_cyclonedds_cpp", "rmw_fastrtps_cpp", "rmw_fastrtps_dynamic_cpp", "rmw_connextdds"];

/// Variables that are set but have no effect here, with the reason.
pub(crate) fn ignored(get: impl Fn(&str) -> Option<String>) -> Vec<String> {
    let mut reasons = Vec::new();
    if security(&get) == Some(Security::Permitted) {
        let reason = "ROS_SECURITY_ENABLE=true: this node cannot secure its topics and runs open, as ROS_SECURITY_STRATEGY permits: \
                      whoever reaches the domain can read and write them";
        reasons.push(reason.to_owned());
    }
    if let Some(name) = get("RMW_IMPLEMENTATION").filter(|name| !name.is_empty())
        && !KNOWN_MIDDLEWARE.contains(&name.as_str())
    {
        reasons.push(if name.starts_with("rmw_zenoh") {
            format!("RMW_IMPLEMENTATION={name}: this node speaks DDS, and nodes on Zenoh do not hear it")
        } else {
            format!(
                "RMW_IMPLEMENTATION={name} is not known: parameters are answered as CycloneDDS and Fast DDS ask"
            )
        });
    }
    let is_set = |name: &str| get(name).is_some_and(|value| !value.is_empty());
    let mut ignored = |reason: &str| reasons.push(reason.to_owned());
    if is_set("ROS_STATIC_PEERS") {
        ignored("ROS_STATIC_PEERS is not supported: peers are found by multicast and on this machine");
    }
    if is_set("ROS_DISCOVERY_SERVER") {
        ignored("ROS_DISCOVERY_SERVER is not supported: peers are found by multicast");
    }
    if get("ROS_AUTOMATIC_DISCOVERY_RANGE").is_some_and(|value| value.eq_ignore_ascii_case("off")) {
        ignored("ROS_AUTOMATIC_DISCOVERY_RANGE=OFF still finds the nodes on this machine");
    }
    reasons
}

#[cfg(test)]
mod tests {
    use super::*;

    fn from(variables: &[(&str, &str)]) -> impl Fn(&str) -> Option<String> {
        |name| variables.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
    }

    fn read(variables: &[(&str, &str)]) -> Result<Environment, Error> {
        Environment::read(from(variables))
    }

    #[test]
    fn security_is_refused_where_it_is_enforced_and_warned_of_where_it_is_asked_for() {
        let asked = ("ROS_SECURITY_ENABLE", "true");
        let enforced = read(&[asked, ("ROS_SECURITY_STRATEGY", "Enforce")]);
        assert!(matches!(enforced, Err(Error::Security)));
        let warned = |variables: &[(&str, &str)]| ignored(from(variables)).join("; ");
        for permitted in [&[asked][..], &[asked, ("ROS_SECURITY_STRATEGY", "Permissive")]] {
            assert!(read(permitted).is_ok());
            assert!(warned(permitted).contains("runs open"));
        }
        assert!(read(&[("ROS_SECURITY_STRATEGY", "Enforce")]).is_ok());
        assert_eq!(warned(&[("ROS_SECURITY_ENABLE", "false")]), "");
    }

    #[test]
    fn middleware_that_is_not_known_is_told() {
        let warned = |name: &str| ignored(from(&[("RMW_IMPLEMENTATION", name)])).join("; ");
        assert_eq!((warned(""), warned("rmw_fastrtps_cpp")), (String::new(), String::new()));
        assert!(warned("rmw_other").contains("not known"));
        assert!(warned("rmw_zenoh_cpp").contains("Zenoh"));
    }

    #[test]
    fn defaults_and_values() {
        let plain = read(&[]).unwrap();
        assert_eq!((plain.domain_id, plain.localhost_only), (0, false));
        assert_eq!(plain.service_mappings.len(), 2);
        let set = read(&[
            ("ROS_DOMAIN_ID", "42"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"),
            ("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp"),
        ])
        .unwrap();
        assert_eq!((set.domain_id, set.localhost_only), (42, true));
        assert_eq!(set.service_mappings, [ServiceMapping::Cyclone]);
        assert!(read(&[("ROS_LOCALHOST_ONLY", "1")]).unwrap().localhost_only);
    }

    #[test]
    fn wrong_values_are_refused() {
        for (name, value) in
            [("ROS_DOMAIN_ID", "233"), ("ROS_DOMAIN_ID", "x"), ("ROS_AUTOMATIC_DISCOVERY_RANGE", "CAMPUS")]
        {
            assert!(matches!(read(&[(name, value)]), Err(Error::Environment { .. })), "{name}={value}");
        }
    }
}
