//! Drives a car around a track on a tire set: speed profile, pursuit through a steering table, delay made up for.
//!
//! A demonstration that closes the loop, not a racing stack: it follows a given line, and takes Phi_p as such stacks do. [`Driver`] is the
//! interface: states in, commands out, tire sets whenever they come.

mod driver;
mod error;
mod extended;
mod governor;
mod longitudinal;
mod plan;
mod probation;
mod profile;
mod progress;
mod pursuit;
mod spline;
mod state;
mod tires;
mod track;
mod trial;

pub use driver::{Driver, Settings};
pub use error::DrivingError;
pub use extended::Named;
pub use longitudinal::{Longitudinal, ReachedAt};
pub use probation::{Driven, GivenBack};
pub use profile::{Drivetrain, Limits, SpeedProfile};
pub use pursuit::{Moment, Pursuit};
pub use state::{CarState, DriveCommand};
pub use tires::{Actuator, SteeringTable, TireSet, Trust};
pub use track::{Place, Track, TrackPoint};
pub use trial::Trial;
