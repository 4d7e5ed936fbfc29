//! Everything linearised around a fitted configuration: what each other one is foretold to leave of blocks that it is not fitted to.
//!
//! Around the fit the cost of block k is quadratic, c_k + 2 g_k'd + d'H_k d. A configuration is a set of columns that can move, and a displacement of those
//! that it lacks. With A = sum H_k/phi + Lambda its best step is d, and without block k
//!
//! ```text
//! d_k = d + (A - H_k/phi)^-1 (g_k + H_k d)/phi
//! ```
//!
//! so that sum_k 2 g_k'd_k + d_k'H_k d_k is what it leaves, less what the fit does: no rollout is asked for.

use gripsight_estimation::selection::{Quadratic, Term};
use gripsight_estimation::shooting::within;
use gripsight_model::EffectId;
use nalgebra::{DMatrix, DVector};

use crate::around::{Around, Refined};
use crate::hypotheses::terms;
use crate::infer::differences;
use crate::joint::{Joint, Weighed};

/// Everything linearised around a fitted configuration. Free terms that it lacks are left out.
#[derive(Debug)]
pub(crate) struct Near {
    values: Vec<f64>,
    starts: Vec<[f64; 2]>,
    terms: Vec<Term>,
    pub(crate) weighed: Weighed,
}

impl Near {
    /// Linearises around `fitted`; `None` where its model runs away.
    pub(crate) fn to(around: &Around<'_, '_>, library: &[EffectId], fitted: &Refined) -> Option<Self> {
        let Around { engine, columns, windows, .. } = *around;
        let (mut values, starts) = (fitted.values.clone(), fitted.starts.clone());
        let mut joint = Joint::of_sites(engine, columns, &values, &starts, windows, &[])?;
        differences(engine, columns, &mut values, &starts, windows, &mut joint);
        let terms = terms(engine, columns, &values, library);
        let weighed = joint.weighed(&vec![1.0; engine.sigma.len()]);
        Some(Self { values, starts, terms, weighed })
    }

    /// As a place that configurations are fitted from.
    pub(crate) fn around<'p, 'a>(&'p self, base: &Around<'p, 'a>) -> Around<'p, 'a> {
        Around { terms: &self.terms, values: &self.values, starts: &self.starts, ..*base }
    }
}

impl Around<'_, '_> {
    /// What a configuration is foretold to leave of blocks that are left out, less what the fit leaves that `weighed` is linearised around.
    pub(crate) fn foretold(&self, weighed: &Weighed, chosen: &[usize]) -> Option<f64> {
        let in_use = self.in_use(chosen);
        let blank = self.columns.blank(self.engine);
        let mut there = DVector::from_fn(blank.len(), |c, _| blank[c] - self.values[c]);
        let (mut free, mut precision, mut offset) = (Vec::new(), Vec::new(), Vec::new());
        let (mut low, mut high) = (Vec::new(), Vec::new());
        for (term, &alternative) in self.terms.iter().zip(chosen) {
            for (k, prior) in term.priors.iter().enumerate().filter(|(k, _)| in_use[term.from + k]) {
                there[term.from + k] = 0.0;
                free.push(term.from + k);
                precision.push(prior.sigma[alternative].powi(-2));
                offset.push(prior.offset);
                low.push(prior.bounds[0]);
                high.push(prior.bounds[1]);
            }
        }
        let prior = DMatrix::from_diagonal(&DVector::from_vec(precision));
        let problem = Moving {
            free,
            phi: self.dispersion,
            prior,
            offset: offset.into(),
            low: low.into(),
            high: high.into(),
        };
        problem.left_out(weighed, &there)
    }
}

/// Columns that can move, with their priors and bounds as differences to where they are.
struct Moving {
    free: Vec<usize>,
    phi: f64,
    prior: DMatrix<f64>,
    offset: DVector<f64>,
    low: DVector<f64>,
    high: DVector<f64>,
}

impl Moving {
    fn information(&self, of: &Quadratic) -> DMatrix<f64> {
        let n = self.free.len();
        DMatrix::from_fn(n, n, |r, c| of.information[(self.free[r], self.free[c])] / self.phi)
    }

    /// Half the gradient of the cost where a displacement of all columns leads.
    fn slope(&self, of: &Quadratic, by: &DVector<f64>) -> DVector<f64> {
        let whole = &of.gradient + &of.information * by;
        DVector::from_fn(self.free.len(), |r, _| whole[self.free[r]] / self.phi)
    }

    fn moved(&self, there: &DVector<f64>, step: &DVector<f64>) -> DVector<f64> {
        let mut out = there.clone();
        self.free.iter().zip(step.iter()).for_each(|(&c, s)| out[c] += s);
        out
    }

    /// Sum of what each block is left with by the best step without it. `there`: where the columns are that do not move.
    fn left_out(&self, weighed: &Weighed, there: &DVector<f64>) -> Option<f64> {
        let whole = self.information(&weighed.total) + &self.prior;
        let gradient = self.slope(&weighed.total, there) - &self.prior * &self.offset;
        let step = within(&whole, &gradient, &self.low, &self.high)?;
        let best = self.moved(there, &step);
        let slope = &whole * &step + &gradient;
        let of_block = |block: &Quadratic| {
            let (rest, slope) = (&whole - self.information(block), &slope - self.slope(block, &best));
            let to = self.moved(&best, &within(&rest, &slope, &(&self.low - &step), &(&self.high - &step))?);
            Some(2.0 * block.gradient.dot(&to) + to.dot(&(&block.information * &to)))
        };
        weighed.blocks.iter().map(of_block).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{configured, with_around};

    /// Blocks of y = a + b x with their errors, of which only the first tells b.
    const DATA: [&[[f64; 2]]; 3] = [
        &[[0.5, 1.3], [-1.0, 0.4], [2.0, 2.9]],
        &[[0.0, 0.7], [0.1, 1.1]],
        &[[0.0, 1.2], [-0.1, 0.9], [0.0, 1.4]],
    ];
    const AT: [f64; 2] = [0.9, 0.8];
    const PRECISION: f64 = 0.25;
    const PHI: f64 = 1.7;

    fn left(a: f64, b: f64, block: &[[f64; 2]]) -> f64 {
        block.iter().map(|[x, y]| (y - a - b * x).powi(2)).sum()
    }

    fn weighed() -> Weighed {
        let quadratic = |block: &[[f64; 2]]| {
            let x = DMatrix::from_fn(block.len(), 2, |r, c| if c == 0 { 1.0 } else { block[r][0] });
            let y = DVector::from_fn(block.len(), |r, _| block[r][1]);
            let rest = y - &x * DVector::from_row_slice(&AT);
            Quadratic { information: x.tr_mul(&x), gradient: -x.tr_mul(&rest) }
        };
        let blocks: Vec<Quadratic> = DATA.into_iter().map(quadratic).collect();
        let total = Quadratic {
            information: blocks.iter().map(|b| &b.information).sum(),
            gradient: blocks.iter().map(|b| &b.gradient).sum(),
        };
        Weighed { total, blocks, cost: 0.0, residuals: 0.0 }
    }

    #[test]
    fn of_a_linear_model_what_is_foretold_is_what_is_left() {
        let whole = |a: f64, b: f64| DATA.iter().map(|block| left(a, b, block)).sum::<f64>();
        // The intercept moves, the slope is taken out.
        let moving = |low: f64| Moving {
            free: vec![0],
            phi: PHI,
            prior: DMatrix::from_element(1, 1, PRECISION),
            offset: DVector::from_element(1, -AT[0]),
            low: DVector::from_element(1, low - AT[0]),
            high: DVector::from_element(1, 10.0),
        };
        let foretold = |low: f64| {
            moving(low).left_out(&weighed(), &DVector::from_row_slice(&[0.0, -AT[1]])).unwrap()
                + whole(AT[0], AT[1])
        };
        let without = |skip: usize| {
            let rest = (0..3).filter(|k| *k != skip).flat_map(|k| DATA[k]);
            let (sum, count) = rest.fold((0.0, 0.0), |(s, n), [_, y]| (s + y, n + 1.0));
            sum / PHI / (count / PHI + PRECISION)
        };
        let free = (0..3).map(|k| left(without(k), 0.0, DATA[k])).sum::<f64>();
        approx::assert_relative_eq!(foretold(-10.0), free, epsilon = 1e-9);
        let bound = (0..3).map(|k| left(without(k).max(1.2), 0.0, DATA[k])).sum::<f64>();
        assert!((bound - free).abs() > 0.01, "{bound} {free}");
        approx::assert_relative_eq!(foretold(1.2), bound, epsilon = 1e-9);
    }

    #[test]
    fn around_a_fit_it_is_foretold_what_is_needed_and_what_is_not() {
        with_around(0.06, |around, weighed| {
            let chosen = configured(around, &[EffectId::SteeringLag]);
            let fit = around.by_rollouts_to_the_end(&weighed.total, &chosen).unwrap().fitted;
            let near = Near::to(around, &around.columns.effects, &fit).unwrap();
            let of = |effects: &[EffectId]| {
                near.around(around).foretold(&near.weighed, &configured(around, effects)).unwrap()
            };
            let own = of(&[EffectId::SteeringLag]);
            assert!(of(&[]) - own > 100.0, "{} {own}", of(&[]));
            let fuller = of(&[EffectId::SteeringLag, EffectId::VyBias]);
            assert!((fuller - own).abs() < 5.0, "{fuller} {own}");
        });
    }
}
