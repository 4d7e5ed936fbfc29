//! ROS 2 parameter files: node keys with wildcards, `ros__parameters`, nested names.
//!
//! A key such as `/car/telemetry`, `telemetry`, `/**`, `/*/telemetry` or a nesting of them
//! (`car: {telemetry: ...}`) selects nodes: `*` stands for one token of a full name, `**` for any
//! number. All that select a node count, in the order of the file; the last value wins.

use crate::parameters::{Given, Origin};
use crate::value::ParameterValue;
use crate::yaml::{self, Entry, Yaml};

const PARAMETERS: &str = "ros__parameters";

/// The parameters that a file (its path and text) holds for the node with the full name `node`, with
/// nested names joined by dots. The error is a sentence.
pub(crate) fn parameters_for(path: &str, text: &str, node: &str) -> Result<Vec<Given>, String> {
    let document = yaml::parse(text)?;
    let tokens: Vec<&str> = tokens(node).collect();
    let mut found = Found { path, given: Vec::new() };
    select(&document, &mut Vec::new(), &tokens, &mut found)?;
    Ok(found.given)
}

struct Found<'a> {
    path: &'a str,
    given: Vec<Given>,
}

fn tokens(name: &str) -> impl Iterator<Item = &str> {
    name.split('/').filter(|token| !token.is_empty())
}

fn select(
    yaml: &Yaml,
    pattern: &mut Vec<String>,
    node: &[&str],
    found: &mut Found<'_>,
) -> Result<(), String> {
    let Yaml::Mapping(entries) = yaml else {
        return Err(format!("expected a mapping with `{PARAMETERS}` under `{}`", pattern.join("/")));
    };
    for Entry { key, value, line } in entries {
        if key == PARAMETERS {
            if matches(pattern, node) {
                // A section that ends in a wildcard is for other nodes, too.
                let is_own = pattern.last().is_some_and(|token| !token.starts_with('*'));
                flatten(value, "", *line, is_own, found)?;
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

fn flatten(yaml: &Yaml, prefix: &str, line: u64, is_own: bool, found: &mut Found<'_>) -> Result<(), String> {
    match yaml {
        Yaml::Mapping(entries) => entries.iter().try_for_each(|Entry { key, value, line }| {
            let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
            flatten(value, &name, *line, is_own, found)
        }),
        Yaml::Null if prefix.is_empty() => Ok(()),
        value => {
            let value = ParameterValue::from_yaml(value)
                .map_err(|reason| format!("line {line}: {prefix}: {reason}"))?;
            let origin = Origin { place: format!("{}, line {line}", found.path), is_own };
            found.given.push(Given { name: prefix.to_owned(), value, origin });
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use gripsight_mutants::{Mutants, bombs};

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
        given(node, name).map(|given| given.value)
    }

    fn given(node: &str, name: &str) -> Option<Given> {
        parameters_for("a.yaml", FILE, node).unwrap().into_iter().rfind(|given| given.name == name)
    }

    #[test]
    fn places_and_owners_are_kept() {
        let origin = |node: &str, name: &str| given(node, name).map(|given| given.origin).unwrap();
        let at = |place: &str, is_own| Origin { place: place.to_owned(), is_own };
        assert_eq!(origin("/x", "rate"), at("a.yaml, line 4", false));
        assert_eq!(origin("/x", "vehicle.mass_kg"), at("a.yaml, line 5", false));
        assert_eq!(origin("/telemetry", "rate"), at("a.yaml, line 8", true));
        assert_eq!(origin("/car/telemetry", "wild"), at("a.yaml, line 15", true));
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

    /// Whatever a file holds, the answer is a result and comes soon: mutants of a good file, deep nesting, aliases of aliases.
    #[test]
    fn mutated_files_are_answered() {
        let mut mutants = Mutants::new(0x2545_f491_4f6c_dd1d);
        let start = std::time::Instant::now();
        let count = Mutants::count(4000);
        let refused = (0..count)
            .filter(|_| parameters_for("a.yaml", &mutants.text(FILE), "/car/telemetry").is_err())
            .count();
        assert!((count / 10..count).contains(&refused), "{refused}");
        for bomb in bombs() {
            assert!(parameters_for("a.yaml", &bomb, "/x").is_err());
        }
        assert!(start.elapsed().as_secs() < 30, "{:?}", start.elapsed());
    }

    #[test]
    fn what_is_wrong_is_named() {
        let wrong = |text: &str| parameters_for("a.yaml", text, "/x").unwrap_err();
        assert!(wrong("/**: {ros__parameters: {a: [1, x]}}").starts_with("line 1: a:"));
        assert!(wrong("/**: 3").contains("ros__parameters"));
        assert!(!wrong("a: [").is_empty());
    }
}
