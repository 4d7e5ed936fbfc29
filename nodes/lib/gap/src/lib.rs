//! The sim-to-real gap: where it lies, which effect causes it, how far it shrinks.
mod diagnose;
mod effects;
mod engine;
mod error;
mod evaluate;
mod flexible;
mod identities;
mod model;
mod motion;
mod noise;
mod outcome;
mod pictures;
mod place;
mod recording;
mod screen;
mod select;
mod smooth;
mod station;
mod terms;
mod text;
mod verdict;
mod windows;

pub use diagnose::{Request, diagnose};
pub use effects::{Effect, EffectId, EffectSpec, Need, ParameterSpec, Reported};
pub use engine::TireTrust;
pub use error::GapError;
pub use evaluate::Estimate;
pub use identities::Identity;
pub use outcome::{
    DetectionLimit, Diagnosis, EffectParameter, GapBudget, Invisible, Place, RankedEffect, Series, TirePair, Verdict, Where,
};
pub use recording::{Channel, Recording};
pub use terms::{Axle, Axles, Car, Moment, Motion, Outputs};
pub mod probe;
