//! The search for several effects: one after the other, what became needless dropped again, and every one challenged at the end.

use crate::engine::Engine;
use crate::refit::{Refit, difference, relative_size};
use crate::select::{Round, needed, reweigh, round, thresholds};
use crate::state::State;
use gripsight_estimation::Windows;
use gripsight_model::EffectId;

/// What a search has come to.
#[derive(Debug, Clone)]
pub(crate) struct Found {
    /// The model with the effects that are claimed.
    pub(crate) state: State,
    /// For each of them, in the order of `state.named`: what else was tried in its place.
    pub(crate) evidence: Vec<Round>,
    /// The first look, beside the tires alone.
    pub(crate) first: Round,
    /// The last look, in which nothing more was found.
    pub(crate) last: Round,
    /// Cost per residual with nothing claimed, and with each effect more.
    pub(crate) costs: Vec<f64>,
}

/// Rounds at most.
const ROUNDS: usize = 8;
/// Iterations of the fit after a change of the weights.
const SETTLE: usize = 8;

/// Searches from the model without any effect.
pub(crate) fn search(
    engine: &mut Engine<'_>,
    null: &State,
    library: &[EffectId],
    windows: &Windows,
    progress: &mut dyn FnMut(&str),
) -> Found {
    let mut library = library.to_vec();
    let mut state = null.clone();
    let mut evidence: Vec<Round> = Vec::new();
    let mut costs = vec![null.cost / null.residuals];
    let mut number = 0;
    // Whether the effect found last was compared with just those others in place that are there now.
    let mut newest_is_compared = false;
    // The model without each effect but the one found last.
    let mut lacking = Vec::new();
    let mut first = None;
    let last = loop {
        number += 1;
        progress(&format!("comparing {} effects, round {number}", library.len() - state.named.len()));
        let here = round(engine, &state, &library, windows, state.named.len());
        let room = state.named.len() < thresholds::MOST_EFFECTS && number < ROUNDS;
        let Some(next) = here.winner().filter(|_| here.taken && room).map(|r| r.state.clone()) else {
            break completed(engine, here, windows);
        };
        first.get_or_insert_with(|| here.clone());
        evidence.push(here);
        state = settled(engine, &next, windows);
        let found = state.named.len();
        let place = |e: EffectId| state.named.iter().position(|n| *n == e);
        let pair = |(from, e): (usize, &EffectId)| Some((*e, from, place(e.spec().goes_by?)?));
        if let Some((part, from, to)) = state.named.iter().enumerate().find_map(pair) {
            // What was compared when the first of the two was found says how sure the pair is.
            evidence.remove(from.max(to));
            state = without(engine, &state, part, windows);
            library.retain(|e| *e != part);
        }
        lacking = drop_needless(engine, &mut state, &mut evidence, windows);
        newest_is_compared = state.named.len() == found;
        costs.push(state.cost / state.residuals);
    };
    let first = first.unwrap_or_else(|| last.clone());
    let mut found = Found { state, evidence, first, last, costs };
    if found.state.named.len() > 1 {
        progress("challenging each effect found");
        found.challenge(engine, &library, windows, lacking, newest_is_compared);
    }
    found
}

/// With the sizes of its candidates told: looks at the problem around those that were not fitted to the end.
pub(crate) fn completed(engine: &Engine<'_>, mut round: Round, windows: &Windows) -> Round {
    for state in round.refits.iter_mut().map(|r| &mut r.state).filter(|s| s.fit.is_none()) {
        *state = engine.fit(&state.named, &state.parameters, Some(state.starts.clone()), windows, 0);
    }
    round
}

fn settled(engine: &mut Engine<'_>, state: &State, windows: &Windows) -> State {
    reweigh(engine, state, windows);
    engine.fit(&state.named, &state.parameters, Some(state.starts.clone()), windows, SETTLE)
}

/// The model without one of its effects, refitted.
pub(crate) fn without(engine: &Engine<'_>, state: &State, effect: EffectId, windows: &Windows) -> State {
    let named: Vec<EffectId> = state.named.iter().copied().filter(|e| *e != effect).collect();
    engine.fit(&named, &engine.carry(state, &named), Some(state.starts.clone()), windows, SETTLE)
}

/// A later effect may explain what an earlier one stood in for. Returns the models without each but the newest of what is left.
fn drop_needless(
    engine: &Engine<'_>,
    state: &mut State,
    evidence: &mut Vec<Round>,
    windows: &Windows,
) -> Vec<State> {
    loop {
        let older = &state.named[..state.named.len() - 1];
        let mut lacking: Vec<State> = older.iter().map(|e| without(engine, state, *e, windows)).collect();
        let least = (0..lacking.len()).min_by(|&a, &b| lacking[a].cost.total_cmp(&lacking[b].cost));
        match least.filter(|&i| !needed(&lacking[i], state)) {
            Some(i) => {
                *state = lacking.swap_remove(i);
                evidence.remove(i);
            }
            None => return lacking,
        }
    }
}

impl Found {
    /// Puts every effect up against all others once more, with the rest of the model in place (`lacking`: the models without the effects, as far as
    /// they are at hand), but for the newest where that was done when it was found; then orders them by what each closes.
    fn challenge(
        &mut self,
        engine: &mut Engine<'_>,
        library: &[EffectId],
        windows: &Windows,
        lacking: Vec<State>,
        newest_is_compared: bool,
    ) {
        let mut lacking = lacking.into_iter();
        for i in 0..self.state.named.len() - usize::from(newest_is_compared) {
            let effect = self.state.named[i];
            let base = lacking.next().unwrap_or_else(|| without(engine, &self.state, effect, windows));
            let mut here = round(engine, &base, library, windows, 1);
            let own = match here.refits.iter().position(|r| r.effect == effect) {
                Some(place) => place,
                None => {
                    let mut named = base.named.clone();
                    named.push(effect);
                    let values = engine.carry(&self.state, &named);
                    let state = engine.fit(&named, &values, Some(self.state.starts.clone()), windows, 2);
                    let (gain, z) = difference(windows, &here.before, &state);
                    let relative_size = relative_size(engine, effect, state.of(effect).unwrap_or(&[]));
                    here.insert(Refit { effect, state, gain, z, relative_size }, windows)
                }
            };
            if own > 0 && here.taken {
                // Another one does better.
                if let Some(better) = here.winner() {
                    self.state = settled(engine, &better.state.clone(), windows);
                }
                self.evidence.remove(i);
                self.evidence.push(here);
                return self.challenge_order(engine, windows);
            }
            self.evidence[i] = here;
        }
        self.challenge_order(engine, windows);
    }

    fn challenge_order(&mut self, engine: &Engine<'_>, windows: &Windows) {
        let gain = |r: &Round, e: EffectId| r.refits.iter().find(|x| x.effect == e).map_or(0.0, |x| x.gain);
        let mut pairs: Vec<(EffectId, Round)> =
            self.state.named.iter().copied().zip(std::mem::take(&mut self.evidence)).collect();
        pairs.sort_by(|a, b| gain(&b.1, b.0).total_cmp(&gain(&a.1, a.0)));
        let named: Vec<EffectId> = pairs.iter().map(|p| p.0).collect();
        self.evidence = pairs.into_iter().map(|p| p.1).collect();
        if named != self.state.named {
            let values = engine.carry(&self.state, &named);
            self.state = engine.fit(&named, &values, Some(self.state.starts.clone()), windows, 2);
        }
    }
}
