//! v_x, v_y and yaw rate with their covariance, where a stack does not measure them: from poses, inertial unit, gyroscope and speed.
//!
//! Free of any tire model: nothing but rigid-body kinematics in the plane, so that what it gives may be fitted tires to.
//!
//! ```text
//! x' = v_x cos psi - v_y sin psi     v_x' = a_x + v_y r     a_x' = white noise
//! y' = v_x sin psi + v_y cos psi     v_y' = a_y - v_x r     a_y' = white noise
//! psi' = r                           r'   = alpha           alpha' = white noise
//! ```
//!
//! with what the localisation is off by for tenths of a second (a first-order Gauss-Markov process on each coordinate of a pose), and constants beside: biases of the accelerometers and of the gyroscope, the place of the inertial unit ahead of the point of the poses,
//! and the scales of speed, yaw rate and lateral acceleration (a body that rolls adds to it). [`smooth`] runs an extended Kalman filter forward and a modified Bryson-Frazier smoother back (offline); [`Filter`] is
//! the forward half alone (live). How strong the white noises are, and how noisy each sensor is, is taken from the recording itself
//! ([`Levels`]): its noise from sample to sample, and what poses and sensors leave beside each other over tenths of a second, which by its growth with the span is the sensor's or the
//! localisation's. A pose that contradicts what is known by more than chance does is left out; where poses go on contradicting, the
//! localisation has jumped, and position and heading begin anew. The delay of the poses is that at which their heading follows the integrated
//! yaw rate best.
//!
//! Source of the smoother: Bierman, International Journal of Control 18 (1973), 65-75 (the modified Bryson-Frazier pass).

mod coloured;
mod error;
mod events;
mod filter;
mod levels;
mod smoother;
mod state;

pub use error::StateError;
pub use events::Observation;
pub use filter::{Filter, Motion};
pub use levels::{Levels, Wander};
pub use smoother::{Smoothed, filled, smooth};
