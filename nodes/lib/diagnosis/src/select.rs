//! Which effects: joint refits of the best candidates, one effect after the other, each judged by what it closes of what remains.

use gripsight_estimation::Windows;
use gripsight_model::{EffectId, Rollout, median};
use rayon::prelude::*;

use crate::engine::Engine;
use crate::refit::{Refit, difference, first_look, patch_starts, refits};
use crate::screen::{Screened, Screening, screen};
use crate::sizes::is_misshapen;
use crate::state::State;

/// Thresholds of the decisions. Fixed on development cases of the reference car (seeds below 1000); see `tests/results/gap`.
pub(crate) mod thresholds {
    /// Candidates refitted in the first round, and in later rounds.
    pub(crate) const REFITS: [usize; 2] = [9, 6];
    /// How many of them are fitted to the end, and how far behind the best, in shares of its gain, they may lie after a first look.
    pub(crate) const FINALISTS: usize = 4;
    pub(crate) const OUT_OF_REACH: f64 = 0.5;
    /// Candidates that promise less than this share of the best one's gain, or of the cost, are not refitted.
    pub(crate) const WORTH_OF_BEST: f64 = 0.06;
    pub(crate) const WORTH_OF_COST: f64 = 0.01;
    /// What a step of a patch's depth must promise, as a share of that: its place and length are not fitted yet.
    pub(crate) const WORTH_OF_PATCH: f64 = 0.5;
    /// Effects taken at most.
    pub(crate) const MOST_EFFECTS: usize = 5;
    /// Weighted cost per residual that noise alone leaves.
    pub(crate) const NOISE_COST: f64 = 0.75;
    /// Drop of the weighted cost per residual below which an effect does not matter.
    pub(crate) const LEAST_GAIN: f64 = 0.012;
    /// Weighted cost per residual up to which there is no gap to explain.
    pub(crate) const SMALL_COST: f64 = 1.3;
    /// Share of the remaining weighted cost that a first and a later effect must close.
    pub(crate) const LEAST_SHARE: [f64; 2] = [0.05, 0.05];
    /// How sure it must be that a candidate beats the current model, in standard deviations over blocks: a short drive has few, and the first of
    /// two effects does worse without the other on some.
    pub(crate) const LEAST_Z: f64 = 1.0;
    /// Largest effect that is believed, over the size that matters: what needs more stands in for something else.
    pub(crate) const MOST_SIZE: f64 = 4.5;
    /// Smallest effect that is named, over the size that matters.
    pub(crate) const LEAST_SIZE: f64 = 0.1;
    /// The same for an effect that sits in one part of the lap.
    pub(crate) const LEAST_PLACE_SIZE: f64 = 0.2;
    /// The same for an effect that every car has a little of, over what is usual.
    pub(crate) const LEAST_OVER_USUAL: f64 = 1.15;
    /// Candidates whose refits cannot be told apart by this many standard deviations are confused.
    pub(crate) const CONFUSED_Z: f64 = 1.64;
    /// Candidates whose signatures are this parallel are confused.
    pub(crate) const CONFUSED_COSINE: f64 = 0.97;
    /// A candidate that gains less than this share of the best one's gain is no rival, however unsure the difference.
    pub(crate) const RIVAL_SHARE: f64 = 0.5;
    /// A candidate this near to the best one's cost, in shares of the best one's gain, counts as near.
    pub(crate) const NEAR_SHARE: f64 = 0.05;
}

/// One round of the search.
#[derive(Debug, Clone)]
pub(crate) struct Round {
    /// Refitted candidates, best first; ahead of them the best of those that may be taken.
    pub(crate) refits: Vec<Refit>,
    /// Chance that the best beats each of the others, in standard deviations.
    pub(crate) lead_z: Vec<f64>,
    pub(crate) screening: Screening,
    /// Whether the first is good enough to be taken.
    pub(crate) taken: bool,
    /// The model before it.
    pub(crate) before: State,
    /// The block of each window that it was fitted on.
    pub(crate) blocks: Vec<usize>,
}

/// Mean square of each channel's residuals over the noise variance: median over windows.
pub(crate) fn channel_excess(engine: &Engine<'_>, state: &State, windows: &Windows) -> Vec<f64> {
    let model = engine.model(&state.effects, None);
    let channels = model.channels();
    let (mut predicted, mut measured) = (Vec::new(), Vec::new());
    let mut squares: Vec<Vec<f64>> = vec![Vec::new(); channels];
    for (window, start) in windows.windows.iter().zip(&state.starts) {
        model.rollout(&state.parameters, *start, window, &mut predicted);
        model.measured(window, &mut measured);
        let mut sum = vec![0.0; channels];
        for (i, (m, y)) in measured.iter().zip(&predicted).enumerate() {
            sum[i % channels] += ((m - y) / engine.recording.sigma[i % channels]).powi(2);
        }
        for (c, s) in sum.into_iter().enumerate() {
            squares[c].push(s / window.len as f64);
        }
    }
    squares.into_iter().map(median).collect()
}

/// Share of what a model leaves unexplained that counts as noise when the next one is fitted.
const MISFIT_SHARE: f64 = 0.3;

/// Weighs the channels by their noise and a share of what the current model leaves in them.
pub(crate) fn reweigh(engine: &mut Engine<'_>, state: &State, windows: &Windows) {
    let excess = channel_excess(engine, state, windows);
    let recording = engine.recording;
    engine.sigma = recording
        .weights
        .iter()
        .zip(recording.sigma.iter().zip(excess))
        .map(|(&weight, (noise, e))| {
            if noise.is_finite() {
                weight.max(noise * (1.0 + MISFIT_SHARE * (e - 1.0).max(0.0)).sqrt())
            } else {
                weight
            }
        })
        .collect();
}

/// One round: screens, refits the best, and says whether one is taken.
pub(crate) fn round(
    engine: &Engine<'_>,
    state: &State,
    candidates: &[EffectId],
    windows: &Windows,
    number: usize,
) -> Round {
    let left: Vec<EffectId> = candidates.iter().copied().filter(|e| !state.named.contains(e)).collect();
    let visible: Vec<EffectId> = left.iter().copied().filter(|e| !e.spec().flat_at_null).collect();
    let screening = screen(engine, state, &visible, windows);
    let mut order: Vec<&Screened> = screening.candidates.iter().collect();
    order.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let count = thresholds::REFITS[number.min(1)];
    // A linear step may promise more than there is.
    let top = order.first().map_or(0.0, |s| s.gain.min(state.cost));
    let worth = (thresholds::WORTH_OF_BEST * top).max(thresholds::WORTH_OF_COST * state.cost);
    let promising = order.into_iter().take(count).enumerate().filter(|(i, s)| *i == 0 || s.gain > worth);
    let mut tried: Vec<(Screened, Vec<Vec<f64>>)> = promising.map(|(_, s)| (s.clone(), Vec::new())).collect();
    for &effect in left.iter().filter(|e| e.spec().flat_at_null) {
        let is_patch = effect == EffectId::LowGripPatch;
        let least = thresholds::WORTH_OF_PATCH * worth;
        let places = if is_patch { patch_starts(engine, state, windows, least) } else { Vec::new() };
        if !is_patch || !places.is_empty() {
            tried.push((Screened::unseen(effect), places));
        }
    }
    let looks: Vec<State> = tried
        .par_iter()
        .filter_map(|(screened, places)| first_look(engine, state, screened, windows, places))
        .collect();
    let mut refits = refits(engine, state, looks, windows);
    refits.sort_by(|a, b| score(b).total_cmp(&score(a)));
    prefer_simple(&mut refits);
    let mut before = state.clone();
    if let Some(best) = refits.first() {
        // The model without the effect may have been stuck where the winner is not.
        let values = engine.carry(&best.state, &state.named);
        let again = engine.look(&state.named, &values, Some(best.state.starts.clone()), windows, 10);
        if again.finite && again.cost < before.cost {
            before = again;
        }
    }
    for r in &mut refits {
        (r.gain, r.z) = difference(windows, &before, &r.state);
    }
    let mut round =
        Round { refits, lead_z: Vec::new(), screening, taken: false, before, blocks: windows.block.clone() };
    let before = &round.before;
    round.taken = lead(&mut round.refits, |r| acceptable(engine, r, before, number));
    round.compare(windows);
    round
}

impl Round {
    /// The best candidate.
    pub(crate) fn winner(&self) -> Option<&Refit> {
        self.refits.first()
    }

    fn compare(&mut self, windows: &Windows) {
        self.lead_z = match self.refits.first() {
            Some(best) => self.refits.iter().map(|r| difference(windows, &r.state, &best.state).1).collect(),
            None => Vec::new(),
        };
    }

    /// Puts one more candidate into its place.
    pub(crate) fn insert(&mut self, refit: Refit, windows: &Windows) -> usize {
        let place = self.refits.partition_point(|r| score(r) > score(&refit));
        self.refits.insert(place, refit);
        self.compare(windows);
        place
    }
}

/// What candidates are ranked by: the drop of the cost, less a price for every parameter.
fn score(r: &Refit) -> f64 {
    /// About the logarithm of the number of residuals: the Bayesian information criterion.
    const PRICE: f64 = 10.0;
    if r.relative_size >= thresholds::MOST_SIZE {
        return 0.0;
    }
    r.gain - PRICE * r.effect.spec().parameters.len() as f64
}

/// Of near equals the one with fewer parameters that size it wins; a shape at its bound counts as one.
fn prefer_simple(refits: &mut [Refit]) {
    let Some(best) = refits.first().map(score) else { return };
    let near = |r: &Refit| score(r) > best - thresholds::NEAR_SHARE * 0.4 * best.max(0.0);
    let count = |r: &Refit| r.effect.sizing() + usize::from(is_misshapen(&r.state, r.effect));
    if let Some(place) = (1..refits.len())
        .filter(|&i| near(&refits[i]) && count(&refits[i]) < count(&refits[0]))
        .min_by_key(|&i| (count(&refits[i]), i))
    {
        refits[..=place].rotate_right(1);
    }
}

/// Puts the best of those that may be taken ahead of what is better, but too small or too large; whether there is one.
fn lead<T>(best_first: &mut [T], may_be_taken: impl Fn(&T) -> bool) -> bool {
    let place = best_first.iter().position(may_be_taken);
    place.inspect(|&place| best_first[..=place].rotate_right(1)).is_some()
}

/// Whether a model is still needed beside a simpler one.
pub(crate) fn needed(simpler: &State, state: &State) -> bool {
    let residuals = state.residuals;
    let loss = simpler.cost - state.cost;
    let remaining = (simpler.cost - thresholds::NOISE_COST * residuals).max(0.05 * simpler.cost);
    loss > thresholds::LEAST_GAIN * residuals && loss > thresholds::LEAST_SHARE[1] * remaining
}

/// Whether the best candidate is real, big enough to matter, and closes enough of what remains.
fn acceptable(engine: &Engine<'_>, r: &Refit, before: &State, number: usize) -> bool {
    let least_size = match (engine.usual(r.effect), r.effect.spec().parameters) {
        (Some(usual), [first, ..]) => thresholds::LEAST_OVER_USUAL * usual / engine.size(first),
        _ if r.effect.is_of_a_place() => thresholds::LEAST_PLACE_SIZE,
        _ => thresholds::LEAST_SIZE,
    };
    let residuals = before.residuals;
    let remaining = (before.cost - thresholds::NOISE_COST * residuals).max(0.05 * before.cost);
    // What sits in one part of the lap is in few blocks: their scatter says nothing.
    (r.effect.is_of_a_place() || r.z > thresholds::LEAST_Z)
        && r.relative_size < thresholds::MOST_SIZE
        && r.gain > thresholds::LEAST_GAIN * residuals
        && r.gain > thresholds::LEAST_SHARE[number.min(1)] * remaining
        && r.relative_size > least_size
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_that_may_be_taken_leads_and_the_others_keep_their_order() {
        let mut gains = [9, 7, 5, 3];
        assert!(lead(&mut gains, |gain| *gain < 6));
        assert_eq!(gains, [5, 9, 7, 3]);
        assert!(lead(&mut gains, |_| true));
        assert_eq!(gains, [5, 9, 7, 3]);
        assert!(!lead(&mut gains, |gain| *gain > 9));
        assert_eq!(gains, [5, 9, 7, 3]);
    }
}
