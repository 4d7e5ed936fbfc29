//! The parameters of a node: declared with a description, a default and a range; set at start by
//! files and the command line, and while the node runs by the parameter services.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use gripsight_msgs::standard::rcl_interfaces as rcl;

use crate::Error;
use crate::value::{ParameterType, ParameterValue};

/// What a parameter means and may be.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Descriptor {
    description: String,
    range: Option<(f64, f64)>,
    choices: &'static [&'static str],
    read_only: bool,
}

impl Descriptor {
    /// A parameter with this meaning (with its unit), of any value.
    pub fn new(description: impl Into<String>) -> Self {
        Self { description: description.into(), ..Self::default() }
    }

    /// Numbers outside `range` are refused. Counts for every element of an array.
    #[must_use]
    pub fn range(mut self, range: RangeInclusive<f64>) -> Self {
        self.range = Some((*range.start(), *range.end()));
        self
    }

    /// Texts other than these are refused.
    #[must_use]
    pub fn choices(mut self, choices: &'static [&'static str]) -> Self {
        self.choices = choices;
        self
    }

    /// The value cannot change while the node runs.
    #[must_use]
    pub fn read_only(mut self) -> Self {
        self.read_only = true;
        self
    }

    fn check(&self, value: &ParameterValue) -> Result<(), String> {
        let numbers = match value {
            ParameterValue::Integer(number) => vec![*number as f64],
            ParameterValue::Double(number) => vec![*number],
            ParameterValue::Integers(numbers) => numbers.iter().map(|number| *number as f64).collect(),
            ParameterValue::Doubles(numbers) => numbers.clone(),
            _ => Vec::new(),
        };
        if let Some((low, high)) = self.range
            && let Some(outside) = numbers.iter().find(|number| !(low..=high).contains(*number))
        {
            return Err(format!("expected {low} to {high}, got {outside}"));
        }
        if let ParameterValue::Text(text) = value
            && !self.choices.is_empty()
            && !self.choices.contains(&text.as_str())
        {
            return Err(format!("expected one of {}, got `{text}`", self.choices.join(", ")));
        }
        Ok(())
    }
}

/// A value that a file or the command line gives a parameter.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Given {
    pub(crate) name: String,
    pub(crate) value: ParameterValue,
    pub(crate) origin: Origin,
}

/// Where a value was given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Origin {
    /// In words.
    pub(crate) place: String,
    /// For this node alone, by its name.
    pub(crate) is_own: bool,
}

#[derive(Clone, Debug)]
struct Declared {
    value: ParameterValue,
    descriptor: Descriptor,
}

/// All parameters of a node.
#[derive(Debug)]
pub(crate) struct ParameterStore {
    /// Values from files and the command line by name, for parameters declared or not.
    overrides: BTreeMap<String, Given>,
    declared: Mutex<BTreeMap<String, Declared>>,
}

impl ParameterStore {
    /// A store whose parameters start at `overrides` where those name them; of several of one
    /// name the last counts.
    pub(crate) fn new(overrides: impl IntoIterator<Item = Given>) -> Self {
        let overrides = overrides.into_iter().map(|given| (given.name.clone(), given)).collect();
        Self { overrides, declared: Mutex::default() }
    }

    /// Looks for values given to parameters that the node does not have, once it has declared all. Where the value is for this node
    /// alone that is an error; where others share it, a sentence each, unless it belongs to a block (`vehicle.`) of which the node has
    /// nothing.
    pub(crate) fn undeclared(&self) -> Result<Vec<String>, Error> {
        let declared = self.declared();
        let block = |name: &str| name.split_once('.').map(|(block, _)| format!("{block}."));
        let is_others = |name: &str| {
            block(name).is_some_and(|block| declared.keys().all(|declared| !declared.starts_with(&block)))
        };
        let names = declared.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
        let mut sentences = Vec::new();
        for Given { name, origin, .. } in
            self.overrides.values().filter(|given| !declared.contains_key(&given.name))
        {
            if origin.is_own {
                let reason = format!("{}: this node has no such parameter; it has {names}", origin.place);
                return Err(Error::parameter(name, reason));
            }
            if !is_others(name) {
                sentences.push(format!("parameter {name} ({}) is none of this node's", origin.place));
            }
        }
        Ok(sentences)
    }

    fn declared(&self) -> MutexGuard<'_, BTreeMap<String, Declared>> {
        self.declared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Declares a parameter and gives the handle to read it by.
    ///
    /// # Errors
    /// [`Error::Parameter`] when it is declared already, or when its value in a file or on the
    /// command line has the wrong type or lies outside the range.
    pub(crate) fn declare<T: ParameterType>(
        self: &Arc<Self>,
        name: &str,
        default: T,
        descriptor: Descriptor,
    ) -> Result<Parameter<T>, Error> {
        let default_value = default.clone().into_value();
        let value = match self.overrides.get(name) {
            None => default_value,
            Some(Given { value: given, origin, .. }) => {
                given.clone().converted_to(&default_value).ok_or_else(|| {
                    let reason = wrong_type(default_value.type_name(), given.type_name());
                    Error::parameter(name, format!("{reason} ({})", origin.place))
                })?
            }
        };
        descriptor.check(&value).map_err(|reason| match self.overrides.get(name) {
            Some(given) => Error::parameter(name, format!("{reason} ({})", given.origin.place)),
            None => Error::parameter(name, reason),
        })?;
        let mut declared = self.declared();
        if declared.contains_key(name) {
            return Err(Error::parameter(name, "declared twice"));
        }
        declared.insert(name.to_owned(), Declared { value, descriptor });
        Ok(Parameter { store: Arc::clone(self), name: name.to_owned(), default })
    }

    pub(crate) fn get(&self, name: &str) -> Option<ParameterValue> {
        self.declared().get(name).map(|declared| declared.value.clone())
    }

    pub(crate) fn names(&self) -> Vec<String> {
        self.declared().keys().cloned().collect()
    }

    /// All values, by name.
    pub(crate) fn values(&self) -> Vec<(String, ParameterValue)> {
        self.declared().iter().map(|(name, declared)| (name.clone(), declared.value.clone())).collect()
    }

    /// Sets all of `parameters`, or none when one is refused; gives them as they now are. The error says which and why.
    pub(crate) fn set(
        &self,
        parameters: Vec<rcl::Parameter>,
    ) -> Result<Vec<(String, ParameterValue)>, String> {
        let mut declared = self.declared();
        let mut changed = Vec::with_capacity(parameters.len());
        for parameter in parameters {
            let value = accepted(&declared, &parameter.name, parameter.value)
                .map_err(|reason| format!("parameter {}: {reason}", parameter.name))?;
            changed.push((parameter.name, value));
        }
        for (name, value) in &changed {
            if let Some(parameter) = declared.get_mut(name) {
                parameter.value = value.clone();
            }
        }
        Ok(changed)
    }

    pub(crate) fn descriptor(&self, name: &str) -> Option<rcl::ParameterDescriptor> {
        let declared = self.declared();
        let Declared { value, descriptor } = declared.get(name)?;
        let mut message = rcl::ParameterDescriptor {
            name: name.to_owned(),
            kind: value.type_id(),
            description: descriptor.description.clone(),
            additional_constraints: descriptor.choices.join(" | "),
            read_only: descriptor.read_only,
            ..Default::default()
        };
        match (value, descriptor.range) {
            (ParameterValue::Integer(_) | ParameterValue::Integers(_), Some((low, high))) => {
                let range =
                    rcl::IntegerRange { from_value: low.ceil() as i64, to_value: high as i64, step: 0 };
                message.integer_range.push(range);
            }
            (_, Some((from_value, to_value))) => {
                message.floating_point_range.push(rcl::FloatingPointRange {
                    from_value,
                    to_value,
                    step: 0.0,
                });
            }
            (_, None) => {}
        }
        Some(message)
    }
}

fn accepted(
    declared: &BTreeMap<String, Declared>,
    name: &str,
    message: rcl::ParameterValue,
) -> Result<ParameterValue, String> {
    let Declared { value: old, descriptor } = declared.get(name).ok_or("not declared")?;
    let given = ParameterValue::from_message(message)
        .ok_or_else(|| wrong_type(old.type_name(), "no value, or bytes"))?;
    let given_type = given.type_name();
    let value = given.converted_to(old).ok_or_else(|| wrong_type(old.type_name(), given_type))?;
    // What it is already it may be told: `ros2 param load` of what `ros2 param dump` wrote.
    if descriptor.read_only && value != *old {
        return Err("read-only: it is set when the node starts".into());
    }
    descriptor.check(&value)?;
    Ok(value)
}

fn wrong_type(expected: &str, given: &str) -> String {
    format!("expected a {expected}, got a {given}")
}

/// A declared parameter. Reading it gives the value of the moment.
#[derive(Clone, Debug)]
pub struct Parameter<T> {
    store: Arc<ParameterStore>,
    name: String,
    default: T,
}

impl<T: ParameterType> Parameter<T> {
    /// The value.
    pub fn get(&self) -> T {
        // The store never lets the type change, so the default is never taken.
        self.store
            .get(&self.name)
            .and_then(|value| T::from_value(&value))
            .unwrap_or_else(|| self.default.clone())
    }

    /// The name.
    pub fn name(&self) -> &str {
        &self.name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn store() -> Arc<ParameterStore> {
        let overrides = [("rate", "1"), ("rate", "2"), ("foreign", "x"), ("words", "[]")]
            .map(|(name, text)| given(name, text, false));
        Arc::new(ParameterStore::new(overrides))
    }

    fn given(name: &str, text: &str, is_own: bool) -> Given {
        let origin = Origin { place: "a.yaml, line 3".to_owned(), is_own };
        Given { name: name.to_owned(), value: ParameterValue::parse(text).unwrap(), origin }
    }

    #[test]
    fn values_for_parameters_that_the_node_does_not_have_are_told() {
        let undeclared = |given: &[Given]| {
            let store = Arc::new(ParameterStore::new(given.to_vec()));
            store.declare("rate", 1.0, Descriptor::new("")).unwrap();
            store.declare("sensor.delay_s", 1.0, Descriptor::new("")).unwrap();
            store.undeclared().map_err(|error| error.to_string())
        };
        assert_eq!(undeclared(&[given("rate", "2", true), given("vehicle.mass_kg", "3", false)]), Ok(vec![]));
        let shared = undeclared(&[given("rte", "2", false), given("sensor.delay", "3", false)]).unwrap();
        assert_eq!(shared.len(), 2, "{shared:?}");
        let own = undeclared(&[given("rte", "2", true)]).unwrap_err();
        assert!(own.starts_with("parameter rte: a.yaml, line 3: ") && own.contains("rate"), "{own}");
    }

    fn message(name: &str, value: impl ParameterType) -> rcl::Parameter {
        rcl::Parameter { name: name.into(), value: value.into_value().to_message() }
    }

    #[test]
    fn the_last_override_counts_and_whole_numbers_are_numbers() {
        let rate = store().declare("rate", 0.5, Descriptor::new("Rate (1/s)").range(0.0..=10.0)).unwrap();
        assert_eq!(rate.get(), 2.0);
        let numbers = store().declare("words", vec![1.0], Descriptor::new("Numbers")).unwrap();
        assert!(numbers.get().is_empty());
    }

    #[test]
    fn declarations_are_checked() {
        let store = store();
        let reason = |result: Result<Parameter<f64>, Error>| result.unwrap_err().to_string();
        assert!(
            reason(store.declare("rate", 0.5, Descriptor::new("").range(0.0..=1.0)))
                .contains("0 to 1, got 2")
        );
        assert!(
            reason(store.declare("foreign", 0.5, Descriptor::new(""))).contains("a double, got a string")
        );
        store.declare("a", 1_i64, Descriptor::new("")).unwrap();
        assert!(reason(store.declare("a", 0.5, Descriptor::new(""))).contains("twice"));
        let choices = Descriptor::new("").choices(&["s4", "mlp"]);
        assert!(store.declare("b", String::from("rnn"), choices).is_err());
        let not_a_number = store.declare("c", f64::NAN, Descriptor::new("").range(0.0..=1.0));
        assert!(reason(not_a_number).contains("NaN"));
    }

    #[test]
    fn setting_is_checked_and_all_or_nothing() {
        let store = store();
        let rate = store.declare("rate", 0.5, Descriptor::new("").range(0.0..=10.0)).unwrap();
        let name = store.declare("name", String::from("a"), Descriptor::new("").read_only()).unwrap();
        let set = store.set(vec![message("rate", 3_i64)]).unwrap();
        // A double is a double, whoever set it with a whole number.
        assert_eq!(set, [("rate".to_owned(), ParameterValue::Double(3.0))]);
        assert_eq!(rate.get(), 3.0);
        for (bad, part) in [
            (message("rate", 11.0), "0 to 10"),
            (message("rate", String::from("x")), "a double, got a string"),
            (message("name", String::from("b")), "read-only"),
            (message("none", 1.0), "not declared"),
            (rcl::Parameter { name: "rate".into(), ..Default::default() }, "no value"),
        ] {
            let reason = store.set(vec![message("rate", 4.0), bad]).unwrap_err();
            assert!(reason.contains(part), "{reason}");
        }
        assert_eq!((rate.get(), name.get().as_str()), (3.0, "a"));
    }

    #[test]
    fn what_was_dumped_can_be_loaded() {
        let store = store();
        store.declare("name", String::from("a"), Descriptor::new("").read_only()).unwrap();
        store.declare("share", 1.0, Descriptor::new("").read_only()).unwrap();
        let dumped = vec![message("name", String::from("a")), message("share", 1.0)];
        assert!(store.set(dumped).is_ok());
        assert!(store.set(vec![message("share", 0.5)]).unwrap_err().contains("read-only"));
    }

    #[test]
    fn descriptors_carry_type_and_range() {
        let store = store();
        store.declare("n", 3_i64, Descriptor::new("Count").range(1.0..=9.0)).unwrap();
        let descriptor = store.descriptor("n").unwrap();
        assert_eq!((descriptor.kind, descriptor.description.as_str()), (2, "Count"));
        assert_eq!((descriptor.integer_range[0].from_value, descriptor.integer_range[0].to_value), (1, 9));
        assert!(store.descriptor("m").is_none());
    }
}
