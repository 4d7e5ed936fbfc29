//! The sim-to-real gap: where it lies, which effect causes it, how far it shrinks.
//!
//! "Sim" is the single-track model of `gripsight_vehicle` on given tires, "real" a recording. [`diagnose`] goes this way:
//!
//! 1. [`Recording`](gripsight_model::Recording): even stretches, channels, noise of each channel, laps, kinematic identities
//!    ([`Identity`](gripsight_model::Identity)).
//! 2. Windows of 0.5 s with free starts (`gripsight_estimation::shooting`). The null is retuned first: the tires, under a stated
//!    [`TireTrust`], and what every car does a little of (load transfers, relaxation, combined slip, an uncertain yaw inertia).
//! 3. One inference (`infer`): tires, every effect of the library ([`EffectId`](gripsight_model::EffectId)) and flexible terms of each site are
//!    hypotheses in one comparison, under one noise model. It gives the probability that each matters; the most probable model is fitted by
//!    rollouts, everything is linearised anew around it, and what rollouts find needless goes.
//! 4. Held-out data multiply the odds (`stated`): free terms that they do not need go, an effect takes the place of its site's where it does as well,
//!    effects that they make likely come in, effects that they make unlikely go. What is left is named from a chance of being a cause on, which a fit
//!    on open development cases gives, unless it is small beside what looks like it and no effect of the library does. Whatever the verdict,
//!    [`Diagnosis::sites`] says how likely something is the matter where.
//! 5. Open-loop rollouts of 1 s on held-out blocks (or another bag): nominal, retuned, with the effects, with flexible terms on top (the
//!    ceiling), with the residual network of `gripsight_s4` in place of effects, against the noise. What surely makes these errors larger beside the others is
//!    not named. Where nothing is named and much more is left than in drives without any effect, something is missing that no effect does.
//! 6. Two drives are compared by differences ([`Earlier`], `changes`): every parameter is in both, and only what one has and the other has not
//!    is a change, whatever either leaves unexplained.
//!
//! 7. Several drives of one car in one state ([`Together`]) are explained as one, and each is then compared with all of them as in 6. Where one contradicts,
//!    each is compared with the drive that most of them agree with, and only those that agree are explained.
//!
//! Every number that the answer rests on stands in `decisions`.

mod answer;
mod around;
mod between;
mod budget;
mod changes;
mod columns;
mod correct;
mod decisions;
mod diagnose;
mod discrepancy;
mod drives;
mod earlier;
mod engine;
mod error;
mod extended_file;
mod figures;
mod finding;
mod frame;
mod hypotheses;
mod infer;
mod inferred;
mod joint;
mod moves;
mod near;
mod noise;
mod outcome;
mod paired;
mod patch;
mod pictures;
mod place;
mod plausible;
mod posterior;
mod predictive;
mod priors;
mod pruned;
mod residual;
mod sizes;
mod state;
mod stated;
mod statement;
#[cfg(test)]
mod testing;
mod tire_change;
mod trust;
mod usable;
mod verdict;

pub use answer::{Change, MechanismAnswer, SiteAnswer};
pub use correct::without_effects;
pub use diagnose::{Request, diagnose};
pub use drives::{DriveAnswer, Together};
pub use earlier::Earlier;
pub use error::GapError;
pub use extended_file::ExtendedModelFile;
pub use figures::FigureAnswer;
pub use outcome::{
    DetectionLimit, Diagnosis, EffectParameter, GapBudget, GapStep, Inference, Invisible, Place, Prediction,
    RankedEffect, Series, TirePair, Verdict, Where,
};
pub use posterior::own_tires;
pub use trust::TireTrust;
