//! The figures that a team states of its car, with what the data say of them.

use gripsight_model::EffectId;
use serde::Serialize;

use crate::engine::Engine;
use crate::inferred::Inferred;
use crate::sizes::with_half_widths;

/// Half widths of its interval by which a figure that is fitted along misses what is stated to be contradicted: the prior holds it back, so that
/// data pull it that far only by much.
const CONTRADICTED: f64 = 2.0;

/// A figure of the car with what the data say of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FigureAnswer {
    /// Name as in the vehicle file, unit included; of a sensor's scale the signal's.
    pub name: &'static str,
    /// What is stated; unknown (`null`) where nothing is.
    pub stated: Option<f64>,
    /// What the data, and what is usual of such cars, say.
    pub value: f64,
    /// Lower end of its 90 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Whether the data contradict what is stated.
    pub contradicted: bool,
}

/// All figures that the model has an error of.
pub(crate) fn figures(engine: &Engine<'_>, inferred: &Inferred) -> Vec<FigureAnswer> {
    let of = |effect: EffectId| {
        let figure = effect.spec().figure?;
        let sized = inferred.sizes.effect(&inferred.columns, effect)?;
        let (own, half) = *with_half_widths(engine, effect, &sized).first()?;
        let value = |p: f64| (figure.value)(engine.vehicle, p);
        let ends = [value(own - half), value(own + half)];
        let stated = (figure.stated)(engine.vehicle);
        let far =
            stated.is_some_and(|s| (value(own) - s).abs() > CONTRADICTED * 0.5 * (ends[1] - ends[0]).abs());
        Some(FigureAnswer {
            name: figure.name,
            stated,
            value: value(own),
            low: ends[0].min(ends[1]),
            high: ends[0].max(ends[1]),
            contradicted: far && (effect.spec().is_nuisance || inferred.is_accepted(effect)),
        })
    };
    EffectId::ALL.iter().copied().filter_map(of).filter(|f| f.value.is_finite()).collect()
}
