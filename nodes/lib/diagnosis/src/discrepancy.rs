//! What free terms of a model explain, which no effect of the library does, and how large an effect is beside what of it looks like that effect.

use gripsight_estimation::selection::Quadratic;
use gripsight_model::{BASE, EffectId};
use nalgebra::{DMatrix, DVector};

use crate::around::Around;
use crate::infer::FIRST;

/// What the free terms of a model explain, which no effect of the library does.
#[derive(Debug, Clone)]
pub(crate) struct Discrepancy<'p, 'a> {
    around: &'p Around<'p, 'a>,
    /// Information of the data, tires fitted along.
    information: DMatrix<f64>,
    /// Flexible columns of the model, and what they explain.
    columns: Vec<usize>,
    explained: f64,
}

impl<'p, 'a> Discrepancy<'p, 'a> {
    pub(crate) fn of(
        around: &'p Around<'p, 'a>,
        problem: &Quadratic,
        chosen: &[usize],
        values: &[f64],
    ) -> Option<Self> {
        let all = &problem.information;
        let n = all.nrows();
        let mut own = all.view((0, 0), (BASE, BASE)).into_owned();
        for term in &around.terms[..FIRST] {
            for (i, p) in term.priors.iter().enumerate() {
                own[(term.from + i, term.from + i)] += around.dispersion * p.sigma[0].powi(-2);
            }
        }
        let cross = all.view((0, 0), (BASE, n)).into_owned();
        let information = all - cross.tr_mul(&(own.try_inverse()? * &cross));
        let first = around.columns.first_flexible();
        let columns: Vec<usize> =
            (first..n).filter(|&c| chosen[around.columns.term_of_flexible(c)] > 0).collect();
        let mut step = DVector::zeros(n);
        columns.iter().for_each(|&c| step[c] = values[c]);
        let explained = step.dot(&(&information * &step));
        Some(Self { around, information, columns, explained })
    }

    /// What an effect explains, over what the free terms do times how much it looks like them (the cosine between it and the nearest that they
    /// can do).
    pub(crate) fn beside(&self, effect: EffectId, values: &[f64]) -> f64 {
        /// Share of a free term's own information that keeps the inverse regular.
        const RIDGE: f64 = 1e-6;
        let m = self.columns.len();
        let Some(range) = self.around.columns.of_effect(effect) else { return 0.0 };
        if m == 0 {
            return f64::INFINITY;
        }
        let mut step = DVector::zeros(self.information.nrows());
        for (c, spec) in range.zip(effect.spec().parameters) {
            step[c] = values[c] - spec.null;
        }
        let pull = &self.information * &step;
        let own = step.dot(&pull);
        let at = |i: usize, j: usize| self.information[(self.columns[i], self.columns[j])];
        let free = DMatrix::from_fn(m, m, |i, j| at(i, j) * if i == j { 1.0 + RIDGE } else { 1.0 });
        let side = DVector::from_fn(m, |i, _| pull[self.columns[i]]);
        let Some(solver) = free.cholesky() else { return 0.0 };
        let alike = (side.dot(&solver.solve(&side)) / own).clamp(0.0, 1.0).sqrt();
        own / (alike * self.explained).max(f64::MIN_POSITIVE)
    }
}
