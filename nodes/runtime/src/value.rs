//! Values of parameters, and their form in `rcl_interfaces`.

use gripsight_msgs::standard::rcl_interfaces as rcl;

use crate::yaml::{self, Yaml};

/// Value of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub enum ParameterValue {
    /// A truth value.
    Bool(bool),
    /// A whole number.
    Integer(i64),
    /// A number.
    Double(f64),
    /// A text.
    Text(String),
    /// Truth values.
    Bools(Vec<bool>),
    /// Whole numbers.
    Integers(Vec<i64>),
    /// Numbers.
    Doubles(Vec<f64>),
    /// Texts.
    Texts(Vec<String>),
}

impl ParameterValue {
    /// `type` in `rcl_interfaces/msg/ParameterValue` (its 5, an array of bytes, is not used).
    pub(crate) fn type_id(&self) -> u8 {
        match self {
            Self::Bool(_) => 1,
            Self::Integer(_) => 2,
            Self::Double(_) => 3,
            Self::Text(_) => 4,
            Self::Bools(_) => 6,
            Self::Integers(_) => 7,
            Self::Doubles(_) => 8,
            Self::Texts(_) => 9,
        }
    }

    pub(crate) fn type_name(&self) -> &'static str {
        match self {
            Self::Bool(_) => "bool",
            Self::Integer(_) => "integer",
            Self::Double(_) => "double",
            Self::Text(_) => "string",
            Self::Bools(_) => "bool array",
            Self::Integers(_) => "integer array",
            Self::Doubles(_) => "double array",
            Self::Texts(_) => "string array",
        }
    }

    /// The value as one of `wanted`'s type: a whole number will do for a number, an empty array
    /// for any array. `None` when it cannot be.
    pub(crate) fn converted_to(self, wanted: &Self) -> Option<Self> {
        match (self, wanted) {
            (Self::Integer(value), Self::Double(_)) => Some(Self::Double(value as f64)),
            (Self::Integers(values), Self::Doubles(_)) => {
                Some(Self::Doubles(values.iter().map(|value| *value as f64).collect()))
            }
            (Self::Texts(values), Self::Bools(_)) if values.is_empty() => Some(Self::Bools(Vec::new())),
            (Self::Texts(values), Self::Integers(_)) if values.is_empty() => Some(Self::Integers(Vec::new())),
            (Self::Texts(values), Self::Doubles(_)) if values.is_empty() => Some(Self::Doubles(Vec::new())),
            (value, wanted) if value.type_id() == wanted.type_id() => Some(value),
            _ => None,
        }
    }

    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        Self::from_yaml(&yaml::parse(text)?)
    }

    pub(crate) fn from_yaml(yaml: &Yaml) -> Result<Self, String> {
        match yaml {
            Yaml::Bool(value) => Ok(Self::Bool(*value)),
            Yaml::Integer(value) => Ok(Self::Integer(*value)),
            Yaml::Double(value) => Ok(Self::Double(*value)),
            Yaml::Text(value) => Ok(Self::Text(value.clone())),
            Yaml::Sequence(items) => Self::from_items(items),
            Yaml::Null | Yaml::Mapping(_) => Err("expected a value or a list of values".into()),
        }
    }

    fn from_items(items: &[Yaml]) -> Result<Self, String> {
        fn all<T>(items: &[Yaml], pick: impl Fn(&Yaml) -> Option<T>) -> Option<Vec<T>> {
            items.iter().map(pick).collect()
        }
        let number = |item: &Yaml| match item {
            Yaml::Integer(value) => Some(*value as f64),
            Yaml::Double(value) => Some(*value),
            _ => None,
        };
        let text = |item: &Yaml| if let Yaml::Text(value) = item { Some(value.clone()) } else { None };
        let integer = |item: &Yaml| if let Yaml::Integer(value) = item { Some(*value) } else { None };
        let truth = |item: &Yaml| if let Yaml::Bool(value) = item { Some(*value) } else { None };
        all(items, text)
            .map(Self::Texts)
            .or_else(|| all(items, truth).map(Self::Bools))
            .or_else(|| all(items, integer).map(Self::Integers))
            .or_else(|| all(items, number).map(Self::Doubles))
            .ok_or_else(|| "the values of a list must be of one type".into())
    }

    pub(crate) fn to_message(&self) -> rcl::ParameterValue {
        let mut message = rcl::ParameterValue { kind: self.type_id(), ..Default::default() };
        match self.clone() {
            Self::Bool(value) => message.bool_value = value,
            Self::Integer(value) => message.integer_value = value,
            Self::Double(value) => message.double_value = value,
            Self::Text(value) => message.string_value = value,
            Self::Bools(values) => message.bool_array_value = values,
            Self::Integers(values) => message.integer_array_value = values,
            Self::Doubles(values) => message.double_array_value = values,
            Self::Texts(values) => message.string_array_value = values,
        }
        message
    }

    /// `None` for a value that is not set, or of a type that no parameter here has.
    pub(crate) fn from_message(message: rcl::ParameterValue) -> Option<Self> {
        Some(match message.kind {
            1 => Self::Bool(message.bool_value),
            2 => Self::Integer(message.integer_value),
            3 => Self::Double(message.double_value),
            4 => Self::Text(message.string_value),
            6 => Self::Bools(message.bool_array_value),
            7 => Self::Integers(message.integer_array_value),
            8 => Self::Doubles(message.double_array_value),
            9 => Self::Texts(message.string_array_value),
            _ => return None,
        })
    }
}

impl From<ParameterValue> for ros2_client::ParameterValue {
    fn from(value: ParameterValue) -> Self {
        match value {
            ParameterValue::Bool(value) => Self::Boolean(value),
            ParameterValue::Integer(value) => Self::Integer(value),
            ParameterValue::Double(value) => Self::Double(value),
            ParameterValue::Text(value) => Self::String(value),
            ParameterValue::Bools(values) => Self::BooleanArray(values),
            ParameterValue::Integers(values) => Self::IntegerArray(values),
            ParameterValue::Doubles(values) => Self::DoubleArray(values),
            ParameterValue::Texts(values) => Self::StringArray(values),
        }
    }
}

/// A Rust type that a parameter can have.
pub trait ParameterType: Clone + Send + Sync + 'static {
    /// The value as a parameter.
    fn into_value(self) -> ParameterValue;
    /// The parameter's value, or `None` when it has another type.
    fn from_value(value: &ParameterValue) -> Option<Self>;
}

macro_rules! parameter_type {
    ($($type:ty => $variant:ident),*) => {$(
        impl ParameterType for $type {
            fn into_value(self) -> ParameterValue {
                ParameterValue::$variant(self)
            }

            fn from_value(value: &ParameterValue) -> Option<Self> {
                if let ParameterValue::$variant(value) = value { Some(value.clone()) } else { None }
            }
        }
    )*};
}

parameter_type!(
    bool => Bool, i64 => Integer, f64 => Double, String => Text,
    Vec<bool> => Bools, Vec<i64> => Integers, Vec<f64> => Doubles, Vec<String> => Texts
);
