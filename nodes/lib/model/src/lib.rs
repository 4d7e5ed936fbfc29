//! THE car model: a single-track car with its sensors, the library of candidate effects, and flexible terms, on a recording.
//!
//! [`Recording`] is the telemetry as models see it: even stretches ([`Run`]), the channels to be explained ([`Channel`]), the noise of each
//! ([`noise`]), places on the course ([`Laps`]), kinematic identities ([`Identity`]). [`ExtendedModel`] is `gripsight_vehicle`'s single-track model
//! with effects ([`EffectId`]) at their sizes, run over a [`Window`] for any number type ([`Rollout`]); [`Flexible`] are free terms of each
//! place in which a cause can sit, [`Correction`] what somebody has learned beside. What fits all this is in `gripsight_estimation`.
//!
//! Two things a single-track model leaves out go with the effects, at constants any car roughly has: what pushes along the road turns the
//! wheels, too, and a tire carries less per load the more it is loaded. Both are nothing where the command alone pushes and the loads
//! are those at rest.
//!
//! # Adding an effect
//!
//! An effect is one file in `effects/` with a type that implements [`Effect`]: its [`EffectSpec`] (name, equation, source, sites, parameters with
//! units, null value, bounds, size that matters, what must be recorded and driven, and whatever rule concerns this effect alone) and the hooks
//! that it needs, written for any `Real`, so that derivatives are exact. Say, a constant side force F_y = c m (a crab wind):
//!
//! ```ignore
//! pub(super) struct SideForce;
//!
//! impl Effect for SideForce {
//!     const SPEC: EffectSpec = spec(
//!         "side_force",
//!         "v_y' += c",
//!         "steady cross wind, to first order",
//!         "straights in both directions",
//!         &[Site::RoadAndWind],
//!         &[both_sides("c_mps2", "m/s2", [0.3, 0.3])],
//!     );
//!
//!     fn motion<T: Real>(p: &[T], _car: &Car<T>, _at: &Moment<T>, motion: &mut Motion<T>) {
//!         motion.force_y_mps2 += p[0];
//!     }
//! }
//! ```
//!
//! Two lines in `effects/mod.rs`, the file's and one in the list `library!`, add it to the search, the file format, `--without` and the tests:
//! at its null value it must leave the nominal model exactly as it was. If its derivative vanishes there, say `flat_at_null` and give `starts`.

mod car_file;
mod correction;
mod drive;
mod effective;
mod effects;
mod error;
mod flexible;
mod identities;
mod longitudinal_force;
mod model;
mod motion;
pub mod noise;
mod recording;
mod road_wheels;
mod rollout;
mod site;
mod smooth;
mod station;
mod terms;

pub use car_file::CarFile;
pub use correction::{Correction, CorrectionStream};
pub use drive::{Along, Controls, Drive, Driven, DrivenCar};
pub use effective::effective_tires;
pub use effects::{
    Effect, EffectId, EffectSpec, Figure, Lagging, Need, OutsideTerm, ParameterSpec, Reported, Unknown,
    Usual, Wheels,
};
pub use error::ModelError;
pub use flexible::{Flexible, Group};
pub use identities::{HEADING, Identity, LATERAL};
pub use model::{BASE, ExtendedModel, HOLD, TIRES};
pub use recording::{Channel, NEEDED_S, Recording, Run, WINDOW_S};
pub use rollout::{Rollout, Window, tile};
pub use site::Site;
pub use smooth::{local_quadratic, median, quantile};
pub use station::Laps;
pub use terms::{Axle, Axles, Car, Moment, Motion, Outputs};
