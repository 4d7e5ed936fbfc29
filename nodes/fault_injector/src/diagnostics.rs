//! How the node is, from what it knows.

use gripsight_runtime::{Level, Status};

/// What the node knows.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct State {
    /// Faults at work now, as they are written.
    pub(crate) at_work: Vec<String>,
    /// Faults of the plan that are still to come.
    pub(crate) to_come: usize,
    /// Messages in and out.
    pub(crate) taken: u64,
    pub(crate) given: u64,
}

/// WARN while a fault is at work, so that nobody forgets the node between car and suite.
pub(crate) fn status(state: &State) -> Status {
    let status = if state.at_work.is_empty() {
        Status::new(Level::Ok, "messages pass as they are")
    } else {
        Status::new(Level::Warn, format!("messages are harmed on purpose: {}", state.at_work.join("; ")))
    };
    status
        .value("faults to come", state.to_come)
        .value("messages taken", state.taken)
        .value("messages given", state.given)
}

#[cfg(test)]
mod tests {
    use gripsight_runtime::manual_covers;

    use super::*;

    #[test]
    fn levels() {
        assert_eq!(status(&State::default()).level, Level::Ok);
        let harmed = status(&State { at_work: vec!["drop odom 1 2 0.5".into()], ..State::default() });
        assert!(harmed.level == Level::Warn && harmed.message.contains("drop odom"));
        assert_eq!(manual_covers(include_str!("../README.md"), &[harmed]), Ok(()));
    }
}
