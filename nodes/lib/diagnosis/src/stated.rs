//! What survives on data that nothing was fitted to.

use gripsight_estimation::selection::{Quadratic, Term};
use gripsight_estimation::shooting::{self, Parameter};
use gripsight_model::{BASE, EffectId};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::around::{Around, Refined};
use crate::budget::Scorer;
use crate::decisions;
use crate::infer::FIRST;

/// Iterations of the fit of start states.
const START_ITERATIONS: usize = 6;

/// An effect of the model that is stated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Statement {
    pub(crate) term: usize,
    /// Share of the error on data held out, noise included, that is left without it and that it closes.
    pub(crate) closes: f64,
    /// What it explains over what of the unnamed looks like it; infinite where nothing unnamed is needed.
    pub(crate) beside: f64,
}

/// What the free terms of a model explain, which no effect of the library does.
#[derive(Debug, Clone)]
struct Discrepancy<'p, 'a> {
    around: &'p Around<'p, 'a>,
    /// Information of the data, tires fitted along.
    information: DMatrix<f64>,
    /// Flexible columns of the model, and what they explain.
    columns: Vec<usize>,
    explained: f64,
}

impl<'p, 'a> Discrepancy<'p, 'a> {
    fn of(around: &'p Around<'p, 'a>, problem: &Quadratic, chosen: &[usize], values: &[f64]) -> Option<Self> {
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
    fn beside(&self, effect: EffectId, values: &[f64]) -> f64 {
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

impl Around<'_, '_> {
    /// Mean robust cost of a residual on data held out: all channels, under the noise of the inference.
    fn error_apart(&self, scorer: &Scorer<'_>, chosen: &[usize], values: &[f64]) -> f64 {
        let (model, own, _) = self.model(&scorer.engine, chosen, values);
        let fixed = |&start: &f64| Parameter { start, low: start, high: start, free: false, prior: None };
        let parameters: Vec<Parameter> = own.iter().map(fixed).collect();
        let problem = self.engine.problem(&model, &scorer.windows.windows, &parameters, START_ITERATIONS);
        let at = shooting::descend(&problem, None).at;
        at.cost / at.residuals as f64
    }

    /// The terms with some of them no larger than in any car: their prior alone lets strong data keep what every car has a little of.
    fn without(&self, gone: &[usize]) -> Vec<Term> {
        /// Standard deviations of the prior.
        const MOST: f64 = 2.0;
        let mut terms = self.terms.to_vec();
        for &i in gone.iter().filter(|&&i| self.terms[i].log_weights.len() > 1) {
            for p in &mut terms[i].priors {
                let most = MOST * p.sigma[0];
                p.bounds = [p.bounds[0].max(p.offset - most), p.bounds[1].min(p.offset + most)];
            }
        }
        terms
    }

    /// Takes out of a configuration, one after the other, the effects without which data held out are predicted as well: those that close less
    /// than [`decisions::LEAST_CLOSED`] of the error that is left without them, the least needed first.
    pub(crate) fn stated(
        &self,
        problem: &Quadratic,
        chosen: Vec<usize>,
        fitted: Refined,
        scorer: &Scorer<'_>,
    ) -> Option<Vec<Statement>> {
        let error = |chosen: &[usize], values: &[f64]| self.error_apart(scorer, chosen, values);
        let blank = vec![0; chosen.len()];
        let everything: Vec<usize> = (0..chosen.len()).collect();
        let none = self.without(&everything);
        let null = error(&blank, &Around { terms: &none, ..*self }.by_rollouts(problem, &blank)?.1.values);
        let (mut chosen, mut values) = (chosen, fitted.values);
        loop {
            let with = error(&chosen, &values);
            let effects: Vec<usize> =
                (FIRST..FIRST + self.columns.effects.len()).filter(|&i| chosen[i] > 0).collect();
            let simpler: Vec<(usize, f64, Vec<usize>, Vec<f64>)> = effects
                .into_par_iter()
                .filter_map(|i| {
                    let mut without = chosen.clone();
                    without[i] = 0;
                    let terms = self.without(&[i]);
                    let lacking_it = Around { terms: &terms, ..*self };
                    let mut values = lacking_it.nearby(problem, &without)?.1.values;
                    let mut lacking = error(&without, &values);
                    if lacking > null {
                        // Worse than with no effect at all: too far away for a look.
                        values = lacking_it.by_rollouts(problem, &without)?.1.values;
                        lacking = error(&without, &values);
                    }
                    let closes = 1.0 - with / lacking;
                    Some((i, closes, without, values))
                })
                .collect();
            let least = simpler.iter().min_by(|a, b| a.1.total_cmp(&b.1));
            match least.filter(|l| l.1 < decisions::LEAST_CLOSED) {
                Some(least) => (chosen, values) = (least.2.clone(), least.3.clone()),
                None => {
                    let discrepancy = Discrepancy::of(self, problem, &chosen, &values)?;
                    let closes = simpler
                        .into_iter()
                        .map(|s| (s.0, s.1))
                        .map(|(term, closes)| {
                            let beside = discrepancy.beside(self.columns.effects[term - FIRST], &values);
                            Statement { term, closes, beside }
                        })
                        .collect();
                    return Some(closes);
                }
            }
        }
    }
}
