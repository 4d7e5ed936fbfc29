//! Drives a car around a track on a tire set: speed profile, pursuit or predictive control, delay made up for.
//!
//! A demonstration that closes the loop, not a racing stack: it follows a given line, and takes Phi_p as such stacks do. [`Driver`] is the
//! interface: states in, commands out, tire sets whenever they come.

mod driver;
mod error;
mod extended;
mod governor;
mod longitudinal;
mod plan;
mod predictive;
mod probation;
mod profile;
mod progress;
mod pursuit;
mod spline;
mod state;
mod steering;
mod tires;
mod track;
mod trial;
mod weave;

pub use driver::{Driver, Settings};
pub use error::DrivingError;
pub use extended::Named;
pub use longitudinal::{Longitudinal, ReachedAt};
pub use predictive::{Predictive, Solves};
pub use probation::{Driven, GivenBack};
pub use profile::{Drivetrain, Limits, SpeedProfile};
pub use pursuit::Pursuit;
pub use state::{CarState, DriveCommand};
pub use steering::Controller;
pub use tires::{Actuator, SteeringTable, TireSet, Trust};
pub use track::{Place, Track, TrackPoint};
pub use trial::Trial;
