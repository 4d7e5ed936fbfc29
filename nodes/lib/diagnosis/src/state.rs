//! A model with its parameters: as it was handed over, as it was fitted, as it was scored.

use gripsight_model::{BASE, EffectId, TIRES};
use std::ops::Range;

use gripsight_vehicle::OwnTires;

/// A model with its parameters fitted.
#[derive(Debug, Clone)]
pub(crate) struct State {
    /// Effects that are claimed, and what stands in beside them for others.
    pub(crate) named: Vec<EffectId>,
    /// All of the model: the background that is not claimed, what was handed over, then those that are claimed.
    pub(crate) effects: Vec<EffectId>,
    pub(crate) parameters: Vec<f64>,
    pub(crate) starts: Vec<[f64; 2]>,
    pub(crate) cost: f64,
    pub(crate) finite: bool,
}

impl State {
    /// Places of an effect's parameters; after all others where it does not have it.
    pub(crate) fn rows(&self, effect: EffectId) -> Range<usize> {
        let before = self.effects.iter().take_while(|e| **e != effect);
        let from = BASE + before.map(|e| e.spec().parameters.len()).sum::<usize>();
        from..from + effect.spec().parameters.len()
    }

    /// Parameters of one of its effects.
    pub(crate) fn of(&self, effect: EffectId) -> Option<&[f64]> {
        self.parameters.get(self.rows(effect))
    }

    pub(crate) fn tires(&self) -> OwnTires {
        OwnTires::from_parameters(&self.parameters[..TIRES])
    }
}

/// The model as it was handed over.
#[derive(Debug, Clone)]
pub(crate) struct Nominal {
    pub(crate) effects: Vec<EffectId>,
    pub(crate) parameters: Vec<f64>,
}
