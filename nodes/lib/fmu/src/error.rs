//! What can be wrong with a unit.

use std::path::{Path, PathBuf};

/// Why a unit cannot be made or started.
#[derive(Debug, thiserror::Error)]
pub enum FmuError {
    /// A file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The archive cannot be written.
    #[error("cannot write the unit: {0}")]
    Archive(#[from] zip::result::ZipError),
    /// The car's file cannot be read.
    #[error("the car of the unit: {0}")]
    Car(#[from] serde_json::Error),
    /// Its effects are not those of the library.
    #[error(transparent)]
    Model(#[from] gripsight_model::ModelError),
}

impl FmuError {
    /// Of a path.
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }
}
