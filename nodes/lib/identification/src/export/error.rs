//! Errors of the exported files.

use std::path::PathBuf;

/// What can go wrong with the files of other stacks.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// A file cannot be written, kept or removed.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The text is not the YAML of a tire file.
    #[error("tire file: {0}")]
    Yaml(String),
    /// The file has the keys of neither format.
    #[error("tire file: neither `C_Pf` (steering-lookup controllers) nor `Bf` (MPC) among its keys: {found}")]
    UnknownFormat {
        /// The keys that are there.
        found: String,
    },
    /// A parameter is no number to compute with.
    #[error("tire file: {name} is {got}, must be {must}")]
    Parameter {
        /// Which.
        name: &'static str,
        /// What it is.
        got: f64,
        /// What it must be.
        must: &'static str,
    },
}
