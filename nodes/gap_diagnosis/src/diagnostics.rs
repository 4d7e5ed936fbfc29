//! The node's state in words.

use gripsight_runtime::{Level, Status};

/// How the last diagnosis ended.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Last {
    /// There was none yet.
    None,
    /// It stands.
    Done {
        /// As in gap.json.
        verdict: &'static str,
        /// Its first sentence.
        because: String,
    },
    /// It could not be made.
    Failed {
        /// Why.
        reason: String,
    },
}

/// What the state is judged by.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Facts {
    pub(crate) last: Last,
    /// Diagnoses made.
    pub(crate) diagnoses: usize,
    /// Sequences received; those that came during a diagnosis were passed over but for the newest.
    pub(crate) received: usize,
    /// Time of the last one, s.
    pub(crate) took_s: f64,
    /// Whether tires have arrived on `posterior`.
    pub(crate) has_tires: bool,
}

/// ERROR: the last diagnosis could not be made. WARN: model and car disagree (the verdict says how), or the data cannot tell.
pub(crate) fn status(facts: &Facts) -> Status {
    let (level, text) = match &facts.last {
        Last::None => (Level::Ok, "waiting for the first sequence".to_owned()),
        Last::Done { verdict, because } => {
            let agrees = *verdict == "no_gap";
            (if agrees { Level::Ok } else { Level::Warn }, format!("{verdict}: {because}"))
        }
        Last::Failed { reason } => (Level::Error, format!("the last diagnosis could not be made: {reason}")),
    };
    Status::new(level, text)
        .value("diagnoses", facts.diagnoses)
        .value("sequences received", facts.received)
        .value("last diagnosis [s]", format!("{:.2}", facts.took_s))
        .value("tires", if facts.has_tires { "from the identifier" } else { "own fit" })
}

#[cfg(test)]
mod tests {
    use gripsight_runtime::manual_covers;

    use super::*;

    #[test]
    fn each_end_has_its_level() {
        let of = |last| status(&Facts { last, diagnoses: 1, received: 0, took_s: 1.0, has_tires: false });
        let level = |last| of(last).level;
        assert_eq!(level(Last::None), Level::Ok);
        assert_eq!(level(Last::Done { verdict: "no_gap", because: String::new() }), Level::Ok);
        assert_eq!(level(Last::Done { verdict: "effects", because: String::new() }), Level::Warn);
        assert_eq!(level(Last::Failed { reason: "r".into() }), Level::Error);
        let verdicts = ["no_gap", "effects", "tire_retune_only", "none_of_these", "not_identifiable"];
        let mut states = verdicts.map(|verdict| of(Last::Done { verdict, because: "b".into() })).to_vec();
        states.push(of(Last::None));
        states.push(of(Last::Failed { reason: "r".into() }));
        assert_eq!(manual_covers(include_str!("../README.md"), &states), Ok(()));
    }
}
