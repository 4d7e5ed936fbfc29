//! The layout of a message type: its `.msg` text and those of the types in it.

use std::collections::BTreeMap;

use re_ros_msg::MessageSchema;
use re_ros_msg::message_spec::{ArraySize, BuiltInType, ComplexType, MessageSpecification, Type};

use super::path::{FieldPath, Step};
use crate::BagError;

/// A built-in type that is a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Primitive {
    Bool,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Primitive {
    pub(super) fn size(self) -> usize {
        match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// What a field, or each of its elements, is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Shape {
    Primitive(Primitive),
    String,
    /// A message, by its place among [`Schema::types`].
    Message(usize),
}

/// A field.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Slot {
    pub(super) name: String,
    pub(super) shape: Shape,
    /// `None`: one; 0: as many as the message says; else exactly so many.
    pub(super) count: Option<usize>,
}

/// The layout of a message type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schema {
    type_name: String,
    /// Types in the order in which they were met, the message itself first. None is without a field, and none holds itself.
    types: Vec<(String, Vec<Slot>)>,
}

const MOST_NESTED: usize = 32;
/// Fields of a message, those of the messages in it counted each time (of an array once).
const MOST_FIELDS: usize = 10_000;
/// A message without fields has one on the wire (rosidl).
const FILLER: &str = "structure_needs_at_least_one_member";

impl Schema {
    /// Reads the text of a type: its `.msg` file, followed by those of the types in it, each behind a line of `=` and a line
    /// `MSG: package/Type`. Standard types may be missing.
    ///
    /// # Errors
    /// [`BagError::Layout`].
    pub fn parse(type_name: &str, text: &str) -> Result<Self, BagError> {
        let failed = |why: String| BagError::Layout { type_name: type_name.to_owned(), why };
        let parsed = MessageSchema::parse(type_name, text).map_err(|e| failed(format!("{e:#}")))?;
        let mut texts: BTreeMap<String, MessageSpecification> =
            parsed.dependencies.into_iter().map(|spec| (short(&spec.name), spec)).collect();
        texts.insert(short(type_name), parsed.spec);
        let mut schema = Self { type_name: type_name.to_owned(), types: Vec::new() };
        schema.add(&short(type_name), &mut texts, 0).map_err(failed)?;
        Ok(schema)
    }

    /// The type's full name.
    #[must_use]
    pub fn type_name(&self) -> &str {
        &self.type_name
    }

    /// Every path that leads to a number, and the type there; of an array its first element.
    #[must_use]
    pub fn numbers(&self) -> Vec<String> {
        let mut found = Vec::new();
        self.collect(self.root(), "", &mut found);
        found
    }

    pub(super) fn root(&self) -> usize {
        0
    }

    pub(super) fn slots(&self, index: usize) -> &[Slot] {
        &self.types[index].1
    }

    pub(super) fn is_quaternion(&self, index: usize) -> bool {
        self.types[index].0 == "geometry_msgs/Quaternion"
    }

    /// Checks that a path leads to a number.
    pub(super) fn check(&self, path: &FieldPath) -> Result<(), BagError> {
        let refuse =
            |why: String| BagError::Field { type_name: self.type_name.clone(), field: path.to_string(), why };
        let mut shape = &Shape::Message(self.root());
        let mut steps = path.steps().iter().peekable();
        while let Some(step) = steps.next() {
            let (Step::Field(name), Shape::Message(index)) = (step, shape) else {
                return Err(refuse("there is no message at that place".to_owned()));
            };
            let Some(slot) = self.slots(*index).iter().find(|slot| slot.name == *name) else {
                let names: Vec<&str> = self.slots(*index).iter().map(|slot| slot.name.as_str()).collect();
                return Err(refuse(format!("no field `{name}`; there are {}", names.join(", "))));
            };
            let element = steps.next_if(|step| !matches!(step, Step::Field(_)));
            match (slot.count, element) {
                (None, None) | (Some(_), Some(_)) => {}
                (Some(_), None) => {
                    return Err(refuse(format!("`{name}` is an array: say which, as `{name}[0]`")));
                }
                (None, Some(_)) => return Err(refuse(format!("`{name}` is no array"))),
            }
            shape = &slot.shape;
        }
        match shape {
            Shape::Primitive(_) => Ok(()),
            Shape::Message(index) if self.is_quaternion(*index) => Ok(()),
            Shape::String => Err(refuse("it is a text".to_owned())),
            Shape::Message(index) => {
                let names: Vec<&str> = self.slots(*index).iter().map(|slot| slot.name.as_str()).collect();
                Err(refuse(format!("it is a message; go on to one of {}", names.join(", "))))
            }
        }
    }

    fn collect(&self, index: usize, before: &str, found: &mut Vec<String>) {
        for slot in self.slots(index) {
            let element = if slot.count.is_some() { "[0]" } else { "" };
            let path = format!("{before}{}{element}", slot.name);
            match &slot.shape {
                Shape::Primitive(_) => found.push(path),
                Shape::Message(nested) => {
                    if self.is_quaternion(*nested) {
                        found.push(path.clone());
                    }
                    self.collect(*nested, &format!("{path}."), found);
                }
                Shape::String => {}
            }
        }
    }

    /// Adds a type and those in it; gives its place.
    fn add(
        &mut self,
        name: &str,
        texts: &mut BTreeMap<String, MessageSpecification>,
        depth: usize,
    ) -> Result<usize, String> {
        if let Some(place) = self.types.iter().position(|(known, _)| known == name) {
            // Its fields are not known yet: it is one of those that this one is in.
            return if self.slots(place).is_empty() {
                Err(format!("the type {name} holds itself"))
            } else {
                Ok(place)
            };
        }
        if depth > MOST_NESTED {
            return Err(format!("types nested deeper than {MOST_NESTED}"));
        }
        let spec = match texts.get(name) {
            Some(spec) => spec.clone(),
            None => standard(name).ok_or_else(|| format!("the type {name} in it is not described"))?,
        };
        let place = self.types.len();
        self.types.push((name.to_owned(), Vec::new()));
        let package = name.split('/').next().unwrap_or_default();
        let mut slots = Vec::with_capacity(spec.fields.len());
        for field in &spec.fields {
            let (element, count) = match &field.ty {
                Type::Array { ty, size: ArraySize::Fixed(fixed) } => (ty.as_ref(), Some(*fixed)),
                Type::Array { ty, size: _ } => (ty.as_ref(), Some(0)),
                one => (one, None),
            };
            let shape = match element {
                Type::BuiltIn(built_in) => primitive(built_in)?,
                Type::Complex(complex) => {
                    let full = match complex {
                        ComplexType::Absolute { package, name } => short(&format!("{package}/{name}")),
                        // Before ROS 2, and in texts that come from there, a header needs no package.
                        ComplexType::Relative { name } if name == "Header" && package != "std_msgs" => {
                            "std_msgs/Header".to_owned()
                        }
                        ComplexType::Relative { name } => format!("{package}/{name}"),
                    };
                    Shape::Message(self.add(&full, texts, depth + 1)?)
                }
                Type::Array { .. } => return Err(format!("`{}` is an array of arrays", field.name)),
            };
            slots.push(Slot { name: field.name.clone(), shape, count });
        }
        if slots.is_empty() {
            let shape = Shape::Primitive(Primitive::U8);
            slots.push(Slot { name: FILLER.to_owned(), shape, count: None });
        }
        self.types[place].1 = slots;
        if self.fields(place, 0) > MOST_FIELDS {
            return Err(format!("the type {name} has more than {MOST_FIELDS} fields"));
        }
        Ok(place)
    }

    /// `before` and the fields of a type; counts no further than too many.
    fn fields(&self, index: usize, before: usize) -> usize {
        let mut count = before;
        for slot in self.slots(index) {
            count = match slot.shape {
                _ if count > MOST_FIELDS => return count,
                Shape::Message(nested) => self.fields(nested, count),
                Shape::Primitive(_) | Shape::String => count + 1,
            };
        }
        count
    }
}

fn primitive(built_in: &BuiltInType) -> Result<Shape, String> {
    Ok(Shape::Primitive(match built_in {
        BuiltInType::Bool => Primitive::Bool,
        BuiltInType::Int8 => Primitive::I8,
        BuiltInType::Byte | BuiltInType::Char | BuiltInType::UInt8 => Primitive::U8,
        BuiltInType::Int16 => Primitive::I16,
        BuiltInType::UInt16 => Primitive::U16,
        BuiltInType::Int32 => Primitive::I32,
        BuiltInType::UInt32 => Primitive::U32,
        BuiltInType::Int64 => Primitive::I64,
        BuiltInType::UInt64 => Primitive::U64,
        BuiltInType::Float32 => Primitive::F32,
        BuiltInType::Float64 => Primitive::F64,
        BuiltInType::String(_) => return Ok(Shape::String),
        BuiltInType::WString(_) => return Err("it holds a wstring, which is not read".to_owned()),
    }))
}

/// `package/Type` of `package/msg/Type`.
fn short(name: &str) -> String {
    name.replacen("/msg/", "/", 1)
}

/// A type that the suite knows.
fn standard(name: &str) -> Option<MessageSpecification> {
    let (package, name) = name.split_once('/')?;
    let full = format!("{package}/msg/{name}");
    let text = gripsight_msgs::definition(&full)?;
    MessageSchema::parse(&full, text).ok().map(|schema| schema.spec)
}
