//! The sim-to-real gap: where it lies, which effect causes it, how far it shrinks.
//!
//! "Sim" is the single-track model of `gripsight_vehicle` on given tires, "real" a recording. [`diagnose`] goes this way:
//!
//! 1. [`Recording`](gripsight_model::Recording): even stretches, channels, noise of each channel, laps, kinematic identities
//!    ([`Identity`](gripsight_model::Identity)).
//! 2. Windows of 0.5 s with free starts (`gripsight_estimation::shooting`). The null is retuned first: the tires, under a stated
//!    [`TireTrust`], and what every car does a little of (load transfers, relaxation, combined slip, an uncertain yaw inertia), each within
//!    what is usual for the car. Without that background every car shows a gap, and stand-ins are named for it.
//! 3. One Jacobian of all candidates ranks the effects of the library ([`EffectId`](gripsight_model::EffectId)); the best are refitted jointly
//!    with the null's parameters from several starts; the null is refitted from the winner. The best that is certain, believable in size and
//!    closes enough of what remains is taken; then the search goes on from there. An effect that a later one explains is dropped, and each
//!    that is left is put up against all others once more, with the rest of the model in place ([`Look`]).
//! 4. What the retuned tires and the effects leave is looked at room by room ([`Unexplained`]): steering, sensors, lateral and longitudinal
//!    forces, road and wind each have free terms (impulse responses, curves, places) that can do roughly what any cause there does. An effect
//!    that is the cause leaves them nothing; a stand-in does. How much they explain over what the effect explains, how far its size drifts
//!    between this and held-out data and between parts of this, what its own room still finds, its size and its twins give the chance that
//!    it is the cause by a logistic regression; below even odds an effect is a candidate, not a name. Effects that do nearly the same are
//!    declared ([`EffectSpec::alike`](gripsight_model::EffectSpec::alike)): where such a one is not among the candidates, name and chance are
//!    shared. Where nothing is named, what the rooms explain tells "none of these" from a retune.
//! 5. Open-loop rollouts of 1 s on held-out blocks (or another bag): nominal, retuned, with the effects, with all free terms on top (the
//!    ceiling), with the residual network of `gripsight_s4` in place of effects, against the noise. Effects that reach too little of the ceiling
//!    are not named.
//!
//! Intervals of sizes use blocks of 4 s as clusters and add the size's drift, and shares of the size and of a size that matters for errors of
//! the model that all blocks share; those shares, and all thresholds (`select::thresholds`, `confidence`), were fixed on development drives
//! of the reference car.

mod around;
mod budget;
mod changes;
mod confidence;
mod correct;
mod decisions;
mod diagnose;
mod earlier;
mod engine;
mod error;
mod extended_file;
mod finding;
mod graded;
mod hypotheses;
mod infer;
mod joint;
mod noise;
mod outcome;
mod patch;
mod pictures;
mod place;
mod plausible;
mod priors;
mod refit;
mod residual;
mod rooms;
mod screen;
mod search;
mod select;
mod sizes;
mod state;
mod stated;
#[cfg(test)]
mod testing;
mod transfer;
mod trust;
mod usable;
mod verdict;

pub use correct::without_effects;
pub use diagnose::{Request, diagnose};
pub use earlier::Earlier;
pub use error::GapError;
pub use extended_file::ExtendedModelFile;
pub use graded::{Change, Graded, MechanismAnswer, SiteAnswer, SizedEffect, graded};
pub use outcome::{
    Comparison, DetectionLimit, Diagnosis, EffectParameter, GapBudget, GapStep, Invisible, Look, Place,
    Prediction, RankedEffect, Series, TirePair, Unexplained, Verdict, Where,
};
pub use trust::TireTrust;
