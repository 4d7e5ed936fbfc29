//! The topics that a file maps field by field, ready to be read.

use std::collections::BTreeMap;
use std::path::Path;

use gripsight_signals::{MappedSample, Measurement, Signal, Values};

use super::known::field_of;
use super::mapping::Mapping;
use crate::dynamic::{FieldPath, Reader, Schema};
use crate::{BagError, Topic};

/// Where a message's stamp stands.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
enum Stamp {
    Log,
    /// Paths to seconds and nanoseconds stand behind those of the signals.
    Field(String),
}

/// A topic, and what is taken from its messages.
#[derive(Debug, Clone)]
pub struct MappedTopic {
    /// Its name.
    pub topic: String,
    /// The type of its messages.
    pub type_name: String,
    /// The signals taken from it, with the fields.
    pub signals: Vec<(Signal, String)>,
    place: u8,
    reader: Reader,
    /// Factor and offset of each signal.
    scales: Vec<(f64, f64)>,
    stamped: bool,
    /// How far ahead of the centre of gravity the point of the pose lies.
    ahead_m: f64,
}

impl MappedTopic {
    /// What a message says.
    ///
    /// # Errors
    /// [`BagError`] where its bytes are not of the type.
    pub fn measurement(&self, cdr: &[u8], log_time_ns: u64) -> Result<Measurement, BagError> {
        let numbers = self.reader.read(cdr)?;
        let mut values = Values::default();
        for ((&(signal, _), &(factor, offset)), &number) in
            self.signals.iter().zip(&self.scales).zip(&numbers)
        {
            // What is no number in the message must not pass for a signal that it does not carry.
            let number = if number.is_nan() { f64::INFINITY } else { number };
            values.set(signal, factor * (number - offset));
        }
        if self.ahead_m != 0.0 {
            let [x_m, y_m, heading_rad] = Signal::POSE.map(|signal| values.get(signal));
            let (sin, cos) = heading_rad.sin_cos();
            values.set(Signal::X, x_m - self.ahead_m * cos);
            values.set(Signal::Y, y_m - self.ahead_m * sin);
        }
        let stamp_ns = match numbers[self.signals.len()..] {
            // A header that nobody has stamped holds zero.
            [sec, nanosec] if self.stamped && (sec, nanosec) != (0.0, 0.0) => {
                (sec as i64).saturating_mul(1_000_000_000).saturating_add(nanosec as i64)
            }
            _ => log_time_ns.cast_signed(),
        };
        Ok(Measurement::Mapped(MappedSample { topic: self.place, stamp_ns, values }))
    }
}

/// The topics there are, and where.
#[derive(Clone, Copy)]
pub(super) struct Topics<'a> {
    pub(super) path: &'a Path,
    pub(super) topics: &'a [Topic],
}

/// Gathers what a file maps by topic and stamp.
pub(super) fn gather(
    bag: Topics<'_>,
    signals: &BTreeMap<Signal, Mapping>,
) -> Result<Vec<MappedTopic>, BagError> {
    let mut groups: BTreeMap<(String, Stamp), Vec<(Signal, &Mapping)>> = BTreeMap::new();
    for (&signal, mapping) in signals.iter().filter(|(_, mapping)| !mapping.topic.is_empty()) {
        let topic = find(bag, signal, &mapping.topic)?;
        let stamp = stamp(bag, signal, topic, mapping.stamp.as_deref())?;
        groups.entry((mapping.topic.clone(), stamp)).or_default().push((signal, mapping));
    }
    groups
        .into_iter()
        .enumerate()
        .map(|(place, ((name, stamp), signals))| mapped(bag, place as u8, &name, &stamp, &signals))
        .collect()
}

fn find<'a>(bag: Topics<'a>, signal: Signal, name: &str) -> Result<&'a Topic, BagError> {
    bag.topics.iter().find(|topic| topic.name == name).ok_or_else(|| BagError::MissingTopic {
        path: bag.path.to_owned(),
        role: signal.name(),
        wanted: name.to_owned(),
        found: super::list(bag.topics),
    })
}

fn refuse(bag: Topics<'_>, signal: Signal, why: String) -> BagError {
    BagError::Mapping { path: bag.path.to_owned(), signal: signal.name(), why }
}

/// The layout of a topic's messages.
pub(crate) fn schema(topic: &Topic) -> Result<Schema, BagError> {
    let missing = |why: &str| BagError::Layout { type_name: topic.type_name.clone(), why: why.to_owned() };
    if topic.schema.trim().is_empty() {
        return Err(missing(
            "the bag does not say what is in it; lay its .msg file beside the bag (package/msg/Type.msg)",
        ));
    }
    if topic.schema_encoding != "ros2msg" {
        return Err(missing(
            "the bag describes it in IDL; lay its .msg file beside the bag (package/msg/Type.msg)",
        ));
    }
    Schema::parse(&topic.type_name, &topic.schema)
}

/// Where the stamp is to be taken from.
fn stamp(bag: Topics<'_>, signal: Signal, topic: &Topic, wanted: Option<&str>) -> Result<Stamp, BagError> {
    let numbers = schema(topic).map_err(|e| refuse(bag, signal, e.to_string()))?.numbers();
    let has = |field: &str| numbers.iter().any(|n| *n == format!("{field}.sec"));
    match wanted {
        Some("log") => Ok(Stamp::Log),
        Some("header") if has("header.stamp") => Ok(Stamp::Field("header.stamp".to_owned())),
        Some(field) if has(field) => Ok(Stamp::Field(field.to_owned())),
        Some(field) => {
            Err(refuse(bag, signal, format!("stamp: {} has no `{field}` that is a time", topic.type_name)))
        }
        None => Ok(["header.stamp", "stamp"]
            .into_iter()
            .find(|field| has(field))
            .map_or(Stamp::Log, |field| Stamp::Field(field.to_owned()))),
    }
}

fn mapped(
    bag: Topics<'_>,
    place: u8,
    name: &str,
    stamp: &Stamp,
    signals: &[(Signal, &Mapping)],
) -> Result<MappedTopic, BagError> {
    let first = signals[0].0;
    let topic = find(bag, first, name)?;
    if topic.encoding != "cdr" {
        let encoding = topic.encoding.clone();
        return Err(BagError::Encoding { path: bag.path.to_owned(), topic: name.to_owned(), encoding });
    }
    let mut paths = Vec::new();
    let mut scales = Vec::new();
    let mut fields = Vec::new();
    for &(signal, mapping) in signals {
        let field = match mapping.field.as_str() {
            "" => field_of(&topic.type_name, signal).ok_or_else(|| {
                refuse(bag, signal, format!("say which field of {} ({name}) it is", topic.type_name))
            })?,
            field => field,
        };
        paths.push(
            field
                .parse::<FieldPath>()
                .map_err(|why| refuse(bag, signal, format!("field `{field}`: {why}")))?,
        );
        scales.push(mapping.scale(signal).map_err(|why| refuse(bag, signal, why))?);
        fields.push((signal, field.to_owned()));
    }
    let ahead_m = signals.iter().map(|(_, mapping)| mapping.ahead_m).find(|a| *a != 0.0).unwrap_or(0.0);
    if ahead_m != 0.0 && !Signal::POSE.iter().all(|pose| fields.iter().any(|(signal, _)| signal == pose)) {
        return Err(refuse(bag, first, "ahead_m needs x, y and heading in one message".to_owned()));
    }
    let stamped = match stamp {
        Stamp::Log => false,
        Stamp::Field(field) => {
            paths.extend(
                [".sec", ".nanosec"].into_iter().filter_map(|end| format!("{field}{end}").parse().ok()),
            );
            true
        }
    };
    let reader = schema(topic)
        .and_then(|schema| Reader::new(schema, paths))
        .map_err(|e| refuse(bag, first, e.to_string()))?;
    let type_name = topic.type_name.clone();
    Ok(MappedTopic {
        topic: name.to_owned(),
        type_name,
        signals: fields,
        place,
        reader,
        scales,
        stamped,
        ahead_m,
    })
}
