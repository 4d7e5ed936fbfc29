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
        /// Shares of the way to the lower and to the upper bound where most shows: scales are positive, and their small values lie close
        /// together.
        const FIRST: [f64; 2] = [-0.95, 0.5];
        /// A limit at a hundredth of the way is found.
        const HALVINGS: usize = 7;
        let layout = &self.layout;
        let before = state.training(layout);
        // By candidate: shares of the ways to its bounds, with what the simulator says there.
        let mut looks: Vec<(usize, Vec<(f64, State)>)> = silent.iter().map(|&c| (c, Vec::new())).collect();
        self.look(state, &mut looks, |_| FIRST.to_vec())?;
        // A limit acts from where it first shows, and the best may lie close to there.
        let shows = |look: &State| look.residuals != state.residuals;
        let show = |looks: &[(f64, State)]| looks.iter().any(|(_, s)| shows(s));
        for _ in 0..HALVINGS {
            self.look(state, &mut looks, |looks| {
                let seen: Vec<Look> = looks
                    .iter()
                    .map(|(share, s)| Look { share: *share, cost: s.training(layout), shows: shows(s) })
                    .collect();
                closer(&seen, before)
            })?;
        }
        let looked: Vec<usize> = looks.iter().filter(|(_, l)| show(l)).map(|(c, _)| *c).collect();
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

    /// Looks at each candidate at some shares of the ways to its bounds (below zero to the lower one), chosen by what was seen there so far.
    fn look(
        &self,
        state: &State,
        looks: &mut [(usize, Vec<(f64, State)>)],
        shares: impl Fn(&[(f64, State)]) -> Vec<f64>,
    ) -> Result<(), SimulatorError> {
        let mut places: Vec<(usize, f64, Vec<f64>)> = Vec::new();
        for (place, (c, looks)) in looks.iter().enumerate() {
            let candidate = &self.model.candidates[*c];
            for share in shares(looks) {
                let here = state.point.values[*c];
                let bound = if share < 0.0 { candidate.low } else { candidate.high };
                let value = here + share.abs() * (bound - here);
                let mut values = state.point.values.clone();
                values[*c] = self.within(*c, value);
                if values[*c] != here && !looks.iter().any(|(_, s)| s.point.values[*c] == values[*c]) {
                    places.push((place, share, values));
                }
            }
        }
        let points: Vec<Vec<f64>> = places.iter().map(|p| p.2.clone()).collect();
        let trials = self.still(state, &points)?;
        for ((place, share, _), trial) in places.into_iter().zip(trials) {
            looks[place].1.push((share, trial));
        }
        Ok(())
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

/// What was seen at a share of the way to a bound (below zero to the lower one).
#[derive(Debug, Clone, Copy)]
struct Look {
    share: f64,
    cost: f64,
    shows: bool,
}

/// Where to look next: around the best that leaves less than `before`, if it is among the last four; where none does, towards each bound
/// between the first look that shows something and the one before.
fn closer(looks: &[Look], before: f64) -> Vec<f64> {
    const SIDES: [f64; 2] = [-1.0, 1.0];
    let beside = |at: f64, side: f64| {
        let known = looks.iter().map(|l| l.share).chain([0.0, -1.0, 1.0]);
        let away = known.map(|share| (share - at) * side).filter(|d| *d > 0.0);
        Some(at + 0.5 * side * away.min_by(f64::total_cmp)?)
    };
    let best = looks.iter().enumerate().min_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
    if let Some((place, best)) = best.filter(|(_, l)| l.cost < before) {
        let is_new = place + 2 * SIDES.len() >= looks.len();
        return SIDES.into_iter().filter(|_| is_new).filter_map(|side| beside(best.share, side)).collect();
    }
    let first = |side: f64| {
        let shown = looks.iter().filter(|l| l.shows && l.share * side > 0.0);
        shown.map(|l| l.share).min_by(|a, b| a.abs().total_cmp(&b.abs()))
    };
    SIDES.into_iter().filter_map(|side| beside(first(side)?, -side)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_is_found_that_helps_only_close_to_where_it_first_shows() {
        // Nothing shows above 0.62 of the way, more than a tenth further everything is worse than without a limit.
        let look = |share: f64| {
            let (at, shows) = (share.abs(), share < -0.62);
            let cost = if shows { 100.0 - 50.0 + 1e4 * (at - 0.66).powi(2) } else { 100.0 };
            Look { share, cost, shows }
        };
        let mut looks = vec![look(-0.95), look(0.5)];
        for _ in 0..7 {
            looks.extend(closer(&looks, 100.0).into_iter().map(look).collect::<Vec<_>>());
        }
        let best = looks.iter().min_by(|a, b| a.cost.total_cmp(&b.cost)).unwrap();
        assert!((best.share + 0.66).abs() < 0.03, "{looks:?}");
        assert!(looks.len() <= 2 + 2 * 7, "{looks:?}");
    }

    #[test]
    fn looking_ends_where_it_no_longer_helps() {
        let look = |share: f64| Look { share, cost: 1.0 + (share + 0.95).abs(), shows: true };
        let looks: Vec<Look> = [-0.95, 0.5, -0.9].map(look).to_vec();
        assert_eq!(closer(&looks, 2.0), [-0.975, -0.925]);
        let more: Vec<Look> = looks.into_iter().chain([-0.975, -0.925].map(look)).collect();
        assert!(closer(&more, 2.0).is_empty());
    }
}
