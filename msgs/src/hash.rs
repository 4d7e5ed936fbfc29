//! Type hashes, version 1 (RIHS01): SHA-256 over a canonical JSON description of a message type
//! and of every type nested in it. Source: ROS REP 2016, and `rosidl_generator_type_description`.

use std::collections::BTreeMap;

use sha2::{Digest, Sha256};

use crate::idl::{Base, Field, Multiplicity};
use crate::schema::closure;
use crate::{Error, definition};

/// The hash of a message type known here, as `RIHS01_` and 64 hexadecimal digits.
///
/// # Errors
/// [`Error::UnknownType`] when `type_name` (full name) or a nested type is not known here.
pub fn type_hash(type_name: &str) -> Result<String, Error> {
    type_hash_of(type_name, definition)
}

/// As [`type_hash`], with definitions from `find` (full name to text of the `.msg` file).
///
/// # Errors
/// [`Error::UnknownType`] when `find` has no text, [`Error::Syntax`] when the text is no `.msg` file.
pub fn type_hash_of(type_name: &str, find: impl Fn(&str) -> Option<&'static str>) -> Result<String, Error> {
    let types = closure(type_name, find)?;
    let digest = Sha256::digest(description(type_name, &types));
    let hex: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    Ok(format!("RIHS01_{hex}"))
}

fn description(type_name: &str, types: &BTreeMap<String, Vec<Field>>) -> String {
    let own = types.get(type_name).map(|fields| individual(type_name, fields)).unwrap_or_default();
    let nested: Vec<String> = types
        .iter()
        .filter(|(name, _)| *name != type_name)
        .map(|(name, fields)| individual(name, fields))
        .collect();
    format!(r#"{{"type_description": {own}, "referenced_type_descriptions": [{}]}}"#, nested.join(", "))
}

fn individual(type_name: &str, fields: &[Field]) -> String {
    let fields: Vec<String> = fields.iter().map(field).collect();
    format!(r#"{{"type_name": "{type_name}", "fields": [{}]}}"#, fields.join(", "))
}

fn field(field: &Field) -> String {
    let (base_id, string_capacity, nested) = match &field.base {
        Base::Primitive(name) => (primitive_id(name), 0, ""),
        Base::BoundedString(bound) => (21, *bound, ""),
        Base::Message(name) => (1, 0, name.as_str()),
    };
    let (offset, capacity) = match field.multiplicity {
        Multiplicity::One => (0, 0),
        Multiplicity::Array(count) => (48, count),
        Multiplicity::Bounded(bound) => (96, bound),
        Multiplicity::Sequence => (144, 0),
    };
    format!(
        r#"{{"name": "{}", "type": {{"type_id": {}, "capacity": {capacity}, "string_capacity": {string_capacity}, "nested_type_name": "{nested}"}}}}"#,
        field.name,
        base_id + offset,
    )
}

/// `type_id` of a built-in type; [`crate::idl`] lets no other name through.
fn primitive_id(name: &str) -> u8 {
    match name {
        "int8" => 2,
        "uint8" => 3,
        "int16" => 4,
        "uint16" => 5,
        "int32" => 6,
        "uint32" => 7,
        "int64" => 8,
        "uint64" => 9,
        "float32" => 10,
        "float64" => 11,
        "bool" => 15,
        "byte" => 16,
        _ => 17,
    }
}
