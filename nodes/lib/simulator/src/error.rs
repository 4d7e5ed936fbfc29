//! Errors of this crate.

use std::path::{Path, PathBuf};

/// What can go wrong with a user's simulator.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulatorError {
    /// A file cannot be read or written.
    #[error("{path}: {why}")]
    Io {
        /// Which file.
        path: PathBuf,
        /// What the system said.
        why: std::io::Error,
    },
    /// The simulator's file is not what it must be.
    #[error("{path}: {why}")]
    File {
        /// Which file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// The command does not start.
    #[error("the simulator's command `{command}` does not start: {why}")]
    Start {
        /// What was run.
        command: String,
        /// What the system said.
        why: std::io::Error,
    },
    /// The process ended.
    #[error("the simulator ended ({status}) {when}; its last words:\n{last_words}")]
    Died {
        /// What it was asked.
        when: &'static str,
        /// Its exit status.
        status: String,
        /// The end of what it printed.
        last_words: String,
    },
    /// No answer in time.
    #[error(
        "the simulator gave no answer {when} within {limit_s} s (time_limit_s in the simulator's file); its last words:\n{last_words}"
    )]
    Late {
        /// What it was asked.
        when: &'static str,
        /// The time allowed.
        limit_s: f64,
        /// The end of what it printed.
        last_words: String,
    },
    /// The simulator says that it failed.
    #[error("the simulator failed {when}:\n{message}")]
    Failed {
        /// What it was asked.
        when: &'static str,
        /// What it said.
        message: String,
    },
    /// An answer that is no answer.
    #[error("the simulator's answer {when} cannot be used: {why}")]
    Answer {
        /// What it was asked.
        when: &'static str,
        /// What is wrong with it.
        why: String,
    },
    /// The description is not usable.
    #[error("the simulator describes itself in a way that cannot be used: {0}")]
    Description(String),
    /// The bag and the simulator do not fit together.
    #[error("{0}")]
    Drive(String),
    /// The parameter file cannot be patched.
    #[error("{path}: {why}")]
    Patch {
        /// Which file.
        path: PathBuf,
        /// Why not.
        why: String,
    },
}

impl SimulatorError {
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |why| Self::Io { path: path.to_owned(), why }
    }
}
