//! S4D layer with analytic gradients, residual networks and their trainer.

mod config;
mod error;
mod layers;
mod network;
mod normalization;
mod pipeline;
mod training;

pub use config::{Architecture, NetworkConfig};
pub use error::Error;
pub use layers::{ParameterBlock, ParameterGroup};
pub use network::{Gradients, ResidualNetwork, StreamState};
pub use normalization::Normalization;
pub use training::{
    Evaluation, Progress, Schedule, Sequence, StopReason, TrainingConfig, TrainingReport, TrainingSet, train,
};
