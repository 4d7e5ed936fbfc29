//! Gauss-Newton on a simulator: derivatives are rollouts, so what every trial says of them is kept (Broyden 1965).
//!
//! ```text
//! c_j += e h_j d_j / sum_i h_i d_i^2,   e = r(theta + d) - r(theta) - sum_i c_i d_i - A dx,   h: the information of each
//! ```
//!
//! A fit begins with derivatives that are known nearby and ends with such that were taken where it ends: their step, and the intervals, are
//! as exact as if all had been.

use nalgebra::DVector;

use crate::SimulatorError;
use crate::fit::{Fitted, Fitter, State};
use crate::linear::Normal;
use crate::model::Residuals;

/// Decrease of the cost, as a share of it, that ends a fit.
const TOLERANCE: f64 = 1e-3;
/// Share of the cost that a step along derivatives from elsewhere must take for the next to be along such, too.
const FAST: f64 = 0.3;
/// Damping beyond which a step is too short to be worth a rollout.
const MOST_DAMPING: f64 = 400.0;

impl Fitter<'_> {
    /// Fits some candidates together, from a state on. `columns`: derivatives by them, as far as they are known there.
    ///
    /// # Errors
    /// What the simulator says.
    pub(crate) fn fit(
        &self,
        from: &State,
        active: &[usize],
        columns: Vec<Residuals>,
        iterations: usize,
    ) -> Result<Fitted, SimulatorError> {
        let layout = &self.layout;
        let (mut state, mut columns) = (from.clone(), columns);
        let (mut fresh, mut is_settled) = (false, false);
        let mut damping = 1e-3;
        for iteration in 0..iterations {
            let last = iteration + 1 == iterations;
            if last && !fresh {
                (state, columns) = self.anew(state, active)?;
                fresh = true;
            }
            let before = state.training(layout);
            let normal = self.normal(&state, &columns);
            let step = self
                .whole(&state, &normal, active, damping)
                .filter(|step| step.amax() > 0.0 && (fresh || normal.gain(step) > TOLERANCE * before));
            let Some(step) = step else {
                if fresh {
                    is_settled = true;
                    break;
                }
                (state, columns) = self.anew(state, active)?;
                fresh = true;
                continue;
            };
            let promised = normal.gain(&step);
            let mut values = state.point.values.clone();
            for (&c, s) in active.iter().zip(step.iter()) {
                values[c] = self.within(c, values[c] + s);
            }
            let pairs: Vec<(usize, &Residuals)> = active.iter().copied().zip(&columns).collect();
            let Some(trial) = self.trials(&state, &pairs, &[values])?.into_iter().next() else { break };
            let cost = trial.training(layout);
            if cost.is_nan() || cost >= before {
                if fresh {
                    damping = 30.0 * damping + 0.3;
                    if promised < TOLERANCE * before || damping > MOST_DAMPING {
                        is_settled = true;
                        break;
                    }
                } else {
                    (state, columns) = self.anew(state, active)?;
                    fresh = true;
                }
                continue;
            }
            damping *= 0.1;
            let gained = (before - cost) / before.max(f64::MIN_POSITIVE);
            let done = gained < TOLERANCE;
            if fresh && (done || last) {
                (state, is_settled) = (trial, done);
                break;
            }
            let slow = !fresh && gained < FAST;
            columns = self.learned(&state, &trial, active, columns);
            (state, fresh) = (trial, false);
            if done || slow {
                (state, columns) = self.anew(state, active)?;
                fresh = true;
            }
        }
        let sizes = self.sizes(&state, active, &columns);
        Ok(Fitted { state, sizes, columns, is_settled })
    }

    /// Derivatives by some candidates, with what the way from one state to another says of them.
    pub(crate) fn learned(
        &self,
        from: &State,
        to: &State,
        active: &[usize],
        mut columns: Vec<Residuals>,
    ) -> Vec<Residuals> {
        let predicted = to.predicted(from, &self.layout, active, &columns);
        let error: Residuals =
            to.residuals.iter().zip(&from.residuals).zip(&predicted).map(|((b, a), p)| b - a - p).collect();
        let information = self.normal(from, &columns).information;
        let moved: Vec<f64> = active.iter().map(|&c| to.point.values[c] - from.point.values[c]).collect();
        // A candidate that has shown nothing so far is told by all that this way does not explain.
        let weight = |j: usize| information[(j, j)].max(1e-12);
        let whole: f64 = moved.iter().enumerate().map(|(j, d)| weight(j) * d * d).sum();
        if whole > 0.0 && error.iter().all(|e| e.is_finite()) {
            for (j, column) in columns.iter_mut().enumerate() {
                let share = weight(j) * moved[j] / whole;
                column.iter_mut().zip(&error).for_each(|(c, e)| *c += share * e);
            }
        }
        columns
    }

    /// The step that lowers the cost most where counts move by whole numbers: what these cannot follow the others do.
    fn whole(&self, state: &State, normal: &Normal, active: &[usize], damping: f64) -> Option<DVector<f64>> {
        let step = normal.step(damping)?;
        let is_count = |j: &usize| self.model.candidates[active[*j]].integer;
        let (counts, others): (Vec<usize>, Vec<usize>) = (0..active.len()).partition(is_count);
        let mut out = step;
        for &j in &counts {
            let value = state.point.values[active[j]];
            out[j] = self.within(active[j], value + out[j]) - value;
        }
        if counts.is_empty() || others.is_empty() {
            return Some(out);
        }
        normal.follow(&mut out, &others, damping).then_some(out)
    }

    fn anew(&self, state: State, active: &[usize]) -> Result<(State, Vec<Residuals>), SimulatorError> {
        self.around(state.point, Some(state.residuals), active)
    }

    pub(crate) fn normal(&self, state: &State, columns: &[Residuals]) -> Normal {
        let projected: Vec<Residuals> =
            columns.iter().map(|c| state.starts.project(&self.layout, c).0).collect();
        Normal::new(&self.layout, &state.projected, &projected.iter().collect::<Vec<_>>())
    }
}
