//! Files that other stacks read (and that `--pacejka` reads back).
//!
//! * [`mpc_yaml`]: ten keys for a model predictive controller that computes F_y = friction_coeff D F_z sin(...);
//! * [`controller_txt`]: car and tires for steering-lookup controllers;
//! * [`SteeringLookup`]: lateral acceleration in steady cornering over speed and steering angle, for the same;
//! * [`read_tires`]: either tire file, back; [`read_valid_within`]: the limits in its comments;
//! * [`TireFiles`]: writes all three without ever leaving a half-written or a rejected set where a controller looks.
//!
//! The bytes depend on what was identified from which data, never on the time of writing.

mod error;
mod files;
mod lookup;
mod read;
#[cfg(test)]
mod tests;
mod tires;

pub use error::ExportError;
pub use files::{TireFiles, read_text, replace_file};
pub use lookup::SteeringLookup;
pub use read::{checked_tires, read_tires};
pub use tires::{Provenance, controller_txt, mpc_yaml, read_valid_within, stamp_text};
