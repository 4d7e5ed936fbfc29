//! Where a field stands in a message: `twist.twist.linear.x`, `velocity[0]`, `velocity[wheel_fl]`.

use std::str::FromStr;

/// One step into a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Step {
    /// A field of a message.
    Field(String),
    /// An element of an array, from 0.
    Index(usize),
    /// The element that bears this name in the array `name` beside it.
    Named(String),
}

/// The way to a field.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FieldPath {
    text: String,
    steps: Vec<Step>,
}

impl FieldPath {
    pub(crate) fn steps(&self) -> &[Step] {
        &self.steps
    }
}

impl std::fmt::Display for FieldPath {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text)
    }
}

impl FromStr for FieldPath {
    type Err = String;

    /// Reads a path.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut steps = Vec::new();
        for part in text.split('.') {
            let (name, element) = match part.split_once('[') {
                Some((name, rest)) => (name, Some(rest.strip_suffix(']').ok_or("a `[` without its `]`")?)),
                None => (part, None),
            };
            if name.is_empty() {
                return Err("expected names joined by dots, such as twist.twist.linear.x".to_owned());
            }
            steps.push(Step::Field(name.to_owned()));
            steps.extend(element.map(|e| match e.parse() {
                Ok(index) => Step::Index(index),
                Err(_) => Step::Named(e.to_owned()),
            }));
        }
        Ok(Self { text: text.to_owned(), steps })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_read_and_bad_ones_say_why() {
        let path: FieldPath = "state.velocity[wheel_fl]".parse().unwrap();
        let [Step::Field(state), Step::Field(velocity), Step::Named(wheel)] = path.steps() else { panic!() };
        assert_eq!((state.as_str(), velocity.as_str(), wheel.as_str()), ("state", "velocity", "wheel_fl"));
        assert_eq!("a[3]".parse::<FieldPath>().unwrap().steps()[1], Step::Index(3));
        for bad in ["", "a..b", "a[1", ".a"] {
            assert!(bad.parse::<FieldPath>().is_err(), "{bad}");
        }
    }
}
