//! What each topic's numbers are like.

use std::collections::BTreeMap;

use gripsight_signals::{Pace, Signal};

use crate::dynamic::{FieldPath, Reader};
use crate::topics::{Group, fields_of, schema};
use crate::{Bag, BagError, decode, from_cdr};
use gripsight_msgs::standard::sensor_msgs::JointState;

/// Messages looked at of each topic.
const MOST_MESSAGES: usize = 4000;
/// Fields looked at of a type that is not known.
const MOST_FIELDS: usize = 400;

/// A number of a topic's messages.
#[derive(Debug, Clone)]
pub(super) struct Number {
    pub(super) path: String,
    pub(super) low: f64,
    pub(super) high: f64,
    median: f64,
}

impl Number {
    /// Whether it changes.
    pub(super) fn moves(&self) -> bool {
        self.high > self.low
    }
}

/// A known field of a topic.
#[derive(Debug, Clone)]
pub(super) struct KnownField {
    pub(super) signal: Signal,
    pub(super) path: &'static str,
}

/// What a topic's messages are like.
#[derive(Debug, Clone)]
pub(super) struct Survey {
    pub(super) name: String,
    pub(super) type_name: String,
    pub(super) messages: usize,
    pub(super) rate_hz: f64,
    pub(super) numbers: Vec<Number>,
    /// Whether it has a header that nobody stamps.
    pub(super) unstamped: bool,
    /// Joints that are the four wheels.
    pub(super) is_wheels: bool,
    /// Middle of what an inertial unit reads upward.
    pub(super) upward: Option<f64>,
}

impl Survey {
    pub(super) fn number(&self, path: &str) -> Option<&Number> {
        self.numbers.iter().find(|n| n.path == path)
    }

    pub(super) fn fields(&self, group: Group) -> Vec<KnownField> {
        fields_of(&self.type_name, group)
            .iter()
            .filter(|(_, path)| self.number(path).is_some_and(|n| n.moves() || n.high != 0.0))
            .map(|&(signal, path)| KnownField { signal, path })
            .collect()
    }

    /// How many of a group's signals change.
    pub(super) fn moving(&self, group: Group) -> usize {
        let moves = |path: &str| self.number(path).is_some_and(Number::moves);
        fields_of(&self.type_name, group).iter().filter(|(_, path)| moves(path)).count()
    }

    pub(super) fn moves(&self, signal: Signal) -> bool {
        [Group::Motion, Group::Pose]
            .into_iter()
            .flat_map(|group| fields_of(&self.type_name, group))
            .any(|(s, path)| *s == signal && self.number(path).is_some_and(Number::moves))
    }

    pub(super) fn has_pose(&self) -> bool {
        self.moving(Group::Pose) >= 2
    }
}

struct Open {
    reader: Reader,
    paths: Vec<String>,
    columns: Vec<Vec<f64>>,
    log_times_ns: Vec<u64>,
    wheels: bool,
}

/// Looks through a bag once.
pub(super) fn survey(bag: &Bag) -> Result<Vec<Survey>, BagError> {
    let mut open: BTreeMap<String, Open> = BTreeMap::new();
    for topic in bag.topics().iter().filter(|t| t.encoding == "cdr" && !t.name.starts_with("/gripsight/")) {
        let Ok(layout) = schema(topic) else { continue };
        let mut paths = layout.numbers();
        paths.truncate(MOST_FIELDS);
        let parsed: Result<Vec<FieldPath>, _> = paths.iter().map(|p| p.parse()).collect();
        if let Ok(Ok(reader)) = parsed.map(|parsed| Reader::new(layout, parsed)) {
            let columns = vec![Vec::new(); paths.len()];
            open.insert(
                topic.name.clone(),
                Open { reader, paths, columns, log_times_ns: Vec::new(), wheels: false },
            );
        }
    }
    for message in bag.messages() {
        let message = match message {
            Ok(message) => message,
            Err(BagError::Truncated { .. }) => break,
            Err(error) => return Err(error),
        };
        let Some(topic) = open.get_mut(&message.channel.topic) else { continue };
        topic.log_times_ns.push(message.log_time);
        if topic.log_times_ns.len() > MOST_MESSAGES {
            continue;
        }
        if message.channel.schema.as_ref().is_some_and(|s| s.name == "sensor_msgs/msg/JointState") {
            topic.wheels |= from_cdr::<JointState>(&message.data)
                .and_then(|m| decode::wheels(&m))
                .is_ok_and(|sample| sample.is_some());
        }
        let Ok(values) = topic.reader.read(&message.data) else { continue };
        topic.columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
    }
    let types: BTreeMap<&str, &str> =
        bag.topics().iter().map(|t| (t.name.as_str(), t.type_name.as_str())).collect();
    Ok(open
        .into_iter()
        .filter(|(_, topic)| !topic.log_times_ns.is_empty())
        .map(|(name, topic)| {
            let type_name = types.get(name.as_str()).copied().unwrap_or_default().to_owned();
            concluded(name, type_name, topic)
        })
        .collect())
}

fn concluded(name: String, type_name: String, topic: Open) -> Survey {
    let Open { paths, columns, log_times_ns, wheels, .. } = topic;
    let pace = Pace::of(log_times_ns.windows(2).map(|w| w[1].saturating_sub(w[0]) as f64 * 1e-9));
    let numbers: Vec<Number> = paths
        .into_iter()
        .zip(columns)
        .filter_map(|(path, mut values)| {
            values.retain(|v| v.is_finite());
            values.sort_unstable_by(f64::total_cmp);
            let median = *values.get(values.len() / 2)?;
            Some(Number { path, low: values[0], high: values[values.len() - 1], median })
        })
        .collect();
    let stamp = numbers.iter().find(|n| n.path == "header.stamp.sec" || n.path == "stamp.sec");
    let unstamped = stamp.is_some_and(|n| n.high == 0.0)
        && numbers.iter().any(|n| n.path.ends_with("stamp.nanosec") && n.high == 0.0);
    let upward = numbers.iter().find(|n| n.path == "linear_acceleration.z").map(|n| n.median);
    Survey {
        name,
        type_name,
        messages: log_times_ns.len(),
        rate_hz: pace.rate_hz,
        numbers,
        unstamped,
        is_wheels: wheels,
        upward,
    }
}
