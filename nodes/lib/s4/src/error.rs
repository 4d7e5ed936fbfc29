//! What can go wrong, with the data to say where.

/// Errors of this crate. None of them is raised by training that converges badly: that is told by
/// [`StopReason`](crate::StopReason).
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting outside the values that make sense.
    #[error("{name} is {value}, expected {expected}")]
    Setting {
        /// Name of the field.
        name: &'static str,
        /// Value given.
        value: f64,
        /// Values allowed, in words.
        expected: &'static str,
    },
    /// A slice of the wrong length.
    #[error("{what} has {actual} values, expected {expected}")]
    Length {
        /// What the slice holds.
        what: &'static str,
        /// Length that the configuration implies.
        expected: usize,
        /// Length given.
        actual: usize,
    },
    /// A value that is NaN or infinite.
    #[error("{what} holds a value that is not finite at index {index}")]
    NotFinite {
        /// What the slice holds.
        what: &'static str,
        /// Index of the first such value.
        index: usize,
    },
    /// Nothing to work on.
    #[error("{what} is empty")]
    Empty {
        /// What is empty.
        what: &'static str,
    },
    /// The FFT refused its input.
    #[error("FFT of size {size} failed: {reason}")]
    Fft {
        /// Size of the transform.
        size: usize,
        /// The FFT library's words.
        reason: String,
    },
}

/// Refuses values that are not finite.
pub(crate) fn require_finite(what: &'static str, values: &[f64]) -> Result<(), Error> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(Error::NotFinite { what, index }),
        None => Ok(()),
    }
}

/// Refuses a slice of the wrong length.
pub(crate) fn require_length(what: &'static str, expected: usize, actual: usize) -> Result<(), Error> {
    if expected == actual { Ok(()) } else { Err(Error::Length { what, expected, actual }) }
}
