//! The state of a node on `/diagnostics`, once a second.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use gripsight_msgs::standard::diagnostic_msgs::{DiagnosticStatus, KeyValue};

/// How a part of a node is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// It does what it is for.
    #[default]
    Ok,
    /// It works, but the result is not what it could be.
    Warn,
    /// It does not do what it is for.
    Error,
}

/// State of one part of a node.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// How it is.
    pub level: Level,
    /// The state in words.
    pub message: String,
    /// Figures behind it: name and value.
    pub values: Vec<(String, String)>,
}

impl Status {
    /// A state without figures.
    pub fn new(level: Level, message: impl Into<String>) -> Self {
        Self { level, message: message.into(), values: Vec::new() }
    }

    /// The state with one more figure.
    #[must_use]
    #[expect(clippy::needless_pass_by_value, reason = "callers pass numbers and texts as they have them")]
    pub fn value(mut self, name: &str, value: impl ToString) -> Self {
        self.values.push((name.to_owned(), value.to_string()));
        self
    }
}

/// What a topic's transport has suffered.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Transport {
    undecodable: u64,
    unsent: u64,
    last_reason: String,
}

#[derive(Debug, Default)]
struct State {
    parts: BTreeMap<String, Status>,
    transport: BTreeMap<String, Transport>,
}

/// Where a node reports how it is. Clones report to the same place.
#[derive(Clone, Debug, Default)]
pub struct Diagnostics {
    state: Arc<Mutex<State>>,
}

impl Diagnostics {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets the state of the part `name`; it is published every second until the next report.
    pub fn report(&self, name: &str, status: Status) {
        self.state().parts.insert(name.to_owned(), status);
    }

    /// Counts a message that could not be decoded.
    pub(crate) fn undecodable(&self, topic: &str, reason: String) {
        let mut state = self.state();
        let transport = state.transport.entry(topic.to_owned()).or_default();
        transport.undecodable += 1;
        transport.last_reason = reason;
    }

    /// Counts a message that could not be sent.
    pub(crate) fn unsent(&self, topic: &str, reason: String) {
        let mut state = self.state();
        let transport = state.transport.entry(topic.to_owned()).or_default();
        transport.unsent += 1;
        transport.last_reason = reason;
    }

    /// All states as messages. `node` is the node's full name.
    pub(crate) fn messages(&self, node: &str) -> Vec<DiagnosticStatus> {
        let state = self.state();
        let transport = ("transport".to_owned(), transport_status(&state.transport));
        let parts = state.parts.iter().map(|(name, status)| (name.clone(), status.clone()));
        std::iter::once(transport).chain(parts).map(|(name, status)| message(node, &name, status)).collect()
    }
}

fn transport_status(topics: &BTreeMap<String, Transport>) -> Status {
    let undecodable: u64 = topics.values().map(|topic| topic.undecodable).sum();
    let unsent: u64 = topics.values().map(|topic| topic.unsent).sum();
    if undecodable + unsent == 0 {
        return Status::new(Level::Ok, "every message was decoded and sent");
    }
    let text = format!("{undecodable} messages could not be decoded, {unsent} not be sent");
    topics.iter().fold(Status::new(Level::Warn, text), |status, (topic, transport)| {
        let Transport { undecodable, unsent, last_reason } = transport;
        status.value(topic, format!("{undecodable} not decoded, {unsent} not sent; last: {last_reason}"))
    })
}

fn message(node: &str, name: &str, status: Status) -> DiagnosticStatus {
    DiagnosticStatus {
        level: match status.level {
            Level::Ok => DiagnosticStatus::OK,
            Level::Warn => DiagnosticStatus::WARN,
            Level::Error => DiagnosticStatus::ERROR,
        },
        name: format!("{}: {name}", node.trim_start_matches('/')),
        message: status.message,
        hardware_id: "gripsight".to_owned(),
        values: status.values.into_iter().map(|(key, value)| KeyValue { key, value }).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_become_messages() {
        let diagnostics = Diagnostics::default();
        diagnostics.report("input", Status::new(Level::Error, "no odometry").value("samples", 0));
        let messages = diagnostics.messages("/car/telemetry");
        assert_eq!(messages.len(), 2);
        assert_eq!(
            (messages[0].name.as_str(), messages[0].level),
            ("car/telemetry: transport", DiagnosticStatus::OK)
        );
        assert_eq!(
            (messages[1].message.as_str(), messages[1].level),
            ("no odometry", DiagnosticStatus::ERROR)
        );
        assert_eq!(messages[1].values[0].value, "0");
    }

    #[test]
    fn what_is_lost_is_a_warning() {
        let diagnostics = Diagnostics::default();
        diagnostics.undecodable("/odom", "too short".into());
        diagnostics.unsent("/out", "window full".into());
        let transport = &diagnostics.messages("/n")[0];
        assert_eq!(transport.level, DiagnosticStatus::WARN);
        assert!(transport.values[0].value.contains("1 not decoded") && transport.values[1].key == "/out");
    }
}
