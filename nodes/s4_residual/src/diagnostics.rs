//! The node's state in words.

use gripsight_runtime::{Level, Status};

/// What the node does about candidates.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Activity {
    /// No candidate is open.
    Idle,
    /// A candidate waits for its sequence.
    WaitingForSequence {
        /// Which.
        sequence_id: u64,
    },
    /// A residual is being learned.
    Training {
        /// Key of the candidate.
        candidate: String,
    },
    /// The last candidate could not be answered.
    Failed {
        /// Why.
        reason: String,
    },
}

/// Figures for the diagnostics.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Figures {
    /// Sequences held.
    pub(crate) sequences: usize,
    /// Models published.
    pub(crate) models: usize,
    /// Live residuals published.
    pub(crate) residuals: usize,
    /// Time of the last training, s.
    pub(crate) last_training_s: f64,
    /// Loss of the last model on the part held back.
    pub(crate) last_validation_loss: f64,
}

/// ERROR: the last candidate could not be answered. WARN: a candidate is about a sequence that has not come.
pub(crate) fn status(activity: &Activity, figures: &Figures) -> Status {
    let (level, text) = match activity {
        Activity::Idle => (Level::Ok, "waiting for a candidate".to_owned()),
        Activity::WaitingForSequence { sequence_id } => {
            (Level::Warn, format!("a candidate is about sequence {sequence_id}, which has not come"))
        }
        Activity::Training { candidate } => (Level::Ok, format!("learning the residual of {candidate}")),
        Activity::Failed { reason } => {
            (Level::Error, format!("the last candidate could not be answered: {reason}"))
        }
    };
    Status::new(level, text)
        .value("sequences held", figures.sequences)
        .value("models published", figures.models)
        .value("live residuals published", figures.residuals)
        .value("last training [s]", format!("{:.3}", figures.last_training_s))
        .value("last validation loss", format!("{:.4}", figures.last_validation_loss))
}

#[cfg(test)]
mod tests {
    use gripsight_runtime::manual_covers;

    use super::*;

    #[test]
    fn each_activity_has_its_level() {
        let level = |activity| status(&activity, &Figures::default()).level;
        assert_eq!(level(Activity::Idle), Level::Ok);
        assert_eq!(level(Activity::Training { candidate: "c".into() }), Level::Ok);
        assert_eq!(level(Activity::WaitingForSequence { sequence_id: 3 }), Level::Warn);
        assert_eq!(level(Activity::Failed { reason: "r".into() }), Level::Error);
    }

    #[test]
    fn the_manual_lists_every_state() {
        let states = [
            Activity::Idle,
            Activity::Training { candidate: "c".into() },
            Activity::WaitingForSequence { sequence_id: 3 },
            Activity::Failed { reason: "r".into() },
        ];
        let states = states.map(|activity| status(&activity, &Figures::default()));
        assert_eq!(manual_covers(include_str!("../README.md"), &states), Ok(()));
    }
}
