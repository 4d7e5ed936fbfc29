//! Names of nodes, topics and services: expansion of relative and private names, and remapping.
//!
//! Not implemented: `{node}` and `{ns}` in names, `rostopic://` and `rosservice://` prefixes.
//! Source: <https://design.ros2.org/articles/topic_and_service_names.html>

use crate::Error;
use crate::args::Remap;

/// Who a node is, after `__node` and `__ns`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Identity {
    /// Base name, such as `telemetry`.
    pub(crate) name: String,
    /// Namespace, `/` or `/a/b`.
    pub(crate) namespace: String,
    remaps: Vec<(String, String)>,
}

impl Identity {
    /// The node that its program calls `name`, under the rules of a command line.
    ///
    /// # Errors
    /// [`Error::Name`] when a name given on the command line is no ROS name.
    pub(crate) fn new(name: &str, rules: &[Remap]) -> Result<Self, Error> {
        let applies = |rule: &&Remap| rule.node.as_deref().is_none_or(|node| node == name);
        let rules: Vec<&Remap> = rules.iter().filter(applies).collect();
        let find =
            |keys: &[&str]| rules.iter().find(|rule| keys.contains(&rule.from.as_str())).map(|rule| &rule.to);
        let mut identity = Self {
            name: find(&["__node", "__name"]).map_or(name, |to| to).to_owned(),
            namespace: format!("/{}", find(&["__ns"]).map_or("", |to| to.trim_matches('/'))),
            remaps: Vec::new(),
        };
        check(&identity.fully_qualified())?;
        identity.remaps = rules
            .iter()
            .filter(|rule| !rule.from.starts_with("__"))
            .map(|rule| Ok((identity.expand(&rule.from)?, identity.expand(&rule.to)?)))
            .collect::<Result<_, Error>>()?;
        Ok(identity)
    }

    /// Namespace and name, such as `/car/telemetry`.
    pub(crate) fn fully_qualified(&self) -> String {
        format!("{}/{}", self.namespace.trim_end_matches('/'), self.name)
    }

    /// The absolute name of a topic or service that the node calls `name`, remapped.
    ///
    /// # Errors
    /// [`Error::Name`] when it is no ROS name.
    pub(crate) fn resolve(&self, name: &str) -> Result<String, Error> {
        let expanded = self.expand(name)?;
        let rule = self.remaps.iter().find(|(from, _)| *from == expanded);
        Ok(rule.map_or(expanded, |(_, to)| to.clone()))
    }

    fn expand(&self, name: &str) -> Result<String, Error> {
        let expanded = if name.starts_with('/') {
            name.to_owned()
        } else if let Some(rest) = name.strip_prefix("~/") {
            format!("{}/{rest}", self.fully_qualified())
        } else {
            format!("{}/{name}", self.namespace.trim_end_matches('/'))
        };
        check(&expanded)?;
        Ok(expanded)
    }
}

fn check(name: &str) -> Result<(), Error> {
    ros2_client::Name::parse(name)
        .map(drop)
        .map_err(|error| Error::Name { name: name.to_owned(), reason: error.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn remap(node: Option<&str>, from: &str, to: &str) -> Remap {
        Remap { node: node.map(str::to_owned), from: from.into(), to: to.into() }
    }

    #[test]
    fn names_expand() {
        let identity = Identity::new("telemetry", &[remap(None, "__ns", "/car")]).unwrap();
        assert_eq!(identity.fully_qualified(), "/car/telemetry");
        assert_eq!(identity.resolve("odom").unwrap(), "/car/odom");
        assert_eq!(identity.resolve("/clock").unwrap(), "/clock");
        assert_eq!(identity.resolve("~/sequence").unwrap(), "/car/telemetry/sequence");
        let at_root = Identity::new("telemetry", &[]).unwrap();
        assert_eq!(at_root.resolve("odom").unwrap(), "/odom");
        assert_eq!(at_root.resolve("~/sequence").unwrap(), "/telemetry/sequence");
    }

    #[test]
    fn rules_apply_to_expanded_names_of_their_node() {
        let identity = Identity::new(
            "telemetry",
            &[
                remap(None, "__node", "left"),
                remap(None, "odom", "/car_state/odom"),
                remap(None, "~/sequence", "sequence"),
                remap(Some("other"), "drive", "/elsewhere"),
            ],
        )
        .unwrap();
        assert_eq!(identity.resolve("odom").unwrap(), "/car_state/odom");
        assert_eq!(identity.resolve("/odom").unwrap(), "/car_state/odom");
        assert_eq!(identity.resolve("~/sequence").unwrap(), "/sequence");
        assert_eq!(identity.resolve("drive").unwrap(), "/drive");
    }

    #[test]
    fn bad_names_are_refused() {
        let identity = Identity::new("telemetry", &[]).unwrap();
        for name in ["", "a//b", "2a", "a-b", "~", "/", "a/"] {
            assert!(identity.resolve(name).is_err(), "{name}");
        }
        assert!(Identity::new("telemetry", &[remap(None, "__node", "a b")]).is_err());
    }
}
