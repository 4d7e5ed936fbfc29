//! The blind check's arithmetic: verdicts ([`Said`]) beside labels make [`Answer`]s, and all answers make [`Scores`].
//!
//! Every rate carries its 95 % Wilson interval ([`Rate`]). Targets and thresholds, with the day they were fixed, are in `targets.json`.

mod baselines;
mod calibration;
mod control;
mod judge;
mod lines;
mod pairs;
mod rate;
mod scores;
mod targets;
mod text;
mod verdict;

pub use baselines::baselines;
pub use calibration::{Calibration, CalibrationBin};
pub use control::{Control, Outside, control};
pub use judge::{Answer, SizeCheck, excuse_what_drives_have};
pub use lines::Line;
pub use pairs::{PairRow, PairScores};
pub use rate::{Rate, median};
pub use scores::{EffectScore, FamilyScore, Miss, SEVERITY_BANDS, Scores};
pub use targets::Targets;
pub use verdict::{
    Figure, OtherDrive, Said, SaidChange, SaidEffect, SaidGap, SaidParameter, SaidPatch, SaidSite,
};
