//! Any field of any message, by the schema that the bag carries.
//!
//! A schema is read once; a [`Reader`] then walks through each message's CDR bytes and picks the numbers asked for. No length in
//! the bytes is trusted: an array is walked element by element, and the walk ends where the bytes end.

mod path;
mod schema;

use byteorder::{BigEndian, ByteOrder, LittleEndian};
use re_cdr::CdrReader;

pub use path::FieldPath;
use path::Step;
pub use schema::Schema;
use schema::{Primitive, Shape, Slot};

use crate::BagError;

/// Picks fields out of messages of one type.
#[derive(Debug, Clone)]
pub struct Reader {
    schema: Schema,
    paths: Vec<FieldPath>,
}

/// A field that is still looked for: the rest of its path, and its place in the answer.
type Wanted<'a> = (&'a [Step], usize);

impl Reader {
    /// Checks that each path leads to a number (or a quaternion, read as the heading in it).
    ///
    /// # Errors
    /// [`BagError::Field`] with what stands at the place where a path fails.
    pub fn new(schema: Schema, paths: Vec<FieldPath>) -> Result<Self, BagError> {
        for path in &paths {
            schema.check(path)?;
        }
        Ok(Self { schema, paths })
    }

    /// The values of the paths, in their order; NaN where an array is too short or has no element of that name.
    ///
    /// # Errors
    /// [`BagError`] where the bytes are not of the type.
    pub fn read(&self, cdr: &[u8]) -> Result<Vec<f64>, BagError> {
        let Some((&[id_high, id_low, ..], body)) = cdr.split_first_chunk::<4>() else {
            return Err(BagError::NoEncapsulation { len: cdr.len() });
        };
        let wanted: Vec<Wanted<'_>> =
            self.paths.iter().enumerate().map(|(place, path)| (path.steps(), place)).collect();
        let mut found = vec![f64::NAN; self.paths.len()];
        let walked = match u16::from_be_bytes([id_high, id_low]) {
            0 => Walk::<BigEndian>::new(&self.schema, body, &mut found).message(self.schema.root(), &wanted),
            1 => {
                Walk::<LittleEndian>::new(&self.schema, body, &mut found).message(self.schema.root(), &wanted)
            }
            identifier => return Err(BagError::Encapsulation { identifier }),
        };
        let failed = |error: re_cdr::Error| BagError::DynamicBody {
            type_name: self.schema.type_name().to_owned(),
            len: cdr.len(),
            why: error.to_string(),
        };
        walked.map(|()| found).map_err(failed)
    }
}

struct Walk<'a, O> {
    schema: &'a Schema,
    bytes: CdrReader<'a, O>,
    found: &'a mut [f64],
}

impl<'a, O: ByteOrder> Walk<'a, O> {
    fn new(schema: &'a Schema, body: &'a [u8], found: &'a mut [f64]) -> Self {
        Self { schema, bytes: CdrReader::new(body), found }
    }

    /// Walks through a message as far as the last field wanted; through all of it where something follows it.
    fn message(&mut self, index: usize, wanted: &[Wanted<'_>]) -> Result<(), re_cdr::Error> {
        let schema = self.schema;
        // Elements may be asked for by the names that stand in an array beside them.
        let mut names: Vec<&str> = Vec::new();
        for slot in schema.slots(index) {
            let mine: Vec<Wanted<'_>> = wanted
                .iter()
                .filter(|(steps, _)| matches!(steps.first(), Some(Step::Field(name)) if *name == slot.name))
                .map(|&(steps, place)| (&steps[1..], place))
                .collect();
            self.slot(slot, &mine, &mut names)?;
        }
        Ok(())
    }

    fn slot(
        &mut self,
        slot: &Slot,
        wanted: &[Wanted<'_>],
        names: &mut Vec<&'a str>,
    ) -> Result<(), re_cdr::Error> {
        let count = match slot.count {
            None => return self.element(&slot.shape, wanted),
            Some(0) => self.bytes.read_sequence_length()?,
            Some(fixed) => fixed,
        };
        let is_names = slot.name == "name" && slot.shape == Shape::String;
        if let (Shape::Primitive(primitive), true) = (&slot.shape, wanted.is_empty()) {
            // Pictures and scans: their bytes are passed over at once.
            if count > 0 {
                self.bytes.align(primitive.size())?;
                let len = count.checked_mul(primitive.size()).ok_or(re_cdr::Error::UnexpectedEof)?;
                self.bytes.read_bytes(len)?;
            }
            return Ok(());
        }
        for element in 0..count {
            if is_names {
                names.push(self.bytes.read_str()?);
                continue;
            }
            let here = |step: &Step| match step {
                Step::Index(index) => *index == element,
                Step::Named(name) => names.get(element).is_some_and(|n| n == name),
                Step::Field(_) => false,
            };
            let mine: Vec<Wanted<'_>> = wanted
                .iter()
                .filter(|(steps, _)| steps.first().is_some_and(here))
                .map(|&(steps, place)| (&steps[1..], place))
                .collect();
            self.element(&slot.shape, &mine)?;
        }
        Ok(())
    }

    fn element(&mut self, shape: &Shape, wanted: &[Wanted<'_>]) -> Result<(), re_cdr::Error> {
        match shape {
            Shape::Primitive(primitive) => {
                let value = self.primitive(*primitive)?;
                wanted.iter().for_each(|&(_, place)| self.found[place] = value);
            }
            Shape::String => {
                self.bytes.read_str()?;
            }
            Shape::Message(index) if wanted.iter().any(|(steps, _)| steps.is_empty()) => {
                // The only message that is a number: a quaternion, whose heading is meant.
                debug_assert!(self.schema.is_quaternion(*index));
                let [x, y, z, w] = [0; 4].map(|_| self.primitive(Primitive::F64));
                let yaw_rad = crate::decode::yaw_rad(&quaternion(x?, y?, z?, w?));
                wanted.iter().for_each(|&(_, place)| self.found[place] = yaw_rad);
            }
            Shape::Message(index) => self.message(*index, wanted)?,
        }
        Ok(())
    }

    fn primitive(&mut self, primitive: Primitive) -> Result<f64, re_cdr::Error> {
        Ok(match primitive {
            // Any byte but zero is true; a strict reader would refuse 2.
            Primitive::Bool => f64::from(u8::from(self.bytes.read_u8()? != 0)),
            Primitive::I8 => self.bytes.read_i8()?.into(),
            Primitive::U8 => self.bytes.read_u8()?.into(),
            Primitive::I16 => self.bytes.read_i16()?.into(),
            Primitive::U16 => self.bytes.read_u16()?.into(),
            Primitive::I32 => self.bytes.read_i32()?.into(),
            Primitive::U32 => self.bytes.read_u32()?.into(),
            Primitive::I64 => self.bytes.read_i64()? as f64,
            Primitive::U64 => self.bytes.read_u64()? as f64,
            Primitive::F32 => self.bytes.read_f32()?.into(),
            Primitive::F64 => self.bytes.read_f64()?,
        })
    }
}

fn quaternion(x: f64, y: f64, z: f64, w: f64) -> gripsight_msgs::standard::geometry_msgs::Quaternion {
    gripsight_msgs::standard::geometry_msgs::Quaternion { x, y, z, w }
}
