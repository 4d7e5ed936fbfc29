//! Schema text of a message as bags store it (encoding `ros2msg`).

use std::collections::BTreeMap;

use crate::idl::{self, Base};
use crate::{Error, definition};

/// Fields of `type_name` and of every message type nested in it, by full name.
pub(crate) fn closure(
    type_name: &str,
    find: impl Fn(&str) -> Option<&'static str>,
) -> Result<BTreeMap<String, Vec<idl::Field>>, Error> {
    let mut found = BTreeMap::new();
    let mut open = vec![type_name.to_owned()];
    while let Some(name) = open.pop() {
        if found.contains_key(&name) {
            continue;
        }
        let text = find(&name).ok_or_else(|| Error::UnknownType(name.clone()))?;
        let fields = idl::parse(&name, text)?;
        open.extend(fields.iter().filter_map(|field| match &field.base {
            Base::Message(nested) => Some(nested.clone()),
            _ => None,
        }));
        found.insert(name, fields);
    }
    Ok(found)
}

/// The `ros2msg` schema text of a message type: its definition, then, each after a line of 80 `=`
/// and a line `MSG: package/Type`, the definitions of all nested types in alphabetical order.
///
/// # Errors
/// [`Error::UnknownType`] when `type_name` (full name) or a nested type is not known here.
pub fn schema(type_name: &str) -> Result<String, Error> {
    let text_of = |name: &str| definition(name).ok_or_else(|| Error::UnknownType(name.to_owned()));
    let mut text = text_of(type_name)?.to_owned();
    for name in closure(type_name, definition)?.keys().filter(|name| *name != type_name) {
        let short_name = name.replace("/msg/", "/");
        text.push_str(&format!("{}\nMSG: {short_name}\n{}", "=".repeat(80), text_of(name)?));
    }
    Ok(text)
}
