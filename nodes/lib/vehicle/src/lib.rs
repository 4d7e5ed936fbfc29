//! The nominal model of the car: what gripsight identifies, and what it compares the real car with.
//!
//! * [`MagicFormula`]: normalised lateral force of one axle's tires, F_y/F_z;
//! * [`SingleTrack`]: the dynamic single-track model of the paper (arXiv 2603.09399, eq. 1-5);
//! * [`VehicleParameters`]: what is known of the car, read from a ROS 2 parameter file;
//! * [`AxleEllipse`]: what an axle has left for the side while it drives or brakes;
//! * [`PacejkaParameters`]: Phi_p, the effective tires of this model; [`OwnTires`]: those of the car with its load transfer and combined slip;
//! * [`TirePosterior`]: own tires as a drive knows them;
//! * [`handling`]: numbers that an engineer knows: cornering stiffness, understeer gradient, stability.
//!
//! The equations are written once, for any [`Real`]: with `f64` they are simulated, with dual numbers they give exact derivatives.
//!
//! Signs follow REP-103: left steer, left yaw and left force are positive; a positive slip angle makes a force to the left.

mod curve_fit;
mod ellipse;
mod error;
pub mod handling;
mod magic_formula;
mod own_tires;
mod parameters;
mod real;
mod single_track;
mod tire_posterior;

pub use ellipse::AxleEllipse;
pub use error::VehicleError;
pub use magic_formula::{MagicFormula, PacejkaParameters};
pub use own_tires::{OWN_TIRE_PARAMETERS, OwnTires};
pub use parameters::{FIGURES, VehicleParameters};
pub use real::{Dual, Real};
pub use single_track::{Input, SingleTrack, State};
pub use tire_posterior::{PosteriorParameter, TirePosterior};

/// Standard gravity.
pub const GRAVITY_MPS2: f64 = 9.806_65;
