//! The simulator's own parameter file with other values: nothing else in it changes, comments least of all.
//!
//! A value is found by the keys that lead to it (`tire.p_dy1`), in whatever the file is written in: YAML, JSON, TOML, INI, a Python
//! dictionary. Each key is looked for after the one before it, and the number behind the last one is exchanged. What is found there must be
//! the value that the simulator says it has.

use std::path::Path;

use similar::TextDiff;

use crate::file::text_of;
use crate::{Description, SimulatorError, SimulatorFile};

/// A patched parameter file.
#[derive(Debug, Clone, PartialEq)]
pub struct Patch {
    /// The whole file, patched.
    pub text: String,
    /// The difference, as `patch -p1` takes it.
    pub diff: String,
    /// The parameters that it changes, with their new values.
    pub changed: Vec<(String, f64)>,
    /// What must be changed elsewhere, in words.
    pub by_hand: Vec<String>,
}

/// Digits of a new value: more than any fit knows, few enough to read.
const DIGITS: usize = 5;

/// Patches the simulator's parameter file with new values of some parameters. `None` where it has no such file, or nothing of it changes.
///
/// # Errors
/// [`SimulatorError::Io`]; [`SimulatorError::Patch`] where a value is not found, or is not what the simulator says.
pub fn patch(
    file: &SimulatorFile,
    description: &Description,
    changes: &[(String, f64)],
) -> Result<Option<Patch>, SimulatorError> {
    let mut by_hand = Vec::new();
    let mut changed = Vec::new();
    let path = file.parameter_path();
    let before = match &path {
        Some(path) => text_of(path).map_err(SimulatorError::io(path))?,
        None => String::new(),
    };
    let mut text = before.clone();
    for (name, value) in changes {
        let Some(p) = description.parameters.iter().find(|p| p.name == *name) else { continue };
        let value = if p.integer { value.round() } else { *value };
        match &path {
            Some(path) if !p.keys.is_empty() => {
                for key in &p.keys {
                    let (key, sign) = key.strip_prefix('-').map_or((key.as_str(), 1.0), |key| (key, -1.0));
                    text = with_value(&text, key, sign * p.value, sign * value)
                        .map_err(|why| SimulatorError::Patch { path: path.clone(), why })?;
                }
                changed.push((name.clone(), value));
            }
            _ => {
                let place = p.in_code.as_ref().or_else(|| p.keys.first()).unwrap_or(&p.name);
                by_hand.push(format!("{name}: {} to {} ({place})", number(p.value), number(value)));
            }
        }
    }
    if changed.is_empty() {
        return Ok((!by_hand.is_empty()).then_some(Patch { text, diff: String::new(), changed, by_hand }));
    }
    let name = path.as_deref().and_then(Path::file_name).map(|n| n.to_string_lossy().into_owned());
    let name = name.unwrap_or_default();
    let diff = TextDiff::from_lines(&before, &text)
        .unified_diff()
        .context_radius(3)
        .header(&format!("a/{name}"), &format!("b/{name}"))
        .to_string();
    Ok(Some(Patch { text, diff, changed, by_hand }))
}

/// A value as it is written: a few digits, no exponent where none is needed.
fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let magnitude = value.abs().log10().floor();
    if (-4.0..7.0).contains(&magnitude) {
        let decimals = (DIGITS as f64 - 1.0 - magnitude).max(0.0) as usize;
        let text = format!("{value:.decimals$}");
        if text.contains('.') {
            let text = text.trim_end_matches('0');
            return if text.ends_with('.') { format!("{text}0") } else { text.to_owned() };
        }
        return text;
    }
    format!("{value:.*e}", DIGITS - 1)
}

/// The text with the value behind a key exchanged.
fn with_value(text: &str, key: &str, old: f64, new: f64) -> Result<String, String> {
    // Some files write the whole way as one key.
    let whole = after_key(text, key, 0).map(Ok);
    let from = whole.unwrap_or_else(|| {
        key.split('.').try_fold(0, |from, part| {
            after_key(text, part, from).ok_or_else(|| format!("the key {part} of {key} is not in it"))
        })
    })?;
    let rest = &text[from..];
    let start = from + rest.len() - rest.trim_start_matches([' ', '\t', '"', '\'']).len();
    let is_number = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+' | 'e' | 'E' | '_');
    let len = text[start..].find(|c| !is_number(c)).unwrap_or(text.len() - start);
    let written = &text[start..start + len];
    let value: f64 = written
        .replace('_', "")
        .parse()
        .map_err(|_| format!("behind {key} there is no number but `{}`", first_line(&text[start..])))?;
    if (value - old).abs() > 1e-6 * old.abs().max(1e-9) {
        return Err(format!("{key} is {written} in it, but {} in the simulator that runs", number(old)));
    }
    // An integer stays one: some readers are particular.
    let whole = !written.contains(['.', 'e', 'E']) && new == new.round();
    let new = if whole { format!("{new:.0}") } else { number(new) };
    Ok(format!("{}{new}{}", &text[..start], &text[start + len..]))
}

fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default().trim()
}

/// The place behind a key and its `:` or `=`, outside of comments.
fn after_key(text: &str, key: &str, from: usize) -> Option<usize> {
    let mut at = from;
    while let Some(found) = text[at..].find(key) {
        let (start, end) = (at + found, at + found + key.len());
        let is_word = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
        let before = text[..start].chars().next_back();
        let line = text[..start].rfind('\n').map_or(0, |n| n + 1);
        let commented = text[line..start].contains('#') || text[line..start].contains("//");
        let rest = text[end..].trim_start_matches(['"', '\'', ' ', '\t']);
        let closes = rest.starts_with([':', '=']);
        if !commented && closes && !before.is_some_and(is_word) {
            return Some(text.len() - rest.len() + 1);
        }
        at = end;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_exchanged_and_nothing_else_whatever_the_file_is_written_in() {
        let yaml = "# mass: 1\ncar:\n  mass: 3.74   # weighed: in May\n  tire: {mu: 1.0489, C_Sf: 4.718}\nmass_2: 3\n";
        let patched = with_value(yaml, "car.mass", 3.74, 3.47).unwrap();
        assert_eq!(patched, yaml.replace("3.74 ", "3.47 "));
        assert_eq!(
            with_value(yaml, "car.tire.C_Sf", 4.718, 3.7744).unwrap(),
            yaml.replace("4.718", "3.7744")
        );
        assert_eq!(with_value(yaml, "mass_2", 3.0, 5.0).unwrap(), yaml.replace("mass_2: 3", "mass_2: 5"));
        for (text, key) in [
            ("params = {'mu': 1.5, 'm': 3.74}", "m"),
            ("{\"a\": {\"m\": 1},\n \"b\": {\"m\" : 3.74}}", "b.m"),
            ("a.m: 1\nb.m: 3.74\n", "b.m"),
            ("[car]\nm = 3.74 ; weighed", "m"),
            ("/**:\n  ros__parameters:\n    m: 3.74\n", "ros__parameters.m"),
        ] {
            assert_eq!(with_value(text, key, 3.74, 0.001).unwrap(), text.replace("3.74", "0.001"), "{text}");
        }
    }

    #[test]
    fn what_is_not_there_or_not_the_same_is_said() {
        let text = "mass: 3.74\nname: gym\n";
        let error = |key: &str, old: f64| with_value(text, key, old, 1.0).unwrap_err();
        assert!(error("weight", 3.74).contains("the key weight of weight is not in it"));
        assert!(error("mass", 3.5).contains("mass is 3.74 in it, but 3.5 in the simulator"));
        assert!(error("name", 3.5).contains("no number but `gym`"));
    }

    #[test]
    fn a_figure_that_stands_in_several_places_is_changed_in_each() {
        let parameter =
            |key: &str| format!(r#"{{"name": "stiffness", "value": 10, "low": 5, "high": 20, {key}}}"#);
        let keys =
            |key: &str| serde_json::from_str::<crate::SimulatorParameter>(&parameter(key)).unwrap().keys;
        assert_eq!(keys(r#""key": "a.b""#), ["a.b"]);
        assert_eq!(keys(r#""key": null"#), [""; 0]);
        assert_eq!(keys(r#""key": ["left.b", "right.b"]"#), ["left.b", "right.b"]);
        use crate::Roll as _;
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("car.yaml"), "left: {b: 10}\nright: {b: 10}\n").unwrap();
        let text = "command: [none]\nparameter_file: car.yaml";
        let file = SimulatorFile::parse(text, folder.path()).unwrap();
        let mut description = crate::test_car::TestCar::new().description().clone();
        description.parameters =
            vec![serde_json::from_str(&parameter(r#""key": ["left.b", "right.b"]"#)).unwrap()];
        let found = patch(&file, &description, &[("stiffness".to_owned(), 7.5)]).unwrap().unwrap();
        assert_eq!(found.text, "left: {b: 7.5}\nright: {b: 7.5}\n");
        assert!(found.by_hand.is_empty() && found.changed.len() == 1);
        // A limit to the left and to the right.
        std::fs::write(folder.path().join("car.yaml"), "s_min: -10\ns_max: 10\n").unwrap();
        description.parameters =
            vec![serde_json::from_str(&parameter(r#""key": ["s_max", "-s_min"]"#)).unwrap()];
        let found = patch(&file, &description, &[("stiffness".to_owned(), 7.5)]).unwrap().unwrap();
        assert_eq!(found.text, "s_min: -7.5\ns_max: 7.5\n");
    }

    #[test]
    fn numbers_are_written_as_people_do() {
        for (value, text) in [
            (3.47, "3.47"),
            (1200.0, "1200.0"),
            (0.047_123_4, "0.047123"),
            (123_456.7, "123457"),
            (-2.0, "-2.0"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
