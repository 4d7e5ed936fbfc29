//! Where a candidate leads: along its derivatives, and without them.

use crate::SimulatorError;
use crate::fit::{Fitter, State};
use crate::linear::Normal;
use crate::model::Residuals;
use crate::round::Likely;

/// Rollouts that following a candidate takes at most.
pub(crate) const LOOKS: usize = 3;
/// Shares of a value: far from it, and around the best ever closer.
const FAR: [f64; 3] = [0.5, 0.75, 1.4];
const CLOSER: [[f64; 4]; 3] = [[0.8, 0.9, 1.1, 1.2], [0.94, 0.97, 1.03, 1.06], [0.98, 0.99, 1.01, 1.02]];

impl Fitter<'_> {
    /// Rollouts that looking without derivatives takes at most.
    pub(crate) fn zooming(&self) -> f64 {
        let own = self.model.candidates.iter().filter(|c| c.is_own() && !c.integer).count();
        (own * FAR.len() + CLOSER.as_flattened().len()) as f64
    }

    /// Looks without derivatives, where these do not lead to what is left: a controller that switches makes a simulator's answer rough. Of
    /// every parameter of its own a few values far apart; around the best of all ever closer ones.
    pub(crate) fn zoom(
        &self,
        state: &State,
        active: &[usize],
    ) -> Result<Option<(usize, State)>, SimulatorError> {
        let layout = &self.layout;
        let candidates = self.model.candidates.iter().enumerate();
        let rough =
            candidates.filter(|(c, k)| k.is_own() && !k.integer && !active.contains(c)).map(|(c, _)| c);
        let around = |c: usize, from: &State, factors: &[f64]| -> Vec<(usize, Vec<f64>)> {
            let place = |f: &f64| {
                let mut values = from.point.values.clone();
                values[c] = self.within(c, values[c] * f);
                // A count between two is two rollouts.
                values
                    .iter_mut()
                    .zip(self.model.candidates)
                    .filter(|(_, k)| k.integer)
                    .for_each(|(v, _)| *v = v.round());
                (c, values)
            };
            factors.iter().map(place).filter(|(c, v)| v[*c] != from.point.values[*c]).collect()
        };
        let mut next: Vec<(usize, Vec<f64>)> = rough.flat_map(|c| around(c, state, &FAR)).collect();
        let mut best: Option<(usize, State)> = None;
        for factors in CLOSER.iter().map(Some).chain([None]) {
            let values: Vec<Vec<f64>> = next.iter().map(|n| n.1.clone()).collect();
            if !values.is_empty() {
                for ((c, _), trial) in next.iter().zip(self.trials(state, &[], &values)?) {
                    let least = best.as_ref().map_or(state, |(_, s)| s).training(layout);
                    if trial.training(layout) < least {
                        best = Some((*c, trial));
                    }
                }
            }
            let (Some((c, at)), Some(factors)) = (&best, factors) else { break };
            next = around(*c, at, factors);
        }
        Ok(best)
    }

    /// Looks further where a small change shows nothing, such as at a limit that is not reached: by candidate the best of a few values
    /// between here and its bounds, with what it gains; and the candidates that show nothing there, either.
    pub(crate) fn scan(
        &self,
        state: &State,
        silent: &[usize],
    ) -> Result<(Vec<Likely>, Vec<usize>), SimulatorError> {
        /// Shares of the way to the lower and to the upper bound: scales are positive, and their small values lie close together. First
        /// where most shows; the others only of candidates that show something there.
        const FIRST: [f64; 2] = [-0.95, 0.5];
        const THEN: [f64; 9] = [-0.9, -0.85, -0.8, -0.7, -0.6, -0.5, -0.35, 0.05, 0.2];
        let layout = &self.layout;
        let before = state.training(layout);
        let bound = |c: usize, share: f64| {
            let candidate = &self.model.candidates[c];
            if share < 0.0 { candidate.low } else { candidate.high }
        };
        // By candidate: shares of the ways to its bounds, with what the simulator says there.
        let mut looks: Vec<(usize, Vec<(f64, State)>)> = silent.iter().map(|&c| (c, Vec::new())).collect();
        let mut looked = silent.to_vec();
        for shares in [FIRST.as_slice(), &THEN] {
            let mut places: Vec<(usize, f64, Vec<f64>)> = Vec::new();
            for (&c, &share) in looked.iter().flat_map(|c| shares.iter().map(move |share| (c, share))) {
                let here = state.point.values[c];
                let value = here + share.abs() * (bound(c, share) - here);
                let mut values = state.point.values.clone();
                values[c] = if self.model.candidates[c].integer { value.round() } else { value };
                if values[c] != here {
                    places.push((c, share, values));
                }
            }
            let points: Vec<Vec<f64>> = places.iter().map(|p| p.2.clone()).collect();
            let trials = if points.is_empty() { Vec::new() } else { self.still(state, &points)? };
            for ((c, share, _), trial) in places.into_iter().zip(trials) {
                if let Some((_, looks)) = looks.iter_mut().find(|l| l.0 == c) {
                    looks.push((share, trial));
                }
            }
            let shows = |looks: &[(f64, State)]| looks.iter().any(|(_, s)| s.residuals != state.residuals);
            looked = looks.iter().filter(|(_, l)| shows(l)).map(|(c, _)| *c).collect();
        }
        let mute = silent.iter().copied().filter(|c| !looked.contains(c)).collect();
        let best = |looks: &[(f64, State)]| {
            let states = looks.iter().map(|(_, s)| s);
            states.min_by(|a, b| a.training(layout).total_cmp(&b.training(layout))).cloned()
        };
        let likely = looks.iter().filter_map(|(candidate, looks)| {
            let best = best(looks)?;
            let gain = before - best.training(layout);
            (gain > 0.0).then_some(Likely { candidate: *candidate, gain, values: best.point.values })
        });
        let likely = likely.collect();
        Ok((likely, mute))
    }

    /// Follows each candidate along its own line: where the line of two points has its least, there is the next.
    pub(crate) fn follow(
        &self,
        state: &State,
        columns: &[Residuals],
        likely: &[Likely],
    ) -> Result<Vec<(usize, State)>, SimulatorError> {
        let layout = &self.layout;
        let all: Vec<(usize, &Residuals)> = columns.iter().enumerate().collect();
        let along = |likely: &Likely, share: f64| -> Vec<f64> {
            let line = state.point.values.iter().zip(&likely.values).enumerate();
            line.map(|(k, (from, to))| self.within(k, from + share * (to - from))).collect()
        };
        // By candidate: shares of the line looked at, with what the simulator said.
        let mut looked: Vec<Vec<(f64, State)>> = likely.iter().map(|_| vec![(0.0, state.clone())]).collect();
        let mut next: Vec<Option<f64>> = vec![Some(1.0); likely.len()];
        for _ in 0..LOOKS {
            let places: Vec<(usize, f64)> =
                next.iter().enumerate().filter_map(|(i, share)| share.map(|s| (i, s))).collect();
            if places.is_empty() {
                break;
            }
            let values: Vec<Vec<f64>> = places.iter().map(|(i, share)| along(&likely[*i], *share)).collect();
            let trials = self.trials(state, &all, &values)?;
            for ((i, share), trial) in places.into_iter().zip(trials) {
                looked[i].push((share, trial));
                looked[i].sort_by(|a, b| a.1.training(layout).total_cmp(&b.1.training(layout)));
                next[i] = self.least(&looked[i]);
            }
        }
        let mut best: Vec<(usize, State)> = likely
            .iter()
            .zip(looked)
            .filter_map(|(l, looks)| {
                let (share, state) = looks.into_iter().next()?;
                (share != 0.0).then_some((l.candidate, state))
            })
            .collect();
        best.sort_by(|a, b| a.1.training(layout).total_cmp(&b.1.training(layout)));
        Ok(best)
    }

    /// Where a line has its least, by the two best looks; `None` where it has been looked at.
    fn least(&self, looks: &[(f64, State)]) -> Option<f64> {
        let [(s0, a), (s1, b), ..] = looks else { return None };
        let slope: Residuals =
            b.projected.iter().zip(&a.projected).map(|(rb, ra)| (rb - ra) / (s1 - s0)).collect();
        if slope.iter().any(|v| !v.is_finite()) {
            return Some(0.3 * s0.max(*s1));
        }
        let normal = Normal::new(&self.layout, &a.projected, &[&slope]);
        let share = (s0 + normal.step(0.0)?[0]).clamp(-1.0, 4.0);
        let known = looks.iter().any(|(s, _)| (s - share).abs() < 0.05 * share.abs().max(0.05));
        (!known).then_some(share)
    }
}
