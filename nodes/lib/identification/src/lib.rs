//! From a state sequence to Pacejka parameters: signal corrections, residual learning, virtual steering sweep, fit, acceptance.
//!
//! [`identify`] is the whole way; [`Identification`] and [`train_residual`] are its halves, which run in two nodes when live.
//! The least-squares engine underneath is `gripsight_estimation::shooting`; [`Monitor`] says when a set in use stops fitting.

mod acceptance;
mod candidate;
mod conclude;
mod config;
mod data;
mod direct;
mod drive_next;
mod envelope;
mod error;
pub mod export;
mod extract;
mod floors;
mod grip;
mod handling;
mod judge;
mod live;
mod longitudinal;
mod monitor;
pub mod nelder_mead;
mod outcome;
mod picture;
mod recorded;
mod residual;
mod residual_model;
mod rollout;
mod run;
mod start;
mod sweep;
pub mod tires;
mod together;

pub use candidate::{
    AcceptedSet, Candidate, Estimate, FrictionPrior, PerAxle, Range, RunKey, SignalCorrections, vehicle_hash,
};
pub use config::{Config, Method, ResidualKind};
pub use direct::GripChange;
pub use drive_next::{DriveNext, Manoeuvre};
pub use envelope::ValidWithin;
pub use error::IdentificationError;
pub use floors::{Floors, OnOneFloor, identify_floors};
pub use grip::{GripLook, GripWatch};
pub use handling::{Handling, HandlingPoint, understeer_rad};
pub use live::{LiveResidual, LiveSample};
pub use longitudinal::{Given, LimitsAt, Longitudinal, Told, longitudinal};
pub use monitor::{Monitor, Reading};
pub use outcome::{
    Change, HorizonError, IterationRecord, Outcome, PeakFriction, ProvisionalSet, Rmse, RmseReport,
    SignalEstimates, Source, Status, TireCurve, Trace, WeakSignal,
};
pub use recorded::{Doubt, EstimatedChannel, EstimatedMotion, Objection, Recorded, Usable, Why};
pub use residual::train_residual;
pub use residual_model::{INPUTS, OUTPUTS, ResidualModel};
pub use rollout::Nuisance;
pub use run::{Identification, Next, Stage, Started, Swept, identify};
pub use together::{AxleCheck, Disagreement, Verification, disagreements, verify};
