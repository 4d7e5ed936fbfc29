//! Errors of this crate.

use gripsight_signals::SignalError;

/// Why a recording, or a name, is of no use to the model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The telemetry itself is unusable.
    #[error(transparent)]
    Signal(#[from] SignalError),
    /// Too little of the recording can be used.
    #[error(
        "{usable_s:.1} s of {recorded_s:.1} s can be used (moving at over {least_speed_mps:.1} m/s, without gaps), at least {needed_s:.0} s are needed"
    )]
    TooLittle {
        /// Time that can be used.
        usable_s: f64,
        /// Time recorded.
        recorded_s: f64,
        /// Time needed.
        needed_s: f64,
        /// Slowest speed that is used.
        least_speed_mps: f64,
    },
    /// The sampling is too coarse for the car's dynamics.
    #[error("{rate_hz:.1} Hz is too slow for a diagnosis, at least {needed_hz:.0} Hz are needed")]
    TooCoarse {
        /// Rate of the recording.
        rate_hz: f64,
        /// Rate needed.
        needed_hz: f64,
    },
    /// An effect's name is not in the library.
    #[error("unknown effect `{name}`; the library has: {known}")]
    UnknownEffect {
        /// The name given.
        name: String,
        /// All names.
        known: String,
    },
    /// An effect lacks a parameter.
    #[error("{effect} needs a number for `{parameter}`")]
    NoParameter {
        /// Of which effect.
        effect: &'static str,
        /// Which.
        parameter: &'static str,
    },
}
