//! How well a model predicts what it was not fitted to: blocks that no fit sees, and every other block once it is left out.
//!
//! Leaving a block out needs no fit. At the best fit to all blocks the gradients and the priors' pull cancel, so that without block k the best is
//!
//! ```text
//! delta_k = (A - H_k/phi)^-1 g_k/phi,      cost_k(theta + delta_k) = cost_k + 2 g_k' delta_k + delta_k' H_k delta_k
//! ```
//!
//! away (one Newton step, as in approximate leave-one-out cross-validation: Beirami et al. 2017). g_k, H_k: half gradient and information of the
//! block, A: information over the dispersion phi, with the priors. What only one block asks for gets no credit, however well it fits there.

use gripsight_estimation::selection::Term;
use gripsight_estimation::shooting::{self, Parameter};
use nalgebra::{DMatrix, DVector};

use crate::around::{Around, Refined};
use crate::budget::Scorer;
use crate::joint::Weighed;

/// Iterations of the fit of start states.
const START_ITERATIONS: usize = 6;

impl Around<'_, '_> {
    /// Robust sum of squares of a configuration fitted to `weighed`, all channels, under the noise of the inference: of the blocks held out, and of all
    /// others, each left out once. Not a number where it cannot be told.
    pub(crate) fn predictive_cost(
        &self,
        weighed: &Weighed,
        terms: &[Term],
        scorer: &Scorer<'_>,
        chosen: &[usize],
        fitted: &Refined,
    ) -> f64 {
        let apart = if scorer.is_apart() { self.cost_apart(scorer, chosen, &fitted.values) } else { 0.0 };
        apart + self.cost_left_out(weighed, terms, chosen, fitted).unwrap_or(f64::NAN)
    }

    /// The same on the data held out alone.
    fn cost_apart(&self, scorer: &Scorer<'_>, chosen: &[usize], values: &[f64]) -> f64 {
        let (model, own, _) = self.model(&scorer.engine, chosen, values);
        let fixed = |&start: &f64| Parameter { start, low: start, high: start, free: false, prior: None };
        let parameters: Vec<Parameter> = own.iter().map(fixed).collect();
        let problem = self.engine.problem(&model, &scorer.windows.windows, &parameters, START_ITERATIONS);
        shooting::descend(&problem, None).at.cost
    }

    /// The same of the blocks fitted, each left out once.
    fn cost_left_out(
        &self,
        weighed: &Weighed,
        terms: &[Term],
        chosen: &[usize],
        fitted: &Refined,
    ) -> Option<f64> {
        let (model, own, _) = self.model(self.engine, chosen, &fitted.values);
        let trial = self.joint.trial(self.engine, &model, &own, &fitted.starts, self.windows, self.scale)?;
        let in_use = self.in_use(chosen);
        let (mut columns, mut priors) = (Vec::new(), Vec::new());
        for (term, &alternative) in terms.iter().zip(chosen) {
            for (k, prior) in term.priors.iter().enumerate().filter(|(k, _)| in_use[term.from + k]) {
                columns.push(term.from + k);
                priors.push(prior.sigma[alternative].powi(-2));
            }
        }
        let n = columns.len();
        let part = |h: &DMatrix<f64>| DMatrix::from_fn(n, n, |r, c| h[(columns[r], columns[c])]);
        let blocks = weighed.blocks.iter().zip(&trial.blocks).map(|(block, (cost, gradient))| Block {
            cost: *cost,
            gradient: DVector::from_fn(n, |r, _| gradient[columns[r]]),
            information: part(&block.information),
        });
        let prior = DMatrix::from_diagonal(&DVector::from_vec(priors));
        left_out(&blocks.collect::<Vec<_>>(), &prior, self.dispersion)
    }
}

/// A block at the best fit to all.
struct Block {
    cost: f64,
    /// Half the derivative of the cost.
    gradient: DVector<f64>,
    information: DMatrix<f64>,
}

/// Costs of all blocks, each left out once; `None` where the others do not tell every parameter.
fn left_out(blocks: &[Block], prior: &DMatrix<f64>, dispersion: f64) -> Option<f64> {
    let whole = blocks.iter().fold(prior.clone(), |sum, b| sum + &b.information / dispersion);
    let without = |b: &Block| {
        let step = (&whole - &b.information / dispersion).cholesky()?.solve(&b.gradient) / dispersion;
        Some(b.cost + 2.0 * b.gradient.dot(&step) + step.dot(&(&b.information * &step)))
    };
    blocks.iter().map(without).sum()
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
    fn of_a_linear_model_it_is_what_fits_without_each_block_leave() {
        let data = data();
        let rows = |skip: usize| -> Vec<([f64; 2], f64)> {
            let kept = data.iter().enumerate().filter(|(k, _)| *k != skip);
            kept.flat_map(|(_, (x, y))| x.iter().copied().zip(y.iter().copied())).collect()
        };
        let square = |at: &DVector<f64>, k: usize| -> f64 {
            let (x, y) = &data[k];
            x.iter().zip(y).map(|(x, y)| (y - x[0] * at[0] - x[1] * at[1]).powi(2)).sum()
        };
        let expected: f64 = (0..3).map(|k| square(&fitted(&rows(k)), k)).sum();
        let at = fitted(&rows(3));
        let block = |k: usize| {
            let (x, y) = &data[k];
            let x = DMatrix::from_fn(x.len(), 2, |r, c| x[r][c]);
            let left = DVector::from_row_slice(y) - &x * &at;
            Block { cost: left.norm_squared(), gradient: -x.tr_mul(&left), information: x.tr_mul(&x) }
        };
        let blocks: Vec<Block> = (0..3).map(block).collect();
        let found = left_out(&blocks, &(DMatrix::identity(2, 2) * PRIOR), DISPERSION).unwrap();
        approx::assert_relative_eq!(found, expected, epsilon = 1e-9);
        // More than what the fit to all leaves.
        assert!(found > blocks.iter().map(|b| b.cost).sum::<f64>());
    }
}
