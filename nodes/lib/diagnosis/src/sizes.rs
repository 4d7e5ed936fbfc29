//! Sizes of effects with their intervals.

use gripsight_model::EffectId;
use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::engine::Engine;
use crate::outcome::EffectParameter;
use crate::state::State;

/// Half width of a 90 % interval in standard deviations.
const NINETY: f64 = 1.645;
/// What the scatter between blocks misses, errors of the model that all blocks share: a factor on the standard error, a share of the size, and a share of a
/// size that matters, as a model's own errors do not shrink with the effect. With these and the drift 9 of 10 sizes of development
/// cases lie in their intervals, small and large ones, sure and unsure ones alike (2026-11-21, tests/results/withheld).
const WIDER: f64 = 1.5;
const SHARE: f64 = 0.04;
const SHARE_OF_UNIT: f64 = 0.04;

/// Parameters of an effect as reported, with 90 % intervals; `drift` is how far its size drifts between data, as a share of it.
pub(crate) fn sizes(
    engine: &Engine<'_>,
    state: &State,
    effect: EffectId,
    drift: f64,
    blocks: &[usize],
) -> BTreeMap<&'static str, EffectParameter> {
    let spec = effect.spec();
    let Some(own) = state.of(effect) else { return BTreeMap::new() };
    let halves = half_widths(engine, state, effect, drift, blocks);
    let given = engine.given(effect);
    if spec.reported.is_empty() {
        return spec
            .parameters
            .iter()
            .enumerate()
            .zip(own.iter().zip(&halves))
            .map(|((i, r), (v, half))| {
                let before = given.map(|given| given[i]);
                (r.name, EffectParameter { value: *v, low: v - half, high: v + half, unit: r.unit, before })
            })
            .collect();
    }
    spec.reported
        .iter()
        .map(|r| {
            let value = (r.value)(own);
            // Ends from moving each fitted parameter by its own interval.
            let (mut low, mut high) = (value, value);
            for i in 0..own.len() {
                for sign in [-1.0, 1.0] {
                    let mut moved = own.to_vec();
                    moved[i] += sign * if halves[i].is_finite() { halves[i] } else { 0.0 };
                    let v = (r.value)(&moved);
                    low = low.min(v);
                    high = high.max(v);
                }
            }
            (r.name, EffectParameter { value, low, high, unit: r.unit, before: given.map(r.value) })
        })
        .collect()
}

/// Whether a parameter that shapes the effect is held by its upper bound: a lag that wants less damping than any servo has is no lag.
pub(crate) fn is_misshapen(state: &State, effect: EffectId) -> bool {
    let Some(own) = state.of(effect) else { return false };
    let from = state.rows(effect).start;
    let held = |i: usize| state.is_held(from + i) && own[i] > effect.spec().parameters[i].null;
    !effect.is_of_a_place() && (effect.sizing()..own.len()).any(held)
}

/// Whether a size is told by the data: one at least of the parameters that size the effect has an interval without the value at which it is
/// absent, none is held by its bound, and the effect is not misshapen. What sits in one part of the lap is in few blocks: their scatter says nothing.
pub(crate) fn is_told(
    engine: &Engine<'_>,
    state: &State,
    effect: EffectId,
    drift: f64,
    blocks: &[usize],
) -> bool {
    let Some(own) = state.of(effect) else { return false };
    let halves = half_widths(engine, state, effect, drift, blocks);
    let absent = engine.absent(effect);
    let from = state.rows(effect).start;
    let sizing = effect.sizing();
    let away = |i: usize| own[i] - absent[i];
    let held = |i: usize| state.is_held(from + i) && away(i).abs() > 1e-9 && !state.is_gone(effect, from + i);
    let told = effect.is_of_a_place() || (0..sizing).any(|i| away(i).abs() > halves[i]);
    told && !is_misshapen(state, effect) && !(0..sizing).any(held)
}

/// Half widths of the 90 % intervals of an effect's parameters.
fn half_widths(
    engine: &Engine<'_>,
    state: &State,
    effect: EffectId,
    drift: f64,
    blocks: &[usize],
) -> Vec<f64> {
    let rows = state.rows(effect);
    let recording = engine.recording;
    let unknown =
        |size: f64| effect.spec().unknown.sigma(size, recording.dt_s(), recording.typical_speed_mps());
    rows.clone()
        .zip(effect.spec().parameters)
        .map(|(j, spec)| {
            let error = standard_error(state, rows.clone(), j, blocks);
            let size = state.parameters[j] - spec.null;
            NINETY * spread(error, size, engine.size(spec), drift).hypot(unknown(size))
        })
        .collect()
}

/// Standard deviation of a size from the standard error of its fit, a size that matters, and its drift.
fn spread(error: f64, size: f64, unit: f64, drift: f64) -> f64 {
    (WIDER * error).hypot(SHARE * size).hypot(SHARE_OF_UNIT * unit).hypot(drift * size)
}

/// Standard error of parameter `j`, robust to errors that are alike within a block: a sandwich with blocks as clusters. Parameters on a
/// bound count as known, but for the effect's `own`: a size on its bound has an interval, too.
fn standard_error(state: &State, own: Range<usize>, j: usize, blocks: &[usize]) -> f64 {
    let Some(fit) = &state.fit else { return f64::NAN };
    let all = &fit.linearization;
    let kept: Vec<(usize, usize)> = (state.free.iter().copied().enumerate())
        .filter(|(_, k)| own.contains(k) || !fit.on_bound.contains(k))
        .collect();
    let Some(place) = kept.iter().position(|(_, k)| *k == j) else { return f64::NAN };
    let n = kept.len();
    let information = DMatrix::from_fn(n, n, |a, b| all.information[(kept[a].0, kept[b].0)]);
    let Some(cholesky) = information.cholesky() else { return f64::NAN };
    let mut unit = DVector::zeros(n);
    unit[place] = 1.0;
    let direction = cholesky.solve(&unit);
    let (mut sum, mut clusters, mut at) = (0.0, 0.0, 0);
    while at < all.window_gradients.len() {
        let block = blocks.get(at);
        let mut score = 0.0;
        while at < all.window_gradients.len() && blocks.get(at) == block {
            score += kept
                .iter()
                .zip(direction.iter())
                .map(|(k, d)| all.window_gradients[at][k.0] * d)
                .sum::<f64>();
            at += 1;
        }
        sum += score * score;
        clusters += 1.0;
    }
    // With few clusters the sum is too small by what the fit itself has taken from it.
    (sum * clusters / f64::max(clusters - 1.0, 1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_of_a_size_is_limited_by_its_fit_its_drift_and_the_model() {
        let of = |error: f64, size: f64, drift: f64| spread(error, size, 1.0, drift);
        // Between a tenth and the whole of a size that matters the model's errors take over from the size's share.
        approx::assert_relative_eq!(of(0.0, 0.1, 0.0), 0.0402, epsilon = 1e-4);
        approx::assert_relative_eq!(of(0.0, 1.0, 0.0), 0.0566, epsilon = 1e-4);
        assert!(of(0.1, 1.0, 0.0) > 2.0 * of(0.0, 1.0, 0.0));
        // A size that is half as large elsewhere is not known to a quarter.
        assert!(of(0.0, 1.0, 0.5) > 0.5);
        assert_eq!(of(0.1, -1.0, 0.2), of(0.1, 1.0, 0.2));
    }
}
