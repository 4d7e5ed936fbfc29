//! Reads `.msg` files: types and names of the fields. Comments, constants and default values are
//! passed over, because neither the wire format nor the type hash depends on them.
//!
//! Not implemented: `wstring`, `char` and `wchar`, which no message here uses.

use crate::Error;

/// A field of a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Name.
    pub name: String,
    /// Type of the field, or of its elements.
    pub base: Base,
    /// One, or how many.
    pub multiplicity: Multiplicity,
}

/// Type of a field or of its elements.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Base {
    /// A built-in type by its `.msg` name, such as `float64`; `string` included.
    Primitive(&'static str),
    /// A string of at most this many bytes.
    BoundedString(u64),
    /// Another message by its full name, such as `std_msgs/msg/Header`.
    Message(String),
}

/// How many elements a field holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Multiplicity {
    /// One.
    One,
    /// `[n]`: exactly this many.
    Array(u64),
    /// `[<=n]`: at most this many.
    Bounded(u64),
    /// `[]`: any number.
    Sequence,
}

const PRIMITIVES: [&str; 13] = [
    "bool", "byte", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32",
    "float64", "string",
];

/// The fields of the message type `type_name` (full name), whose `.msg` file holds `text`.
///
/// # Errors
/// [`Error::Syntax`] with the first line that is none of comment, constant and field.
pub fn parse(type_name: &str, text: &str) -> Result<Vec<Field>, Error> {
    let package = type_name.split('/').next().unwrap_or_default();
    let mut fields = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let code = line.split('#').next().unwrap_or_default().trim();
        if code.is_empty() || code.contains('=') && !code.contains("<=") {
            continue;
        }
        let field = parse_field(package, code).ok_or_else(|| Error::Syntax {
            type_name: type_name.to_owned(),
            line: index + 1,
            text: line.to_owned(),
        })?;
        fields.push(field);
    }
    Ok(fields)
}

fn parse_field(package: &str, code: &str) -> Option<Field> {
    let mut words = code.split_whitespace();
    let (kind, name) = (words.next()?, words.next()?);
    let (element, multiplicity) = match kind.split_once('[') {
        None => (kind, Multiplicity::One),
        Some((element, count)) => (element, parse_multiplicity(count.strip_suffix(']')?)?),
    };
    Some(Field { name: name.to_owned(), base: parse_base(package, element)?, multiplicity })
}

fn parse_multiplicity(count: &str) -> Option<Multiplicity> {
    if count.is_empty() {
        return Some(Multiplicity::Sequence);
    }
    match count.strip_prefix("<=") {
        Some(bound) => bound.parse().ok().map(Multiplicity::Bounded),
        None => count.parse().ok().map(Multiplicity::Array),
    }
}

fn parse_base(package: &str, element: &str) -> Option<Base> {
    if let Some(primitive) = PRIMITIVES.iter().find(|name| **name == element) {
        return Some(Base::Primitive(primitive));
    }
    if let Some(bound) = element.strip_prefix("string<=") {
        return bound.parse().ok().map(Base::BoundedString);
    }
    let parts: Vec<&str> = element.split('/').collect();
    let (package, name) = match parts[..] {
        [name] => (package, name),
        [package, name] | [package, "msg", name] => (package, name),
        _ => return None,
    };
    let is_type_name = name.starts_with(|first: char| first.is_ascii_uppercase());
    is_type_name.then(|| Base::Message(format!("{package}/msg/{name}")))
}
