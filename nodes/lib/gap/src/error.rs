//! Errors of this crate.

use gripsight_signals::SignalError;
use gripsight_vehicle::VehicleError;

/// Why there is no diagnosis.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GapError {
    /// The telemetry itself is unusable.
    #[error(transparent)]
    Signal(#[from] SignalError),
    /// The car's description is unusable.
    #[error(transparent)]
    Vehicle(#[from] VehicleError),
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
    /// The car is never steered, or a signal that everything rests on says nothing.
    #[error("{what} says nothing: {detail}")]
    NoInformation {
        /// Which signal.
        what: &'static str,
        /// What was found.
        detail: String,
    },
    /// The data of the drive that a later one is compared with cannot tell.
    #[error("the drive before cannot be diagnosed: {0}")]
    Earlier(String),
    /// A parameter file of an extended model cannot be read.
    #[error("extended model file: {0}")]
    ModelFile(String),
    /// The model cannot follow the data at all: not a finite error from the start.
    #[error("the model's prediction is not finite with the tires given; check vehicle file and tires")]
    NotFinite,
}
