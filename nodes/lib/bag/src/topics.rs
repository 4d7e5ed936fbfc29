//! Which topic is which stream: by a topics file, or by type.

use std::path::Path;

use gripsight_msgs::standard::{ackermann_msgs::AckermannDriveStamped, nav_msgs::Odometry, sensor_msgs};
use gripsight_msgs::{Message, StateSequence};
use serde::{Deserialize, Serialize};

use crate::{Bag, BagError, Topic};

/// A stream of telemetry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Where the car is and how it moves: needed.
    Odom,
    /// What was commanded: needed.
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
}

/// Names of topics, as a topics file gives them (`odom: /car_state/odom`). A stream without an entry is found by its type; an
/// empty name leaves an optional stream out.
#[derive(Debug, Clone, PartialEq, Eq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TopicMap {
    /// Odometry.
    pub odom: Option<String>,
    /// Drive command.
    pub drive: Option<String>,
    /// Inertial unit.
    pub imu: Option<String>,
    /// Wheels.
    pub wheels: Option<String>,
    /// Recorded `StateSequence`s.
    pub sequence: Option<String>,
    /// Raw pictures, for the launchers; the command line finds them by their type.
    pub image: Option<String>,
    /// Compressed pictures, likewise.
    #[serde(rename = "image/compressed")]
    pub image_compressed: Option<String>,
}

impl TopicMap {
    /// Reads a topics file.
    ///
    /// # Errors
    /// [`BagError::Io`], [`BagError::TopicsFile`].
    pub fn read(path: &Path) -> Result<Self, BagError> {
        let text = std::fs::read_to_string(path).map_err(BagError::io(path))?;
        serde_saphyr::from_str(&text)
            .map_err(|e| BagError::TopicsFile { path: path.to_owned(), why: e.to_string() })
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

    /// Finds the streams in a bag: the topic's name for each role.
    ///
    /// # Errors
    /// [`BagError::MissingTopic`], [`BagError::AmbiguousTopic`], [`BagError::WrongType`], [`BagError::Encoding`].
    pub fn resolve(&self, bag: &Bag) -> Result<Streams, BagError> {
        let mut names = [const { None }; 4];
        for (name, role) in names.iter_mut().zip(Role::ALL) {
            *name = find(bag, self.of(role), role.name(), role.type_name(), role.needed())?;
        }
        Ok(Streams { names })
    }

    /// Finds the topic of recorded `StateSequence`s; `None` where there is none.
    ///
    /// # Errors
    /// As [`TopicMap::resolve`].
    pub fn resolve_sequence(&self, bag: &Bag) -> Result<Option<String>, BagError> {
        find(bag, self.sequence.as_deref(), "sequence", StateSequence::TYPE, false)
    }
}

/// The topics that a bag's streams were found under.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Streams {
    names: [Option<String>; 4],
}

impl Streams {
    /// The topic of a stream; `None` where an optional stream is not recorded.
    #[must_use]
    pub fn topic(&self, role: Role) -> Option<&str> {
        self.names[role as usize].as_deref()
    }

    /// The stream of a topic.
    #[must_use]
    pub fn role(&self, topic: &str) -> Option<Role> {
        Role::ALL.into_iter().find(|&role| self.topic(role) == Some(topic))
    }
}

impl Serialize for Streams {
    /// As a map from the stream's name to its topic.
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        by_role(&self.names, serializer)
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

fn find(
    bag: &Bag,
    wanted: Option<&str>,
    role: &'static str,
    type_name: &'static str,
    needed: bool,
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
            let recorded = |t: &&Topic| t.type_name == type_name && !t.name.starts_with(OWN_PREFIX);
            let mut of_type = bag.topics().iter().filter(recorded);
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

fn list(topics: &[Topic]) -> String {
    if topics.is_empty() {
        return "no topic".to_owned();
    }
    topics.iter().map(|t| format!("{} ({})", t.name, t.type_name)).collect::<Vec<_>>().join(", ")
}
