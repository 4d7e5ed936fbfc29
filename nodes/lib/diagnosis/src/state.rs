//! A model with its parameters: as it was handed over, as it was fitted, as it was scored.

use gripsight_model::{BASE, EffectId, TIRES, tires_from_parameters};
use std::ops::Range;

use gripsight_estimation::shooting::Fit;
use gripsight_vehicle::PacejkaParameters;

/// A model with its parameters fitted.
#[derive(Debug, Clone)]
pub(crate) struct State {
    /// Effects that are claimed.
    pub(crate) named: Vec<EffectId>,
    /// All of the model: the background that is not claimed, what was handed over, then those that are claimed.
    pub(crate) effects: Vec<EffectId>,
    pub(crate) parameters: Vec<f64>,
    /// Places of the parameters that its fit moved.
    pub(crate) free: Vec<usize>,
    pub(crate) starts: Vec<[f64; 2]>,
    pub(crate) cost: f64,
    pub(crate) window_costs: Vec<f64>,
    /// Residuals that its fit counted.
    pub(crate) residuals: f64,
    pub(crate) finite: bool,
    /// The problem around it, where it was fitted to the end.
    pub(crate) fit: Option<Box<Fit>>,
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

    /// Whether a parameter is held by a bound.
    pub(crate) fn is_held(&self, place: usize) -> bool {
        self.fit.as_ref().is_some_and(|f| f.on_bound.contains(&place))
    }

    /// Whether a parameter of an effect is at its null, where bounds hold it too: that is a size like any other.
    pub(crate) fn is_gone(&self, effect: EffectId, place: usize) -> bool {
        let null = place.checked_sub(self.rows(effect).start).and_then(|i| effect.spec().parameters.get(i));
        null.is_some_and(|p| (self.parameters[place] - p.null).abs() < 1e-9)
    }

    pub(crate) fn tires(&self) -> PacejkaParameters {
        tires_from_parameters(&self.parameters[..TIRES])
    }
}

/// The model as it was handed over.
#[derive(Debug, Clone)]
pub(crate) struct Nominal {
    pub(crate) effects: Vec<EffectId>,
    pub(crate) parameters: Vec<f64>,
}
