//! A user's simulator as a child process, and the gap between it and the car.
//!
//! - [`SimulatorFile`], [`Simulator`]: started, described, rolled out in batches; `adapters/` holds what runs on its side.

mod adapters;
mod budget;
mod candidates;
mod child;
mod commands;
mod descent;
mod description;
mod diagnose;
mod drive;
mod error;
mod exchange;
mod export;
mod file;
mod fit;
mod flexible;
mod linear;
mod look;
mod model;
mod outcome;
mod patch;
mod plan;
mod pool;
mod ratio;
mod ripple;
mod round;
mod search;
mod server;
mod speed;
#[cfg(test)]
mod test_car;
pub mod wire;

pub use adapters::Adapter;
pub use candidates::{Candidate, Kind, Wrapped, candidates};
pub use commands::{Command, CommandEffects, Commands};
pub use description::{Channel, Description, Input, InputKind, SimulatorParameter};
pub use diagnose::{Question, Span, Verified, diagnose, error_over};
pub use drive::{Drive, Stretch, WINDOW_S, Window};
pub use error::SimulatorError;
pub use export::{ExportError, Exported, Target, export};
pub use file::{Bounds, ForwardSpeed, Reference, SimulatorFile};
pub use model::{Model, Point, Residuals};
pub use outcome::{
    Estimate, GapBudget, GapStep, Invisible, Mechanism, MissingTerm, Place, RankedEffect, Reason,
    SimulatorDiagnosis, SimulatorUse, Site, Sized, UnitError, Verdict, Where,
};
pub use patch::{Patch, patch};
pub use pool::{Roll, Simulator};
pub use server::{Stepped, serve};
