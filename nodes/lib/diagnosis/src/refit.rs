//! Candidates fitted on top of a model: a first look at each, then the best of them to the end.

use gripsight_estimation::Windows;
use gripsight_model::{EffectId, Window};
use rayon::prelude::*;

use crate::engine::Engine;
use crate::screen::Screened;
use crate::select::thresholds;
use crate::state::State;

/// A candidate, refitted.
#[derive(Debug, Clone)]
pub(crate) struct Refit {
    pub(crate) effect: EffectId,
    pub(crate) state: State,
    /// Drop of the cost against the model without it.
    pub(crate) gain: f64,
    /// The same over its standard deviation between blocks.
    pub(crate) z: f64,
    /// Size over the size that matters.
    pub(crate) relative_size: f64,
}

/// How much lower the cost of `b` is, and how sure that is: the t statistic over blocks of the signed roots of the differences. The roots keep a
/// gain that is everywhere, but large in one place, from looking unsure. What the priors make of the difference is spread over the blocks.
pub(crate) fn difference(windows: &Windows, a: &State, b: &State) -> (f64, f64) {
    let prior = |s: &State| s.cost - s.window_costs.iter().sum::<f64>();
    let each = (prior(a) - prior(b)) / windows.windows.len().max(1) as f64;
    let mut blocks: Vec<(usize, f64)> = Vec::new();
    for (k, &block) in windows.block.iter().enumerate() {
        let d = a.window_costs[k] - b.window_costs[k] + each;
        match blocks.last_mut().filter(|l| l.0 == block) {
            Some(last) => last.1 += d,
            None => blocks.push((block, d)),
        }
    }
    let n = (blocks.len() as f64).max(2.0);
    let sum: f64 = blocks.iter().map(|b| b.1).sum();
    let roots: Vec<f64> = blocks.iter().map(|b| b.1.abs().sqrt().copysign(b.1)).collect();
    let mean = roots.iter().sum::<f64>() / n;
    // The root of a difference of chi-squares varies by about one from noise alone.
    let variance = roots.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (n - 1.0) + 1.0;
    (sum, mean / (variance / n).sqrt())
}

/// A first look at one candidate on top of a state: a few steps from the linear step, and from its own starts; the best counts.
pub(crate) fn first_look(
    engine: &Engine<'_>,
    state: &State,
    screened: &Screened,
    windows: &Windows,
    extra: &[Vec<f64>],
) -> Option<State> {
    /// Steps more for a look that ends above the model without the effect.
    const ON_ITS_WAY: usize = 8;
    let effect = screened.effect;
    let spec = effect.spec();
    // Where the derivative at the null says nothing, starts are guesses: one step tells which is best, and it takes more to get anywhere.
    let [first_steps, further_steps] = if spec.flat_at_null { [1, 3] } else { [2, 0] };
    let clamp = |values: Vec<f64>| -> Vec<f64> {
        values
            .into_iter()
            .zip(spec.parameters)
            .map(|(v, p)| {
                let size = engine.size(p);
                v.clamp(p.null + p.range[0] * size, p.null + p.range[1] * size)
            })
            .collect()
    };
    let from = state.of(effect).map_or_else(|| engine.absent(effect), <[f64]>::to_vec);
    let mut starts: Vec<Vec<f64>> = extra.to_vec();
    if !spec.flat_at_null {
        starts.push(clamp(from.iter().zip(&screened.step).map(|(v, s)| v + s).collect()));
    }
    if extra.is_empty() {
        for m in spec.starts.iter().filter(|m| **m != 0.0) {
            starts.push(clamp(spec.parameters.iter().map(|p| p.null + m * engine.size(p)).collect()));
        }
    }
    let mut named = state.named.clone();
    named.push(effect);
    let look = |values: &[f64], from: &[[f64; 2]], steps| {
        engine.look(&named, values, Some(from.to_vec()), windows, steps)
    };
    let on = |s: State, steps: usize| look(&s.parameters, &s.starts, steps);
    let best = starts
        .iter()
        .map(|own| {
            let change: Vec<f64> = own.iter().zip(&from).map(|(to, from)| to - from).collect();
            let mut values = engine.carry(&screened.with_rest_along(state, &change), &named);
            let place = values.len() - own.len();
            values[place..].copy_from_slice(own);
            let bounds = engine.parameters(&named, &engine.layout(&named), &values, 1.0);
            values.iter_mut().zip(&bounds).for_each(|(v, p)| *v = v.clamp(p.low, p.high));
            look(&values, &state.starts, first_steps)
        })
        .filter(|s| s.finite)
        .min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    let best = if further_steps > 0 { on(best, further_steps) } else { best };
    // With one parameter more it cannot end above the model without: it is on its way still.
    let best = if best.cost > state.cost { on(best, ON_ITS_WAY) } else { best };
    best.finite.then_some(best)
}

/// Fits to the end those of the first looks that may still win.
pub(crate) fn refits(engine: &Engine<'_>, state: &State, looks: Vec<State>, windows: &Windows) -> Vec<Refit> {
    const STEPS: usize = 5;
    let mut looks = looks;
    looks.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let best = looks.first().map_or(0.0, |s| s.cost);
    looks
        .into_par_iter()
        .enumerate()
        .map(|(i, look)| {
            let close = look.cost - best < thresholds::OUT_OF_REACH * (state.cost - best).max(0.0);
            let done = if i < thresholds::FINALISTS && close {
                engine.fit(&look.named, &look.parameters, Some(look.starts.clone()), windows, STEPS)
            } else {
                look
            };
            let effect = done.named[done.named.len() - 1];
            let (gain, z) = difference(windows, state, &done);
            let relative_size = relative_size(engine, effect, done.of(effect).unwrap_or(&[]));
            Refit { effect, gain, z, relative_size, state: done }
        })
        .collect()
}

/// How far the largest parameter is from its absence over its size; of effects whose later parameters only place them, the first.
pub(crate) fn relative_size(engine: &Engine<'_>, effect: EffectId, own: &[f64]) -> f64 {
    own.iter()
        .zip(engine.absent(effect).iter().zip(effect.spec().parameters))
        .take(effect.sizing())
        .map(|(v, (absent, p))| ((v - absent) / engine.size(p)).abs())
        .fold(0.0, f64::max)
}

/// Starts of a patch: the places of the lap where more grip than elsewhere is missing, if a first step there promises more than `worth`.
pub(crate) fn patch_starts(
    engine: &Engine<'_>,
    state: &State,
    windows: &Windows,
    worth: f64,
) -> Vec<Vec<f64>> {
    const PLACES: usize = 12;
    let spec = EffectId::LowGripPatch.spec();
    let length = 0.6 / PLACES as f64 * 1.5;
    let mut effects = state.effects.clone();
    effects.push(EffectId::LowGripPatch);
    let mut found: Vec<(f64, f64)> = (0..PLACES)
        .map(|i| {
            let start = i as f64 / PLACES as f64;
            let mut values = state.parameters.clone();
            values.extend([0.0, start, length]);
            let depth = state.parameters.len();
            let near = passing(engine, windows, start + 0.5 * length, length);
            let starts: Vec<[f64; 2]> = near.iter().map(|&k| state.starts[k]).collect();
            let (gradient, information) =
                engine.slope(&effects, &values, depth, &starts, &windows.picked(&near));
            let gain = if gradient < 0.0 { gradient * gradient / information.max(1e-9) } else { 0.0 };
            (gain, start)
        })
        .collect();
    found.retain(|(gain, _)| *gain > worth);
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let depth = engine.size(&spec.parameters[0]);
    found.iter().take(3).map(|&(_, start)| vec![depth, start, length]).collect()
}

/// The windows that come nearer to a place of the lap than `near`, all as shares of it: only they feel what is there.
fn passing(engine: &Engine<'_>, windows: &Windows, place: f64, near: f64) -> Vec<usize> {
    let away = |share: f64| (share - place - (share - place).round()).abs();
    let passes = |window: &Window| {
        let shares = &engine.recording.runs[window.segment].lap_share;
        shares[window.from..window.from + window.len].iter().any(|&share| away(share) < near)
    };
    (0..windows.windows.len()).filter(|&k| passes(&windows.windows[k])).collect()
}
