//! Errors of this crate.

/// Why a page cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// The drawing library refused a picture.
    #[error("cannot draw `{chart}`: {why}")]
    Drawing {
        /// The picture's name.
        chart: String,
        /// What the library says.
        why: String,
    },
}
