//! The targets and the thresholds of scoring, with the day they were fixed.

use serde::{Deserialize, Serialize};

/// Targets of the diagnosis, as `targets.json` beside this crate holds them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Targets {
    /// Day on which they were fixed; a change means a new batch.
    pub fixed: String,
    /// Size over the detection limit from which the targets speak of a case.
    pub least_severity: f64,
    /// What the best remaining effect must leave (squared, over the noise, per residual) for `none of these` to be asked for.
    pub least_excess: f64,
    /// Stated confidence from which a name counts as confident.
    pub confident: f64,
    /// Site blamed, at least.
    pub site: f64,
    /// First name exact, at least.
    pub exact: f64,
    /// First name within its group, at least.
    pub within_group: f64,
    /// Mean size of groups, at most.
    pub group_size: f64,
    /// False alarms, at most.
    pub false_alarms: f64,
    /// `none_of_these` for effects that the library lacks, at least.
    pub out_of_library: f64,
    /// Confident names for effects that were left out, at most.
    pub confident_stand_ins: f64,
    /// `none_of_these` for effects that were left out and leave an excess, at least.
    pub deleted_none_of_these: f64,
    /// Both of a pair named, at least.
    pub pairs: f64,
    /// Intervals that hold the truth, from and to.
    pub coverage: [f64; 2],
    /// Shrinkage over the oracle's, at least.
    pub shrinkage: f64,
    /// Time for 60 s of data on two cores, at most.
    pub time_s: f64,
}

impl Targets {
    /// The targets fixed for the project.
    ///
    /// # Errors
    /// Where the file in the source is no such table.
    pub fn fixed() -> Result<Self, serde_json::Error> {
        serde_json::from_str(include_str!("../targets.json"))
    }
}
