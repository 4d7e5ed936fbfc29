//! Proposes a topics file for a bag: looks at what each topic of a known type says, and at fields whose names say what they are.
//!
//! A proposal is for a person to check: everything that is guessed (by a name, or a unit by the size of its values) says so in a comment.

mod guess;
mod survey;

use std::fmt::Write as _;
use std::path::Path;

use gripsight_signals::{Signal, WindowConfig};

use crate::telemetry::sequences_of;
use crate::topics::{Group, KNOWN_TYPES};
use crate::{Bag, BagError, TopicMap};
use guess::{Guess, guesses};
use survey::{Survey, survey};

/// A topics file, and what it gives.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposal {
    /// The file's text.
    pub text: String,
    /// Why the bag cannot be used with it, in words; `None` where it can.
    pub problem: Option<String>,
    /// The topics file, read.
    pub topics: TopicMap,
}

/// Looks through a bag and proposes where each signal comes from.
///
/// # Errors
/// [`BagError`] where the bag does not read.
pub fn propose(path: &Path) -> Result<Proposal, BagError> {
    let bag = Bag::open(path)?;
    let topics = survey(&bag)?;
    let mut lines = Lines::default();
    let motion = best(&topics, Group::Motion);
    motion.inspect(|t| lines.motion(t));
    best(&topics, Group::Command).inspect(|t| lines.group(t, Group::Command));
    best(&topics, Group::Steering).inspect(|t| lines.group(t, Group::Steering));
    best(&topics, Group::Imu).inspect(|t| lines.imu(t));
    topics.iter().find(|t| t.is_wheels).inspect(|t| lines.stream("wheels", t));
    let posed = motion.is_some_and(Survey::has_pose);
    let other = |t: &&Survey| Some(&t.name) != motion.map(|m| &m.name);
    if !posed {
        best_of(topics.iter().filter(other), Group::Pose).inspect(|t| lines.pose(t));
    }
    for guess in guesses(&topics) {
        lines.guess(&guess);
    }
    for topic in bag.topics().iter().filter(|t| t.encoding == "cdr" && crate::topics::schema(t).is_err()) {
        lines.comment(&format!(
            "not looked into: {} ({}): the bag does not say what is in it; lay its .msg file beside the bag (package/msg/Type.msg)",
            topic.name, topic.type_name
        ));
    }
    lines.missing();
    let text = lines.text;
    let map = TopicMap::parse(&text)
        .map_err(|why| BagError::TopicsFile { path: path.to_owned(), why: format!("proposal: {why}") })?;
    let whole = WindowConfig { length_s: f64::INFINITY, hop_s: f64::INFINITY };
    let problem = sequences_of(&bag, &map, whole).err().map(|error| error.to_string());
    Ok(Proposal { text, problem, topics: map })
}

fn best(topics: &[Survey], group: Group) -> Option<&Survey> {
    best_of(topics.iter(), group)
}

/// The topic of a known type that says most: that moves, has more signals that do, comes more often, and stands first in the table.
fn best_of<'a>(topics: impl Iterator<Item = &'a Survey>, group: Group) -> Option<&'a Survey> {
    let score = |t: &Survey| {
        let moving = t.moving(group);
        let order = KNOWN_TYPES.iter().position(|k| k.name == t.type_name && k.group == group).unwrap_or(99);
        (moving, t.rate_hz >= 15.0, std::cmp::Reverse(order), t.messages)
    };
    topics
        .filter(|t| {
            KNOWN_TYPES.iter().any(|k| k.name == t.type_name && k.group == group) && t.moving(group) > 0
        })
        .max_by_key(|t| score(t))
}

/// The file being written.
#[derive(Default)]
struct Lines {
    text: String,
    mapped: Vec<Signal>,
}

impl Lines {
    fn comment(&mut self, text: &str) {
        let _ = writeln!(self.text, "# {text}");
    }

    fn stream(&mut self, name: &str, t: &Survey) {
        self.comment(&format!("{}, {:.0} Hz", t.type_name, t.rate_hz));
        let _ = writeln!(
            self.text,
            "{name}: {}{}",
            t.name,
            if t.unstamped { "  # its header is never stamped" } else { "" }
        );
    }

    /// A topic of a known type, by its name alone or signal by signal.
    fn group(&mut self, t: &Survey, group: Group) {
        let fields = t.fields(group);
        let native = match group {
            Group::Motion if t.type_name == "nav_msgs/msg/Odometry" => Some("odom"),
            Group::Command if t.type_name == "ackermann_msgs/msg/AckermannDriveStamped" => Some("drive"),
            Group::Imu => Some("imu"),
            _ => None,
        };
        self.mapped.extend(fields.iter().map(|f| f.signal));
        match native {
            Some(name) if !t.unstamped => self.stream(name, t),
            _ => {
                self.comment(&format!("{}, {:.0} Hz", t.type_name, t.rate_hz));
                for field in fields {
                    let stamp = if t.unstamped { ", stamp: log" } else { "" };
                    let _ = writeln!(
                        self.text,
                        "{}: {{topic: {}, field: {}{stamp}}}",
                        field.signal.name(),
                        t.name,
                        field.path
                    );
                }
            }
        }
    }

    fn motion(&mut self, t: &Survey) {
        self.group(t, Group::Motion);
        if !t.moves(Signal::LateralSpeed) {
            self.comment("v_y is zero throughout there: nothing measures it");
            let _ = writeln!(self.text, "v_y: ''");
        }
        if t.unstamped && t.has_pose() {
            self.pose(t);
        }
    }

    fn imu(&mut self, t: &Survey) {
        // On a level road the upward axis reads gravity, in whatever unit it is.
        let upward = t.upward.unwrap_or(9.81).abs();
        if (0.7..1.4).contains(&upward) {
            self.mapped.extend([Signal::ForwardAcceleration, Signal::LateralAcceleration, Signal::Gyro]);
            self.comment(&format!(
                "{}, {:.0} Hz: reads {upward:.2} upward, so it is in g, and in degrees as such units are (?)",
                t.type_name, t.rate_hz
            ));
            for (signal, field, unit) in [
                ("a_x", "linear_acceleration.x", "g"),
                ("a_y", "linear_acceleration.y", "g"),
                ("gyro_yaw_rate", "angular_velocity.z", "deg/s"),
            ] {
                let _ = writeln!(self.text, "{signal}: {{topic: {}, field: {field}, unit: {unit}}}", t.name);
            }
        } else {
            self.group(t, Group::Imu);
        }
    }

    fn pose(&mut self, t: &Survey) {
        self.mapped.extend(Signal::POSE);
        self.comment(&format!("{}, {:.0} Hz", t.type_name, t.rate_hz));
        let _ = writeln!(self.text, "pose: {}", t.name);
    }

    fn guess(&mut self, guess: &Guess) {
        if self.mapped.contains(&guess.signal) {
            return;
        }
        self.mapped.push(guess.signal);
        self.comment(&format!("(?) by its name; {}", guess.why));
        // A bracket means a list in YAML where no quotes stand around it.
        let quote = if guess.path.contains('[') { "'" } else { "" };
        let _ = writeln!(
            self.text,
            "{}: {{topic: {}, field: {quote}{}{quote}{}}}",
            guess.signal.name(),
            guess.topic,
            guess.path,
            guess.options
        );
    }

    /// What the suite would want and did not find.
    fn missing(&mut self) {
        let mapped = self.mapped.clone();
        let has = |signals: &[Signal]| signals.iter().any(|s| mapped.contains(s));
        let mut lacks = Vec::new();
        if !has(&[Signal::ForwardSpeed]) {
            lacks.push("v_x (a speed in the car's frame)");
        }
        if !has(&[Signal::YawRate, Signal::Gyro]) {
            lacks.push("yaw_rate");
        }
        if !has(&[Signal::Steering, Signal::MeasuredSteering]) {
            lacks.push("steering, commanded or measured");
        }
        if !lacks.is_empty() {
            self.comment(&format!("not found: {}", lacks.join("; ")));
        }
        // A gyro alone stands for the yaw rate.
        if !has(&[Signal::YawRate]) && has(&[Signal::Gyro]) {
            let line = self.text.lines().find(|l| l.starts_with("gyro_yaw_rate:")).map(str::to_owned);
            let imu = self
                .text
                .lines()
                .find_map(|l| l.strip_prefix("imu: "))
                .map(|l| l.split_whitespace().next().unwrap_or(l).to_owned());
            let mapping = line
                .map(|l| l.replacen("gyro_yaw_rate", "yaw_rate", 1))
                .or(imu.map(|topic| format!("yaw_rate: {{topic: {topic}, field: angular_velocity.z}}")));
            if let Some(mapping) = mapping {
                self.comment("the gyroscope's, as nothing else measures it");
                let _ = writeln!(self.text, "{mapping}");
            }
        }
    }
}
