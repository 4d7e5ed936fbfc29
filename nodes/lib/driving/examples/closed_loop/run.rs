//! One run: a car on a road that it does not know, some laps.

use anyhow::Result;
use gripsight_driving::{Controller, TireSet};
use gripsight_identification::FrictionPrior;
use gripsight_reference_car::CarParameters;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::drive::Loop;
use crate::plant;
use crate::referee::Lap;

/// What the driver may know.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Variant {
    /// The start's tires for ever.
    None,
    /// What is identified while driving.
    NoPrior,
    /// The same with a friction prior as good as the camera's model card says: error 0.10.
    Prior,
    /// With a prior 0.3 too high.
    LieHigh,
    /// With a prior 0.3 too low.
    LieLow,
    /// The plant's tires, projected on Phi_p.
    True,
}

impl Variant {
    pub(crate) const ALL: [Self; 6] =
        [Self::None, Self::NoPrior, Self::Prior, Self::LieHigh, Self::LieLow, Self::True];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::NoPrior => "identified",
            Self::Prior => "with_prior",
            Self::LieHigh => "prior_too_high",
            Self::LieLow => "prior_too_low",
            Self::True => "true_tires",
        }
    }

    /// The prior, where there is one.
    pub(crate) fn prior(self, mu: f64, seed: u64) -> Option<FrictionPrior> {
        /// Root mean square error of the camera on held-out roads (its model card).
        const CAMERA_ERROR: f64 = 0.10;
        const LIE: f64 = 0.3;
        let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x0ca3_e4a5);
        let off = CAMERA_ERROR * 3.0_f64.sqrt() * random.random_range(-1.0..1.0);
        let prior = |mu: f64| Some(FrictionPrior { mu: mu.max(0.1), sigma: CAMERA_ERROR });
        match self {
            Self::None | Self::NoPrior | Self::True => None,
            Self::Prior => prior(mu + off),
            Self::LieHigh => prior(mu + LIE),
            Self::LieLow => prior(mu - LIE),
        }
    }
}

/// What is driven.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    pub(crate) car: CarParameters,
    pub(crate) track: String,
    pub(crate) mu: f64,
    pub(crate) seed: u64,
    pub(crate) laps: usize,
    /// The plant's tires.
    pub(crate) tires: TireSet,
    /// Who steers.
    pub(crate) controller: Controller,
}

/// What a run gave.
#[derive(Debug, Clone)]
pub(crate) struct Run {
    pub(crate) laps: Vec<Lap>,
    /// From the first corner to the first set.
    pub(crate) first_set_s: Option<f64>,
    /// Windows identified, and those in which the grip was said to have changed.
    pub(crate) looks: [u32; 2],
    /// Why it ended early.
    pub(crate) wreck: Option<&'static str>,
}

/// Drives it.
pub(crate) fn drive(case: &Case, variant: Variant, verbose: bool) -> Result<Run> {
    let start = if variant == Variant::True { case.tires } else { TireSet::start() };
    let mut run = Loop::new(case, start, verbose)?;
    if variant == Variant::True {
        run.driver.take_longitudinal(plant::told(&case.car, case.mu));
    }
    if !matches!(variant, Variant::None | Variant::True) {
        run.learn(variant.prior(case.mu, case.seed));
    }
    let longest_s = 4.0 * case.laps as f64 * run.referee.fastest_lap_s();
    let mut wreck = None;
    while wreck.is_none() && run.referee.laps.len() < case.laps {
        wreck = run.look()?;
        if run.sim.time_s() > longest_s {
            wreck = wreck.or(Some("too slow"));
        }
    }
    let looks = run.learner.as_ref().map_or([0; 2], |learner| [learner.looks, learner.told_changed]);
    Ok(Run { looks, first_set_s: run.referee.first_set_s, laps: run.referee.laps, wreck })
}
