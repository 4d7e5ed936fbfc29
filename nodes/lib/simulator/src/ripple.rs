//! Intervals, looked at where they end: a simulator may say there what its derivatives do not.
//!
//! ```text
//! C(theta + d) - C(theta) = d' I d + ripple:   var theta_j  gains  rms(ripple) (I^-1)_jj
//! ```
//!
//! A controller that switches by whole steps makes the error rough: its least lies anywhere where the smooth part rises less than the ripple.

use nalgebra::DVector;

use crate::SimulatorError;
use crate::fit::{Fitted, Fitter, needed};
use crate::linear::student;
use crate::model::Residuals;

/// Places that are looked at, as shares of an interval's half width: first its ends; where these are not as expected, further ones.
const ENDS: [f64; 2] = [-1.0, 1.0];
const FURTHER: [f64; 4] = [-2.5, -1.6, 1.6, 2.5];
/// Share of the expected rise that the ends may be off by.
const ROUGH: f64 = 0.5;

impl Fitter<'_> {
    /// Widens the intervals of a fit by what its error ripples.
    ///
    /// # Errors
    /// What the simulator says.
    pub(crate) fn widen(&self, fitted: &mut Fitted) -> Result<(), SimulatorError> {
        let active: Vec<usize> = fitted.sizes.iter().map(|s| s.candidate).collect();
        let normal = self.normal(&fitted.state, &fitted.columns);
        let Some(known) = normal.known() else { return Ok(()) };
        let Some(inverse) = normal.information.clone().try_inverse() else { return Ok(()) };
        let rough: Vec<usize> = (0..active.len())
            .filter(|&j| {
                let c = &self.model.candidates[active[j]];
                c.is_own() && !c.integer && inverse[(j, j)] > 0.0 && known.covariance[(j, j)].is_finite()
            })
            .collect();
        let error = |j: usize| known.covariance[(j, j)].sqrt();
        let places = |among: &[usize], shares: &[f64]| -> Vec<(usize, f64)> {
            let reach = |j: usize| student(0.05, known.freedom[j]) * error(j);
            among.iter().flat_map(|&j| shares.iter().map(move |s| (j, s * reach(j)))).collect()
        };
        // By place: what the error rises by beyond what is expected.
        let mut ripples = self.ripples(fitted, &inverse, &places(&rough, &ENDS))?;
        let is_rough = |j: &usize| {
            let own = ripples.iter().filter(|(k, _, _)| k == j);
            own.clone().any(|(_, ripple, expected)| ripple.abs() > ROUGH * expected)
        };
        let rough: Vec<usize> = rough.into_iter().filter(is_rough).collect();
        ripples.extend(self.ripples(fitted, &inverse, &places(&rough, &FURTHER))?);
        for j in rough {
            let own: Vec<f64> = ripples.iter().filter(|(k, _, _)| *k == j).map(|r| r.1).collect();
            let ripple = (own.iter().map(|r| r * r).sum::<f64>() / own.len().max(1) as f64).sqrt();
            let size = &mut fitted.sizes[j];
            let variance = known.covariance[(j, j)] + ripple * inverse[(j, j)];
            let reach = student(0.05, known.freedom[j]) * variance.sqrt();
            (size.low, size.high) = (size.value - reach, size.value + reach);
            size.wald *= known.covariance[(j, j)] / variance;
            size.needed = needed(self.model.candidates.len(), known.freedom[j]);
        }
        Ok(())
    }

    /// Moves single sizes by so much, the others and the starts following: which, what the error rises by beyond what is expected, and that.
    fn ripples(
        &self,
        fitted: &Fitted,
        inverse: &nalgebra::DMatrix<f64>,
        places: &[(usize, f64)],
    ) -> Result<Vec<(usize, f64, f64)>, SimulatorError> {
        let state = &fitted.state;
        let active: Vec<usize> = fitted.sizes.iter().map(|s| s.candidate).collect();
        let moves: Vec<(usize, DVector<f64>, Vec<f64>)> = places
            .iter()
            .filter_map(|(j, by)| {
                let others = inverse.column(*j) * (by / inverse[(*j, *j)]);
                let mut values = state.point.values.clone();
                for (&c, d) in active.iter().zip(others.iter()) {
                    // Counts stay whole.
                    let is_count = self.model.candidates[c].integer;
                    values[c] = if is_count { (values[c] + d).round() } else { values[c] + d };
                }
                let bounds = |c: usize| self.model.candidates[c].low..=self.model.candidates[c].high;
                let is_inside = active.iter().all(|&c| bounds(c).contains(&values[c]));
                is_inside.then_some((*j, others, values))
            })
            .collect();
        if moves.is_empty() {
            return Ok(Vec::new());
        }
        let columns: Vec<(usize, &Residuals)> = active.iter().copied().zip(&fitted.columns).collect();
        let values: Vec<Vec<f64>> = moves.iter().map(|m| m.2.clone()).collect();
        let trials = self.trials(state, &columns, &values)?;
        let normal = self.normal(state, &fitted.columns);
        let before = state.training(&self.layout);
        let of = |((j, d, _), trial): (&(usize, DVector<f64>, Vec<f64>), _)| {
            let trial: &crate::fit::State = trial;
            let expected = (d.transpose() * &normal.information * d)[(0, 0)];
            let rise = trial.training(&self.layout) - before - 2.0 * normal.gradient.dot(d);
            (*j, rise - expected, expected)
        };
        Ok(moves.iter().zip(&trials).map(of).filter(|r| r.1.is_finite()).collect())
    }
}
