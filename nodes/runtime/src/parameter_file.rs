//! ROS 2 parameter files: node keys with wildcards, `ros__parameters`, nested names.
//!
//! A key such as `/car/telemetry`, `telemetry`, `/**`, `/*/telemetry` or a nesting of them
//! (`car: {telemetry: ...}`) selects nodes: `*` stands for one token of a full name, `**` for any
//! number. All that select a node count, in the order of the file; the last value wins.

use crate::value::ParameterValue;
use crate::yaml::{self, Yaml};

const PARAMETERS: &str = "ros__parameters";

/// The parameters that a file (its text) holds for the node with the full name `node`, with
/// nested names joined by dots. The error is a sentence.
pub(crate) fn parameters_for(text: &str, node: &str) -> Result<Vec<(String, ParameterValue)>, String> {
    let document = yaml::parse(text)?;
    let tokens: Vec<&str> = tokens(node).collect();
    let mut found = Vec::new();
    select(&document, &mut Vec::new(), &tokens, &mut found)?;
    Ok(found)
}

type Found = Vec<(String, ParameterValue)>;

fn tokens(name: &str) -> impl Iterator<Item = &str> {
    name.split('/').filter(|token| !token.is_empty())
}

fn select(yaml: &Yaml, pattern: &mut Vec<String>, node: &[&str], found: &mut Found) -> Result<(), String> {
    let Yaml::Mapping(entries) = yaml else {
        return Err(format!("expected a mapping with `{PARAMETERS}` under `{}`", pattern.join("/")));
    };
    for (key, value) in entries {
        if key == PARAMETERS {
            if matches(pattern, node) {
                flatten(value, "", found)?;
            }
            continue;
        }
        let depth = pattern.len();
        pattern.extend(tokens(key).map(str::to_owned));
        select(value, pattern, node, found)?;
        pattern.truncate(depth);
    }
    Ok(())
}

fn matches<S: AsRef<str>>(pattern: &[S], node: &[&str]) -> bool {
    let Some((first, rest)) = pattern.split_first() else {
        return node.is_empty();
    };
    match (first.as_ref(), node.split_first()) {
        ("**", _) => (0..=node.len()).any(|skipped| matches(rest, &node[skipped..])),
        (token, Some((head, tail))) => (token == "*" || token == *head) && matches(rest, tail),
        (_, None) => false,
    }
}

fn flatten(yaml: &Yaml, prefix: &str, found: &mut Found) -> Result<(), String> {
    match yaml {
        Yaml::Mapping(entries) => entries.iter().try_for_each(|(key, value)| {
            let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
            flatten(value, &name, found)
        }),
        Yaml::Null if prefix.is_empty() => Ok(()),
        value => {
            let value = ParameterValue::from_yaml(value).map_err(|reason| format!("{prefix}: {reason}"))?;
            found.push((prefix.to_owned(), value));
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "
/**:
  ros__parameters:
    rate: 1.0
    vehicle: {mass_kg: 3.3, name: rc10, gears: [1, 2.5]}
telemetry:
  ros__parameters:
    rate: 2
/car/telemetry:
  ros__parameters: {rate: 3.0}
car:
  identifier:
    ros__parameters: {seed: 7}
/*/telemetry:
  ros__parameters: {wild: true}
";

    fn last(node: &str, name: &str) -> Option<ParameterValue> {
        parameters_for(FILE, node).unwrap().into_iter().rfind(|(key, _)| key == name).map(|(_, value)| value)
    }

    #[test]
    fn keys_select_nodes() {
        assert_eq!(last("/telemetry", "rate"), Some(ParameterValue::Integer(2)));
        assert_eq!(last("/car/telemetry", "rate"), Some(ParameterValue::Double(3.0)));
        assert_eq!(last("/other", "rate"), Some(ParameterValue::Double(1.0)));
        assert_eq!(last("/car/identifier", "seed"), Some(ParameterValue::Integer(7)));
        assert_eq!(last("/car/telemetry", "wild"), Some(ParameterValue::Bool(true)));
        assert_eq!(last("/telemetry", "wild"), None);
    }

    #[test]
    fn nested_names_are_joined() {
        assert_eq!(last("/x", "vehicle.mass_kg"), Some(ParameterValue::Double(3.3)));
        assert_eq!(last("/x", "vehicle.name"), Some(ParameterValue::Text("rc10".into())));
        assert_eq!(last("/x", "vehicle.gears"), Some(ParameterValue::Doubles(vec![1.0, 2.5])));
    }

    #[test]
    fn what_is_wrong_is_named() {
        assert!(parameters_for("/**: {ros__parameters: {a: [1, x]}}", "/x").unwrap_err().starts_with("a:"));
        assert!(parameters_for("/**: 3", "/x").unwrap_err().contains("ros__parameters"));
        assert!(parameters_for("a: [", "/x").is_err());
    }
}
