//! The environment variables of ROS 2 that decide whom a node can hear.
//!
//! Not implemented, and warned about: `ROS_STATIC_PEERS`, `ROS_DISCOVERY_SERVER`, and the range
//! `OFF`, which here still finds nodes on the same machine.
//! Source: <https://docs.ros.org/en/jazzy/Tutorials/Advanced/Improved-Dynamic-Discovery.html>

use ros2_client::ServiceMapping;

use crate::Error;

/// What the environment says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Environment {
    /// DDS domain, `ROS_DOMAIN_ID`.
    pub(crate) domain_id: u16,
    /// True when only this machine is to be heard.
    pub(crate) localhost_only: bool,
    /// How the other side's `RMW_IMPLEMENTATION` maps services to DDS.
    pub(crate) service_mapping: ServiceMapping,
}

impl Environment {
    /// Reads the environment through `get`, which gives a variable's value.
    ///
    /// # Errors
    /// [`Error::Environment`] for a value that ROS 2 does not allow.
    pub(crate) fn read(get: impl Fn(&str) -> Option<String>) -> Result<Self, Error> {
        let get = |name: &str| get(name).filter(|value| !value.is_empty());
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
        let service_mapping = match get("RMW_IMPLEMENTATION").as_deref() {
            Some("rmw_cyclonedds_cpp") => ServiceMapping::Cyclone,
            _ => ServiceMapping::Enhanced,
        };
        Ok(Self { domain_id, localhost_only, service_mapping })
    }
}

/// Variables that are set but have no effect here, with the reason.
pub(crate) fn ignored(get: impl Fn(&str) -> Option<String>) -> Vec<&'static str> {
    let mut reasons = Vec::new();
    let is_set = |name: &str| get(name).is_some_and(|value| !value.is_empty());
    if is_set("ROS_STATIC_PEERS") {
        reasons.push("ROS_STATIC_PEERS is not supported: peers are found by multicast and on this machine");
    }
    if is_set("ROS_DISCOVERY_SERVER") {
        reasons.push("ROS_DISCOVERY_SERVER is not supported: peers are found by multicast");
    }
    if get("ROS_AUTOMATIC_DISCOVERY_RANGE").is_some_and(|value| value.eq_ignore_ascii_case("off")) {
        reasons.push("ROS_AUTOMATIC_DISCOVERY_RANGE=OFF still finds the nodes on this machine");
    }
    reasons
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(variables: &[(&str, &str)]) -> Result<Environment, Error> {
        Environment::read(|name| {
            variables.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
        })
    }

    #[test]
    fn defaults_and_values() {
        let plain = read(&[]).unwrap();
        assert_eq!((plain.domain_id, plain.localhost_only), (0, false));
        assert_eq!(plain.service_mapping, ServiceMapping::Enhanced);
        let set = read(&[
            ("ROS_DOMAIN_ID", "42"),
            ("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"),
            ("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp"),
        ])
        .unwrap();
        assert_eq!((set.domain_id, set.localhost_only), (42, true));
        assert_eq!(set.service_mapping, ServiceMapping::Cyclone);
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
