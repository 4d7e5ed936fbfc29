//! How well a model predicts what it was not fitted to: blocks that no fit sees, and every other block once it is left out.
//!
//! Leaving a block out needs no fit. At the best fit to all blocks the gradients and the priors' pull cancel, so that without block k the best is
//!
//! ```text
//! delta_k = (A - H_k/phi)^-1 g_k/phi
//! ```
//!
//! away (one Newton step, as in approximate leave-one-out cross-validation: Beirami et al. 2017), and the block is run there, its start states moved
//! along. g_k, H_k: half gradient and information of the block, both at the fit; A: information over the dispersion phi, with the priors. What only one
//! block asks for gets no credit, however well it fits there.

use gripsight_estimation::selection::{ColumnPrior, Term};
use gripsight_estimation::shooting::{self, Parameter};
use nalgebra::{DMatrix, DVector};
use std::sync::OnceLock;

use crate::around::{Around, Ended};
use crate::budget::Scorer;

/// Iterations of the fit of start states, and where those of another model are at hand.
const START_ITERATIONS: usize = 6;
const START_ITERATIONS_NEARBY: usize = 2;

/// A column of a configuration's model.
struct Own {
    value: f64,
    bounds: [f64; 2],
    /// Precision of its prior, where it can move.
    precision: Option<f64>,
}

impl Own {
    fn fixed(value: f64) -> Parameter {
        Parameter { start: value, low: value, high: value, free: false, prior: None }
    }
}

impl Around<'_, '_> {
    /// Robust sum of squares of a fitted configuration, all channels, under the noise of the inference: of the blocks held out, and of all
    /// others, each left out once. Not a number where it cannot be told.
    pub(crate) fn predictive_cost(
        &self,
        scorer: &Scorer<'_>,
        chosen: &[usize],
        ended: &Ended,
        starts: &OnceLock<Vec<[f64; 2]>>,
    ) -> f64 {
        let apart = if scorer.is_apart() {
            self.cost_apart(scorer, chosen, &ended.fitted.values, starts)
        } else {
            0.0
        };
        apart + self.cost_left_out(chosen, ended).unwrap_or(f64::NAN)
    }

    /// The same on the data held out alone. `starts`: where the first model that was looked at starts there.
    fn cost_apart(
        &self,
        scorer: &Scorer<'_>,
        chosen: &[usize],
        values: &[f64],
        starts: &OnceLock<Vec<[f64; 2]>>,
    ) -> f64 {
        let (model, own, _) = self.model(&scorer.engine, chosen, values);
        let parameters: Vec<Parameter> = own.iter().map(|&v| Own::fixed(v)).collect();
        let from = starts.get().cloned();
        let iterations = if from.is_some() { START_ITERATIONS_NEARBY } else { START_ITERATIONS };
        let problem = self.engine.problem(&model, &scorer.windows.windows, &parameters, iterations);
        let end = shooting::fit(&problem, from);
        starts.get_or_init(|| end.starts);
        end.linearization.cost
    }

    /// The columns of a configuration's model, in the model's order. What has come to its bound stays there.
    fn own(&self, chosen: &[usize], map: &[usize], values: &[f64]) -> Vec<Own> {
        let in_use = self.in_use(chosen);
        let prior = |column: usize| -> Option<(&ColumnPrior, usize)> {
            let place = |t: &Term| (t.from..t.from + t.priors.len()).contains(&column);
            let found = self.terms.iter().zip(chosen).find(|(t, _)| place(t));
            found.map(|(t, &alternative)| (&t.priors[column - t.from], alternative))
        };
        map.iter()
            .zip(values)
            .map(|(&column, &value)| {
                let Some((prior, alternative)) = prior(column).filter(|_| in_use[column]) else {
                    return Own { value, bounds: [value; 2], precision: None };
                };
                let bounds = prior.bounds.map(|b| self.values[column] + b);
                let within = bounds[0] < value && value < bounds[1];
                Own { value, bounds, precision: within.then(|| prior.sigma[alternative].powi(-2)) }
            })
            .collect()
    }

    /// The same of the blocks fitted, each left out once.
    fn cost_left_out(&self, chosen: &[usize], Ended { fitted, fit }: &Ended) -> Option<f64> {
        let (model, values, map) = self.model(self.engine, chosen, &fitted.values);
        let own = self.own(chosen, &map, &values);
        let parameters: Vec<Parameter> = own.iter().map(|o| Own::fixed(o.value)).collect();
        let at = &fit.linearization;
        // What moves: its place in the fit, and its precision.
        let moving: Vec<(usize, f64)> =
            fit.free.iter().enumerate().filter_map(|(row, &j)| Some((row, own[j].precision?))).collect();
        let rows: Vec<usize> = moving.iter().map(|m| m.0).collect();
        let prior = DMatrix::from_diagonal(&DVector::from_iterator(rows.len(), moving.iter().map(|m| m.1)));
        let blocks: Vec<Block> = self
            .windows
            .block
            .chunk_by(|a, b| a == b)
            .scan(0, |from, members| {
                let windows = *from..*from + members.len();
                *from = windows.end;
                let information: DMatrix<f64> = at.window_information[windows.clone()].iter().sum();
                let gradient: DVector<f64> = at.window_gradients[windows.clone()].iter().sum();
                let information = information.select_rows(&rows).select_columns(&rows);
                Some(Block { information, gradient: gradient.select_rows(&rows), windows })
            })
            .collect();
        let whole = blocks.iter().fold(prior, |sum, b| sum + &b.information / self.dispersion);
        let without = |block: &Block| {
            let step = block.step(&whole, self.dispersion)?;
            let mut values = values.clone();
            let mut taken = DVector::zeros(fit.free.len());
            for (&row, by) in rows.iter().zip(step.iter()) {
                let (j, o) = (fit.free[row], &own[fit.free[row]]);
                values[j] = (o.value + by).clamp(o.bounds[0], o.bounds[1]);
                taken[row] = values[j] - o.value;
            }
            let starts = at.starts_after(&taken, &fitted.starts);
            let windows = &self.windows.windows[block.windows.clone()];
            let problem = self.engine.problem(&model, windows, &parameters, 0);
            Some(shooting::cost(&problem, &values, &starts[block.windows.clone()]))
        };
        blocks.iter().map(without).sum()
    }
}

/// A block at the best fit to all.
struct Block {
    windows: std::ops::Range<usize>,
    /// Half the derivative of the cost.
    gradient: DVector<f64>,
    information: DMatrix<f64>,
}

impl Block {
    /// How far the best fit without it is from that to all; `None` where the others do not tell every parameter.
    fn step(&self, whole: &DMatrix<f64>, dispersion: f64) -> Option<DVector<f64>> {
        let rest = whole - &self.information / dispersion;
        Some(rest.cholesky()?.solve(&self.gradient) / dispersion)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three blocks of y = a + b x with their errors, of which only the first tells b.
    fn data() -> [(Vec<[f64; 2]>, Vec<f64>); 3] {
        [
            (vec![[1.0, 0.5], [1.0, -1.0], [1.0, 2.0]], vec![1.3, 0.4, 2.9]),
            (vec![[1.0, 0.0], [1.0, 0.1]], vec![0.7, 1.1]),
            (vec![[1.0, 0.0], [1.0, -0.1], [1.0, 0.0]], vec![1.2, 0.9, 1.4]),
        ]
    }

    const PRIOR: f64 = 0.25;
    const DISPERSION: f64 = 1.7;

    fn fitted(rows: &[([f64; 2], f64)]) -> DVector<f64> {
        let mut precision = DMatrix::identity(2, 2) * PRIOR;
        let mut side = DVector::zeros(2);
        for (x, y) in rows {
            let x = DVector::from_row_slice(x);
            precision += &x * x.transpose() / DISPERSION;
            side += x * (*y / DISPERSION);
        }
        precision.cholesky().unwrap().solve(&side)
    }

    #[test]
    fn of_a_linear_model_a_step_leads_to_the_fit_without_a_block() {
        let data = data();
        let rows = |skip: usize| -> Vec<([f64; 2], f64)> {
            let kept = data.iter().enumerate().filter(|(k, _)| *k != skip);
            kept.flat_map(|(_, (x, y))| x.iter().copied().zip(y.iter().copied())).collect()
        };
        let at = fitted(&rows(3));
        let block = |k: usize| {
            let (x, y) = &data[k];
            let x = DMatrix::from_fn(x.len(), 2, |r, c| x[r][c]);
            let left = DVector::from_row_slice(y) - &x * &at;
            Block { windows: k..k + 1, gradient: -x.tr_mul(&left), information: x.tr_mul(&x) }
        };
        let blocks: Vec<Block> = (0..3).map(block).collect();
        let prior = DMatrix::identity(2, 2) * PRIOR;
        let whole = blocks.iter().fold(prior, |sum, b| sum + &b.information / DISPERSION);
        for (k, block) in blocks.iter().enumerate() {
            let without = &at + block.step(&whole, DISPERSION).unwrap();
            approx::assert_relative_eq!(without, fitted(&rows(k)), epsilon = 1e-9);
        }
    }
}
