//! Which topic, and which field of its messages, is which signal: by a topics file, or by type.

mod known;
mod live;
mod mapped;
mod mapping;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use gripsight_msgs::standard::{ackermann_msgs::AckermannDriveStamped, nav_msgs::Odometry, sensor_msgs};
use gripsight_msgs::{Message, StateSequence};
use gripsight_signals::{Layout, Signal};
use serde::{Deserialize, Serialize};

pub(crate) use known::{Group, KNOWN_TYPES, fields_of};
pub use live::LiveStreams;
pub use mapped::MappedTopic;
pub(crate) use mapped::schema;
pub use mapping::Mapping;

use crate::storage::read_text;
use crate::{Bag, BagError, Topic};

/// A stream of telemetry with a message type of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Where the car is and how it moves: needed, where no file maps a speed or a pose.
    Odom,
    /// What was commanded: needed, where no file maps a steering.
    Drive,
    /// Inertial unit: optional.
    Imu,
    /// Wheel speeds and torques: optional.
    Wheels,
}

impl Role {
    /// All of them, in the order of [`gripsight_signals::Aligner::counts`].
    pub const ALL: [Self; 4] = [Self::Odom, Self::Drive, Self::Imu, Self::Wheels];

    /// Its name in topics files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Odom => "odom",
            Self::Drive => "drive",
            Self::Imu => "imu",
            Self::Wheels => "wheels",
        }
    }

    /// The type of its messages.
    #[must_use]
    pub fn type_name(self) -> &'static str {
        match self {
            Self::Odom => Odometry::TYPE,
            Self::Drive => AckermannDriveStamped::TYPE,
            Self::Imu => sensor_msgs::Imu::TYPE,
            Self::Wheels => sensor_msgs::JointState::TYPE,
        }
    }

    fn needed(self) -> bool {
        matches!(self, Self::Odom | Self::Drive)
    }

    /// Signals that stand for the stream where a file maps them one by one.
    fn replaced_by(self) -> &'static [Signal] {
        match self {
            Self::Odom => &[Signal::ForwardSpeed, Signal::X],
            Self::Drive => &[Signal::Steering, Signal::MeasuredSteering],
            Self::Imu => &[Signal::ForwardAcceleration, Signal::LateralAcceleration, Signal::Gyro],
            Self::Wheels => &Signal::WHEEL_SPEEDS,
        }
    }
}

/// Where streams and signals come from, as a topics file says.
///
/// A stream is a topic of the type that it needs (`odom: /car_state/odom`), or of another known type (Autoware's, a stamped twist); one without
/// an entry is found by its type, or as the only one of another known type, and an empty name leaves it out. A signal is any field of any message
/// (`steering: {topic: /commands/servo/position, field: data, gain: -1.2135, offset: 0.5304}`, see [`Mapping`]), and goes before the stream
/// that it belongs to. `pose: /tracked_pose` is short for its three signals; `pose: {topic: /tracked_pose, ahead_m: -0.16}` says that its point is not
/// the centre of gravity.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TopicMap {
    /// Odometry.
    pub odom: Option<String>,
    /// Drive command.
    pub drive: Option<String>,
    /// Inertial unit.
    pub imu: Option<String>,
    /// Wheels.
    pub wheels: Option<String>,
    /// Pose of a localisation of its own.
    pub pose: Option<String>,
    /// How far ahead of the centre of gravity its point lies.
    pub pose_ahead_m: f64,
    /// Road pictures.
    pub image: Option<String>,
    /// Road pictures, compressed.
    pub image_compressed: Option<String>,
    /// Recorded `StateSequence`s.
    pub sequence: Option<String>,
    /// Signals, field by field.
    pub signals: BTreeMap<Signal, Mapping>,
    /// Names of streams that a bag may lack, though the file names their topics.
    pub optional: BTreeSet<String>,
}

/// An entry of a topics file: a topic's name, or what a [`Mapping`] holds.
enum Entry {
    Topic(String),
    Field(Mapping),
}

impl<'de> Deserialize<'de> for Entry {
    /// By hand: a field called `y` must stay a name, and not become YAML's yes.
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> serde::de::Visitor<'de> for Visitor {
            type Value = Entry;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a topic's name, or {topic: /name, field: path, ...}")
            }

            fn visit_str<E: serde::de::Error>(self, topic: &str) -> Result<Entry, E> {
                Ok(Entry::Topic(topic.to_owned()))
            }

            fn visit_unit<E: serde::de::Error>(self) -> Result<Entry, E> {
                Ok(Entry::Topic(String::new()))
            }

            fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<Entry, A::Error> {
                Mapping::deserialize(serde::de::value::MapAccessDeserializer::new(map)).map(Entry::Field)
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

impl TopicMap {
    /// Reads a topics file.
    ///
    /// # Errors
    /// [`BagError::Io`], [`BagError::TopicsFile`].
    pub fn read(path: &Path) -> Result<Self, BagError> {
        let text = read_text(path).map_err(BagError::io(path))?;
        Self::parse(&text).map_err(|why| BagError::TopicsFile { path: path.to_owned(), why })
    }

    /// Reads the text of a topics file.
    ///
    /// # Errors
    /// What is wrong, with its place.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut map = Self::default();
        if text.lines().all(|line| line.split('#').next().is_none_or(|code| code.trim().is_empty())) {
            return Ok(map);
        }
        let entries: BTreeMap<String, Entry> = serde_saphyr::from_str(text).map_err(|e| e.to_string())?;
        for (name, entry) in entries {
            match entry {
                Entry::Topic(topic) => map.name(&name, topic)?,
                // A stream may be said to be optional, and nothing else of it.
                Entry::Field(mapping) if Signal::of(&name).is_none() => {
                    let Mapping { optional, ahead_m, .. } = mapping;
                    let plain = Mapping { optional, ahead_m, ..Mapping::of_topic(&mapping.topic) };
                    if mapping != plain || ahead_m != 0.0 && name != "pose" {
                        return Err(format!(
                            "`{name}` is a stream: it takes `topic` and `optional` (a pose `ahead_m`, too), or its signals stand one by one"
                        ));
                    }
                    map.pose_ahead_m += ahead_m;
                    if mapping.optional {
                        map.optional.insert(name.clone());
                    }
                    map.name(&name, mapping.topic)?;
                }
                Entry::Field(mapping) => {
                    let signal = Signal::of(&name).ok_or_else(|| unknown(&name))?;
                    map.signals.insert(signal, mapping);
                }
            }
        }
        Ok(map)
    }

    /// Takes `name: /topic`.
    fn name(&mut self, name: &str, topic: String) -> Result<(), String> {
        let slot = match name {
            "odom" => &mut self.odom,
            "drive" => &mut self.drive,
            "imu" => &mut self.imu,
            "wheels" => &mut self.wheels,
            "pose" => &mut self.pose,
            "image" => &mut self.image,
            "image/compressed" => &mut self.image_compressed,
            "sequence" => &mut self.sequence,
            _ => {
                let signal = Signal::of(name).ok_or_else(|| unknown(name))?;
                self.signals.insert(signal, Mapping::of_topic(&topic));
                return Ok(());
            }
        };
        *slot = Some(topic);
        Ok(())
    }

    fn of(&self, role: Role) -> Option<&str> {
        match role {
            Role::Odom => &self.odom,
            Role::Drive => &self.drive,
            Role::Imu => &self.imu,
            Role::Wheels => &self.wheels,
        }
        .as_deref()
    }

    /// Finds the streams in a bag: topics of the streams' own types, and those that are read field by field.
    ///
    /// # Errors
    /// [`BagError::MissingTopic`], [`BagError::AmbiguousTopic`], [`BagError::WrongType`], [`BagError::Encoding`],
    /// [`BagError::Mapping`].
    pub fn resolve(&self, bag: &Bag) -> Result<Streams, BagError> {
        self.without_missing(bag).resolve_all(bag)
    }

    /// Without what is optional and not in the bag.
    fn without_missing(&self, bag: &Bag) -> Self {
        let has = |name: &str| bag.topics().iter().any(|topic| topic.name == name);
        let mut map = self.clone();
        map.signals.retain(|_, mapping| !mapping.optional || has(&mapping.topic));
        for (name, topic) in [
            ("odom", &mut map.odom),
            ("drive", &mut map.drive),
            ("imu", &mut map.imu),
            ("wheels", &mut map.wheels),
            ("pose", &mut map.pose),
        ] {
            if self.optional.contains(name) && !topic.as_deref().is_some_and(has) {
                *topic = None;
            }
        }
        map
    }

    fn resolve_all(&self, bag: &Bag) -> Result<Streams, BagError> {
        let mut signals = BTreeMap::new();
        let mut names = [const { None }; 4];
        for (name, role) in names.iter_mut().zip(Role::ALL) {
            let mapped = |signal: &Signal| self.signals.get(signal).is_some_and(|m| !m.topic.is_empty());
            let located = role == Role::Odom && self.pose.as_ref().is_some_and(|pose| !pose.is_empty());
            *name = match self.of(role) {
                // What a file maps stands for the stream; it is not looked for beside it.
                None if role.replaced_by().iter().any(mapped) => None,
                // A localisation alone may do; odometry beside it is taken.
                None if located => find(bag, None, role, false, self.pose.as_deref())?,
                Some(topic) if !topic.is_empty() && expand(bag, role, topic, &mut signals) => None,
                None if of_another_type(bag, role).is_some_and(|t| expand(bag, role, t, &mut signals)) => {
                    None
                }
                wanted => find(bag, wanted, role, role.needed(), None)?,
            };
        }
        if let Some(topic) = self.pose.as_deref().filter(|topic| !topic.is_empty()) {
            let mapping = Mapping { ahead_m: self.pose_ahead_m, ..Mapping::of_topic(topic) };
            signals.extend(Signal::POSE.map(|signal| (signal, mapping.clone())));
        }
        signals.extend(self.signals.clone());
        let mapped = mapped::gather(mapped::Topics { path: bag.path(), topics: bag.topics() }, &signals)?;
        let mut layout = Layout::default();
        for role in Role::ALL.into_iter().filter(|&role| names[role as usize].is_none()) {
            layout.forget(role as usize);
        }
        for (place, topic) in mapped.iter().enumerate() {
            layout.map(place, &topic.signals.iter().map(|(signal, _)| *signal).collect::<Vec<_>>());
        }
        signals
            .iter()
            .filter(|(_, m)| m.topic.is_empty())
            .for_each(|(&signal, _)| layout.forget_signal(signal));
        Ok(Streams { names, mapped, layout: Some(layout) })
    }

    /// Finds the topic of recorded `StateSequence`s; `None` where there is none.
    ///
    /// # Errors
    /// As [`TopicMap::resolve`].
    pub fn resolve_sequence(&self, bag: &Bag) -> Result<Option<String>, BagError> {
        find_type(bag, self.sequence.as_deref(), ("sequence", StateSequence::TYPE), false, None)
    }
}

fn unknown(name: &str) -> String {
    let signals: Vec<&str> = Signal::ALL.iter().map(|signal| signal.name()).collect();
    format!(
        "`{name}` is no name here; streams are odom, drive, imu, wheels, pose, image, image/compressed, sequence, and signals {}",
        signals.join(", ")
    )
}

/// Takes the signals of a topic of another known type than the stream's own; `false` where it is of the stream's own, or not known.
fn expand(bag: &Bag, role: Role, topic: &str, signals: &mut BTreeMap<Signal, Mapping>) -> bool {
    let Some(found) = bag.topics().iter().find(|t| t.name == topic) else { return false };
    let group = group_of(role);
    if found.type_name == role.type_name() {
        return false;
    }
    let fields = fields_of(&found.type_name, group);
    signals.extend(fields.iter().map(|&(signal, _)| (signal, Mapping::of_topic(topic))));
    !fields.is_empty()
}

fn group_of(role: Role) -> Group {
    match role {
        Role::Odom => Group::Motion,
        Role::Drive => Group::Command,
        Role::Imu => Group::Imu,
        Role::Wheels => Group::Wheels,
    }
}

/// The topic that a needed stream is taken from where a bag has none of the stream's own type, and one of another known one.
fn of_another_type(bag: &Bag, role: Role) -> Option<&str> {
    if !role.needed() || bag.topics().iter().any(|t| recorded(t, role.type_name())) {
        return None;
    }
    let is_known =
        |t: &&Topic| !t.name.starts_with(OWN_PREFIX) && !fields_of(&t.type_name, group_of(role)).is_empty();
    let mut known = bag.topics().iter().filter(is_known);
    match (known.next(), known.next()) {
        (Some(only), None) => Some(&only.name),
        _ => None,
    }
}

/// The topics that a bag's streams were found under.
#[derive(Debug, Clone, Default)]
pub struct Streams {
    names: [Option<String>; 4],
    mapped: Vec<MappedTopic>,
    layout: Option<Layout>,
}

impl PartialEq for Streams {
    fn eq(&self, other: &Self) -> bool {
        let topics =
            |s: &Self| s.mapped.iter().map(|m| (m.topic.clone(), m.signals.clone())).collect::<Vec<_>>();
        (&self.names, topics(self), &self.layout) == (&other.names, topics(other), &other.layout)
    }
}

impl Streams {
    /// The topic of a stream; `None` where an optional stream is not recorded, or its signals are read field by field.
    #[must_use]
    pub fn topic(&self, role: Role) -> Option<&str> {
        self.names[role as usize].as_deref()
    }

    /// The stream of a topic.
    #[must_use]
    pub fn role(&self, topic: &str) -> Option<Role> {
        Role::ALL.into_iter().find(|&role| self.topic(role) == Some(topic))
    }

    /// The topics that are read field by field.
    #[must_use]
    pub fn mapped(&self) -> &[MappedTopic] {
        &self.mapped
    }

    /// Which stream carries which signal.
    #[must_use]
    pub fn layout(&self) -> Layout {
        self.layout.clone().unwrap_or_default()
    }
}

impl Serialize for Streams {
    /// As a map from the stream's or signal's name to its topic, and field.
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let streams = Role::ALL.into_iter().map(|role| (role.name(), self.topic(role).map(str::to_owned)));
        let signals = self.mapped.iter().flat_map(|m| {
            m.signals.iter().map(|(signal, field)| (signal.name(), Some(format!("{}: {field}", m.topic))))
        });
        serializer.collect_map(streams.chain(signals))
    }
}

/// Writes one value for each stream as a map from the stream's name.
pub(crate) fn by_role<T: Serialize, S: serde::Serializer>(
    values: &[T; 4],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(Role::ALL.into_iter().map(Role::name).zip(values))
}

/// What gripsight wrote into a bag itself (`diagnose --predictions`): never taken for a recording unless it is asked for by name.
const OWN_PREFIX: &str = "/gripsight/";

fn recorded(topic: &Topic, type_name: &str) -> bool {
    topic.type_name == type_name && !topic.name.starts_with(OWN_PREFIX)
}

fn find(
    bag: &Bag,
    wanted: Option<&str>,
    role: Role,
    needed: bool,
    except: Option<&str>,
) -> Result<Option<String>, BagError> {
    find_type(bag, wanted, (role.name(), role.type_name()), needed, except)
}

fn find_type(
    bag: &Bag,
    wanted: Option<&str>,
    (role, type_name): (&'static str, &'static str),
    needed: bool,
    except: Option<&str>,
) -> Result<Option<String>, BagError> {
    let path = || bag.path().to_owned();
    let missing = |wanted: &str| BagError::MissingTopic {
        path: path(),
        role,
        wanted: wanted.to_owned(),
        found: list(bag.topics()),
    };
    let topic = match wanted {
        Some("") if !needed => return Ok(None),
        Some(name) => bag.topics().iter().find(|t| t.name == name).ok_or_else(|| missing(name))?,
        None => {
            let others = |t: &&Topic| recorded(t, type_name) && Some(t.name.as_str()) != except;
            let mut of_type = bag.topics().iter().filter(others);
            match (of_type.next(), of_type.next()) {
                (Some(only), None) => only,
                (None, _) if needed => return Err(missing(&format!("type {type_name}"))),
                (None, _) => return Ok(None),
                (Some(first), Some(second)) => {
                    let candidates =
                        [first, second].into_iter().chain(of_type).map(|t| t.name.clone()).collect();
                    return Err(BagError::AmbiguousTopic { path: path(), role, type_name, candidates });
                }
            }
        }
    };
    if topic.type_name != type_name {
        let got = topic.type_name.clone();
        return Err(BagError::WrongType {
            path: path(),
            topic: topic.name.clone(),
            role,
            expected: type_name,
            got,
        });
    }
    if topic.encoding != "cdr" {
        let encoding = topic.encoding.clone();
        return Err(BagError::Encoding { path: path(), topic: topic.name.clone(), encoding });
    }
    Ok(Some(topic.name.clone()))
}

pub(crate) fn list(topics: &[Topic]) -> String {
    if topics.is_empty() {
        return "no topic".to_owned();
    }
    topics.iter().map(|t| format!("{} ({})", t.name, t.type_name)).collect::<Vec<_>>().join(", ")
}
