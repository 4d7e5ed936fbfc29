//! The car model as a unit for co-simulation: what others' simulators load (Functional Mock-up Interface 3.0, and 2.0).
//!
//! The crate is built twice. As a library it makes the unit's file ([`write()`]): a zip archive of `modelDescription.xml`, the car
//! (`resources/car.json`, a [`gripsight_model::CarFile`]) and the shared object. As that shared object it is the unit: [`Unit`] behind the interface's C functions.
//!
//! The unit is [`gripsight_model::Drive`], so it moves as the model does that a diagnosis rolls out. Its inputs hold over a step, unless their
//! rates say otherwise; angles are in rad, lengths in m, everything left is positive. Steps have one length.

mod archive;
mod description;
mod error;
mod fmi2;
mod fmi3;
mod interface;
mod unit;
mod variables;

pub use archive::{LIBRARY, write};
pub use description::Version;
pub use error::FmuError;
pub use unit::Unit;
pub use variables::{Role, Variable, variables};
