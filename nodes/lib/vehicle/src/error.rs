//! Errors of this crate.

/// What can be wrong with a car's description.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VehicleError {
    /// A parameter is out of the range in which the model means something.
    #[error("vehicle.{name} is {got}, must be {must}")]
    Parameter {
        /// Which, with its unit.
        name: &'static str,
        /// What it is.
        got: f64,
        /// What it must be.
        must: &'static str,
    },
    /// The parameter file cannot be read as such.
    #[error("vehicle file: {0}")]
    Yaml(String),
    /// The parameter file has no `vehicle` block.
    #[error("vehicle file: no `vehicle` block under any node's ros__parameters (nodes: {found})")]
    NoVehicle {
        /// The nodes that are there.
        found: String,
    },
    /// A file or a message of the car's own tires is not whole.
    #[error("tire posterior: {0}")]
    Posterior(String),
}
