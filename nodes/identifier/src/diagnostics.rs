//! The node's state in words.

use gripsight_runtime::{Level, SetError, Status};

/// How the last run ended.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum LastRun {
    /// There was none yet.
    None,
    /// Its set was published.
    Accepted {
        /// What it must be read with.
        remarks: String,
    },
    /// Its set must not be used.
    Rejected {
        /// Why.
        reason: String,
    },
    /// It gave no set at all.
    Failed {
        /// Why.
        reason: String,
    },
}

/// What the state is judged by.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Facts {
    pub(crate) last: LastRun,
    /// Where the run under way stands, if there is one.
    pub(crate) running: Option<String>,
    /// Runs ended, and of them accepted.
    pub(crate) runs: usize,
    pub(crate) accepted: usize,
    /// Time of the last run, s.
    pub(crate) last_run_s: f64,
    /// The friction prior in force, in words.
    pub(crate) prior: String,
    /// Sequence of the set that the MPC has.
    pub(crate) in_force: Option<u64>,
    /// What the newest sequence says against that set, in words.
    pub(crate) grip: Option<String>,
}

/// ERROR: the last run gave no set at all. WARN: its set was rejected (the MPC keeps the one before).
pub(crate) fn status(facts: &Facts) -> Status {
    let (level, text) = match &facts.last {
        LastRun::None => (Level::Ok, "waiting for the first sequence".to_owned()),
        LastRun::Accepted { remarks } if remarks.is_empty() => (Level::Ok, "tires accepted".to_owned()),
        LastRun::Accepted { remarks } => (Level::Ok, format!("tires accepted; {remarks}")),
        LastRun::Rejected { reason } => (Level::Warn, format!("tires rejected: {reason}")),
        LastRun::Failed { reason } => (Level::Error, format!("the last run gave no set: {reason}")),
    };
    let text = match &facts.running {
        Some(running) if facts.last == LastRun::None => running.clone(),
        Some(running) => format!("{text}; now {running}"),
        None => text,
    };
    Status::new(level, text)
        .value("runs", facts.runs)
        .value("accepted", facts.accepted)
        .value("last run [s]", format!("{:.2}", facts.last_run_s))
        .value("friction prior", &facts.prior)
        .value("grip", facts.grip.as_deref().unwrap_or("as it was"))
        .value("sequence of the set in force", facts.in_force.map_or("none".to_owned(), |id| id.to_string()))
}

/// How a controller that takes parameters is: whether it has the set in force, and the share of its grip that is left.
pub(crate) fn controller_status(told: &Result<(), SetError>, sequence_id: u64, left: f64) -> Status {
    let status = match told {
        Ok(()) => Status::new(Level::Ok, "the controller has the set in force"),
        Err(error) => Status::new(Level::Warn, format!("the controller has not taken the set: {error}")),
    };
    status.value("sequence of the set", sequence_id).value("share of the promised grip", format!("{left:.2}"))
}

#[cfg(test)]
mod tests {
    use gripsight_runtime::manual_covers;

    use super::*;

    #[test]
    fn each_end_has_its_level() {
        let of = |last| {
            status(&Facts {
                last,
                running: Some("training".into()),
                runs: 1,
                accepted: 0,
                last_run_s: 1.0,
                prior: "none".into(),
                in_force: None,
                grip: None,
            })
        };
        assert_eq!((of(LastRun::None).level, of(LastRun::None).message.as_str()), (Level::Ok, "training"));
        assert_eq!(of(LastRun::Accepted { remarks: String::new() }).level, Level::Ok);
        assert_eq!(of(LastRun::Rejected { reason: "r".into() }).level, Level::Warn);
        assert_eq!(of(LastRun::Failed { reason: "r".into() }).level, Level::Error);
        let reason = || "r".to_owned();
        let states = [
            LastRun::None,
            LastRun::Accepted { remarks: String::new() },
            LastRun::Accepted { remarks: reason() },
            LastRun::Rejected { reason: reason() },
            LastRun::Failed { reason: reason() },
        ];
        let absent = Err(SetError::Absent { service: "/mpc/set_parameters".to_owned() });
        let controller = [controller_status(&Ok(()), 7, 1.0), controller_status(&absent, 7, 0.6)];
        assert_eq!(controller.each_ref().map(|s| s.level), [Level::Ok, Level::Warn]);
        let said: Vec<Status> = states.map(of).into_iter().chain(controller).collect();
        assert_eq!(manual_covers(include_str!("../README.md"), &said), Ok(()));
    }
}
