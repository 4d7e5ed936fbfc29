//! Errors of this crate. A poor result is not an error: it is an [`Outcome`](crate::Outcome) that is not accepted, with reasons.

use gripsight_signals::SignalError;

/// Why there is no outcome at all.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IdentificationError {
    /// The telemetry is malformed.
    #[error(transparent)]
    Signal(#[from] SignalError),
    /// The car's parameters are out of range.
    #[error(transparent)]
    Vehicle(#[from] gripsight_vehicle::VehicleError),
    /// The residual network refused its settings or weights.
    #[error("residual network: {0}")]
    Network(#[from] gripsight_s4::Error),
    /// There is not enough driving to fit anything to.
    #[error("{what}: {got:.3}, at least {needed:.3} needed; {drive}")]
    TooLittle {
        /// What is too small, with its unit.
        what: &'static str,
        /// How much there is.
        got: f64,
        /// How much is needed.
        needed: f64,
        /// The driving that would help.
        drive: &'static str,
    },
    /// A setting is out of range.
    #[error("{name} is {got}, must be {must}")]
    Setting {
        /// Which.
        name: &'static str,
        /// What it is.
        got: f64,
        /// What it must be.
        must: &'static str,
    },
    /// A residual model does not answer the candidate that waits for it.
    #[error("residual model is for {got}, the candidate waiting is {expected}")]
    WrongModel {
        /// Key of the waiting candidate.
        expected: String,
        /// Key of the model.
        got: String,
    },
    /// The previous set belongs to a car with other parameters.
    #[error("the previous set is for vehicle {got}, this one is {expected}")]
    OtherCar {
        /// Key of this car.
        expected: String,
        /// Key of the set's car.
        got: String,
    },
    /// The caller ended the training.
    #[error("the training was interrupted")]
    Interrupted,
    /// The run has ended already.
    #[error("the run has ended: it takes no further residual model")]
    Ended,
    /// A message names something that this version does not know.
    #[error("{what} `{got}` is not known here")]
    Unknown {
        /// What was named.
        what: &'static str,
        /// The name.
        got: String,
    },
    /// The fit found no finite parameters.
    #[error("{what} is not finite")]
    NotFinite {
        /// What.
        what: &'static str,
    },
}
