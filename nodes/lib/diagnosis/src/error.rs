//! Errors of this crate.

use gripsight_model::ModelError;
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
    /// Recording or effect's name are of no use to the model.
    #[error(transparent)]
    Model(#[from] ModelError),
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
