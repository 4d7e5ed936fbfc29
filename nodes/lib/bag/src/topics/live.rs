//! A topics file where there is no bag to ask for types: those that the suite knows, told by the fields.

use std::collections::BTreeMap;
use std::path::Path;

use gripsight_msgs::Message;
use gripsight_msgs::standard::{ackermann_msgs::AckermannDriveStamped, nav_msgs::Odometry, sensor_msgs};
use gripsight_signals::{Layout, Signal};

use super::mapped::{MappedTopic, Topics, gather};
use super::mapping::Mapping;
use super::{Role, TopicMap, known};
use crate::{BagError, Topic};

/// What a node subscribes to.
#[derive(Debug, Clone, Default)]
pub struct LiveStreams {
    /// Streams of their own type that the file leaves out or maps signal by signal.
    pub without: Vec<Role>,
    /// Topics read field by field, of types that the suite knows.
    pub mapped: Vec<MappedTopic>,
    /// Which stream carries which signal.
    pub layout: Layout,
    /// What cannot be taken live, and why, a sentence each.
    pub cannot: Vec<String>,
}

/// Types that the suite subscribes to, and how their fields begin.
const LIVE_TYPES: [(&str, &[&str]); 4] = [
    (Odometry::TYPE, &["twist.twist.", "pose.pose."]),
    (AckermannDriveStamped::TYPE, &["drive."]),
    (sensor_msgs::Imu::TYPE, &["linear_acceleration.", "angular_velocity.", "orientation"]),
    (sensor_msgs::JointState::TYPE, &["velocity[", "effort[", "position["]),
];

impl TopicMap {
    /// What of the file a node can follow: streams by their own type, and signals whose field belongs to one of the types that the suite
    /// subscribes to (Odometry, AckermannDriveStamped, Imu, JointState).
    ///
    /// # Errors
    /// [`BagError::Mapping`], [`BagError::Field`]: what is wrong with an entry itself.
    pub fn live(&self) -> Result<LiveStreams, BagError> {
        let mut live = LiveStreams::default();
        let mut signals: BTreeMap<Signal, Mapping> = self.signals.clone();
        if let Some(topic) = self.pose.as_deref().filter(|topic| !topic.is_empty()) {
            for &(signal, field) in known::fields_of(Odometry::TYPE, known::Group::Pose) {
                let ahead_m = self.pose_ahead_m;
                let mapping = Mapping { field: field.to_owned(), ahead_m, ..Mapping::of_topic(topic) };
                signals.entry(signal).or_insert(mapping);
            }
        }
        let mut topics: BTreeMap<String, Topic> = BTreeMap::new();
        signals.retain(|signal, mapping| {
            if mapping.topic.is_empty() {
                return true;
            }
            let begins = |fields: &[&str]| fields.iter().any(|field| mapping.field.starts_with(field));
            let Some((type_name, _)) = LIVE_TYPES.iter().find(|(_, fields)| begins(fields)) else {
                live.cannot.push(format!(
                    "{} from {}: its type is not one that nodes subscribe to (Odometry, AckermannDriveStamped, Imu, JointState); on a bag it is read",
                    signal.name(),
                    mapping.topic
                ));
                return false;
            };
            if mapping.stamp.as_deref().is_some_and(|stamp| stamp != "header") {
                live.cannot.push(format!("{}: live, only header stamps count", signal.name()));
                return false;
            }
            topics.entry(mapping.topic.clone()).or_insert_with(|| Topic {
                name: mapping.topic.clone(),
                type_name: (*type_name).to_owned(),
                encoding: "cdr".to_owned(),
                offered_qos_profiles: String::new(),
                schema: gripsight_msgs::schema(type_name).unwrap_or_default(),
                schema_encoding: "ros2msg".to_owned(),
            });
            true
        });
        let topics: Vec<Topic> = topics.into_values().collect();
        live.mapped = gather(Topics { path: Path::new("topics file"), topics: &topics }, &signals)?;
        let mapped = |signal: &Signal| signals.get(signal).is_some_and(|m| !m.topic.is_empty());
        for role in Role::ALL {
            let left_out = self.of(role) == Some("");
            let replaced = self.of(role).is_none() && role.replaced_by().iter().any(mapped);
            if left_out || replaced {
                live.without.push(role);
                live.layout.forget(role as usize);
            }
        }
        for (place, topic) in live.mapped.iter().enumerate() {
            live.layout.map(place, &topic.signals.iter().map(|(signal, _)| *signal).collect::<Vec<_>>());
        }
        signals.iter().filter(|(_, m)| m.topic.is_empty()).for_each(|(&s, _)| live.layout.forget_signal(s));
        Ok(live)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_types_are_followed_and_the_rest_is_told() {
        let text = "drive: /drive\nv_y: ''\na_y: {topic: /vesc/imu, field: linear_acceleration.y, unit: g}\n\
                    v_x: {topic: /sensors/core, field: state.speed, gain: 4614}\n";
        let live = TopicMap::parse(text).unwrap().live().unwrap();
        assert_eq!(live.without, [Role::Imu]);
        assert_eq!(live.mapped.len(), 1);
        assert_eq!(live.mapped[0].type_name, sensor_msgs::Imu::TYPE);
        assert_eq!(live.layout.source(Signal::LateralSpeed), None);
        assert_eq!(live.layout.source(Signal::ForwardSpeed), Some(0));
        assert!(live.cannot[0].contains("v_x from /sensors/core"), "{:?}", live.cannot);
    }
}
