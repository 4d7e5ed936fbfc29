//! Errors of this crate.

use std::path::{Path, PathBuf};

use gripsight_bag::BagError;
use gripsight_reference_car::{EndReason, ReferenceCarError};

/// Why a case cannot be made, or labels cannot be trusted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WithheldError {
    /// A file cannot be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A bag cannot be read or written.
    #[error(transparent)]
    Bag(#[from] BagError),
    /// A scenario makes no sense.
    #[error(transparent)]
    ReferenceCar(#[from] ReferenceCarError),
    /// A file does not hold what it should.
    #[error("{path} is not what it should be: {why}")]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// The labels are not those that the commitment was made for.
    #[error(
        "{labels} is not the file that {commitment} was made for: SHA-256 {found}, committed to {committed}"
    )]
    Tampered {
        /// The label file.
        labels: PathBuf,
        /// The commitment.
        commitment: PathBuf,
        /// Hash of the label file.
        found: String,
        /// Hash committed to.
        committed: String,
    },
    /// No drive of this kind stays on the road.
    #[error("no drive out of {tries} came to its end; the last: {last}")]
    NoDrive {
        /// How many were tried.
        tries: usize,
        /// How the last one ended.
        last: EndReason,
    },
    /// A drive that others made is too short or lacks a stream.
    #[error("{path} cannot be used for cases: {why}")]
    Source {
        /// The bag.
        path: PathBuf,
        /// What is missing.
        why: String,
    },
    /// The maker of pairs of simulator and car failed.
    #[error("{command} failed:\n{said}")]
    Maker {
        /// What was run.
        command: String,
        /// What it said.
        said: String,
    },
    /// No change of a simulator shows in a drive.
    #[error("none of {tries} draws of {simulator} shows at {severity} times the detection limit")]
    NothingShows {
        /// Which simulator.
        simulator: String,
        /// How many were tried.
        tries: usize,
        /// What was wanted.
        severity: f64,
    },
    /// Files of another batch are in the way.
    #[error("{path} belongs to a batch with other settings ({found}); finish that one, or name other files")]
    OtherBatch {
        /// The file.
        path: PathBuf,
        /// Its settings.
        found: String,
    },
}

impl WithheldError {
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }

    pub(crate) fn content(path: &Path, why: &impl ToString) -> Self {
        Self::Content { path: path.to_owned(), why: why.to_string() }
    }
}
