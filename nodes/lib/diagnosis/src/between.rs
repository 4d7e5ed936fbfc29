//! How well what one drive says of a car carries over to another drive, although nobody has touched the car: what no model says of it comes out as other
//! parameters on another stretch of road. Two things are asked of the data, beyond what either drive's information says:
//!
//! * **How far do a drive's errors pull its parameters about?** The parameters without a block, less those with it, say it (the jackknife; Efron and Stein
//!   1981, "The jackknife estimate of variance"). Blocks of both drives in which the same is asked of the car are matched, and what the errors do there alike
//!   belongs to that stretch and is in both drives; the difference of a pair's pulls is what sets two unchanged drives apart:
//!
//!   ```text
//!   Sigma = sum over pairs (p_later - p_earlier) (p_later - p_earlier)'
//!   ```
//!
//!   A random part of this covariance beside the later drive's parameters takes from what it says only what the errors imitate: what two parameters say
//!   together and no block disputes stays known.
//! * **By how much more do the drives contradict each other than they may?** The mean over all directions of the squared standardised difference, less what
//!   changes explain of it, is the dispersion of the comparison (Birge 1932, "The calculation of errors by the method of least squares"): what
//!   does not stand out from the other contradictions is none of the car's.

use gripsight_estimation::selection::{Quadratic, configuration};
use nalgebra::{DMatrix, DVector};

use crate::inferred::Inferred;
use crate::sizes::{NINETY, ninety_of_t};

/// Share of what is told along the best directions from which a direction is told at all: below it are rounding errors.
const TOLD: f64 = 1e-9;

/// What sets two drives of a car apart, changes aside.
#[derive(Debug, Clone)]
pub(crate) struct Between {
    before: Pulls,
    /// A root of Sigma: a column for each of the later drive's blocks.
    pub(crate) root: DMatrix<f64>,
    /// Share of both drives' errors that belongs to one of them, from 0 over the same ground to 1.
    pub(crate) of_one: f64,
}

impl Between {
    pub(crate) fn of(earlier: &Inferred, later: &Inferred) -> Option<Self> {
        let (before, after) = (Pulls::of(earlier)?, Pulls::of(later)?);
        let (root, of_one) = apart(&before, &after)?;
        Some(Self { before, root, of_one })
    }

    /// How many times the information of both drives is smaller than if the model carried over. `problem`: what the later drive says, where the earlier one was
    /// linearised; `changed`: what the parameters have changed by.
    pub(crate) fn dispersion(&self, problem: &Quadratic, changed: &DVector<f64>) -> f64 {
        let covariance = &self.before.covariance + &self.root * self.root.transpose();
        contradiction(problem, &(&self.before.step + changed), &covariance)
    }
}

/// A drive with everything fitted, so that what has changed pulls nothing.
#[derive(Debug, Clone)]
struct Pulls {
    step: DVector<f64>,
    covariance: DMatrix<f64>,
    /// What each block asks of the car, and where its errors pull the parameters.
    blocks: Vec<(DMatrix<f64>, DVector<f64>)>,
}

impl Pulls {
    fn of(drive: &Inferred) -> Option<Self> {
        let Inferred { weighed, terms, dispersion, .. } = drive;
        let open: Vec<usize> = terms.iter().map(|t| t.log_weights.len() - 1).collect();
        let all = configuration(&weighed.total, *dispersion, terms, &open)?;
        let covariance = all.covariance();
        let precision = covariance.clone().cholesky()?.inverse();
        let pull = |block: &Quadratic| {
            let score = (&block.gradient + &block.information * &all.step) / *dispersion;
            let without = &precision - &block.information / *dispersion;
            Some((block.information.clone(), without.cholesky()?.solve(&score)))
        };
        let blocks = weighed.blocks.iter().map(pull).collect::<Option<_>>()?;
        Some(Self { step: all.step, covariance, blocks })
    }
}

/// A root of the covariance of the difference of two unchanged drives, and the share of the errors that belongs to one of them.
fn apart(earlier: &Pulls, later: &Pulls) -> Option<(DMatrix<f64>, f64)> {
    let known: DVector<f64> = earlier.blocks.iter().chain(&later.blocks).map(|b| b.0.diagonal()).sum();
    let unit = known.map(inverse_root);
    let scaled = |q: &DMatrix<f64>| {
        let s = in_units(q, &unit);
        let norm = s.norm().max(f64::MIN_POSITIVE);
        s / norm
    };
    let there: Vec<DMatrix<f64>> = earlier.blocks.iter().map(|b| scaled(&b.0)).collect();
    let (of_earlier, of_later) = (earlier.blocks.len() as f64, later.blocks.len() as f64);
    let pair = |(asked, pull): &(DMatrix<f64>, DVector<f64>)| {
        let here = scaled(asked);
        let alike = there.iter().map(|t| t.dot(&here)).enumerate();
        let nearest = alike.max_by(|x, y| x.1.total_cmp(&y.1))?.0;
        let before = &earlier.blocks[nearest].1 * (of_earlier / of_later).sqrt();
        let size = |p: &DVector<f64>| p.component_mul(&known.map(f64::sqrt)).norm_squared();
        let apart = pull - &before;
        Some((size(&apart), size(pull) + size(&before), apart))
    };
    let pairs: Vec<(f64, f64, DVector<f64>)> = later.blocks.iter().map(pair).collect::<Option<_>>()?;
    let (one, both) = pairs.iter().fold((0.0, 0.0), |(one, both), p| (one + p.0, both + p.1));
    let columns: Vec<DVector<f64>> = pairs.into_iter().map(|p| p.2).collect();
    // As for the sizes of one drive: over so few blocks differences have a t distribution.
    let wider = ninety_of_t(of_earlier.min(of_later) - 1.0) / NINETY;
    let share = if both > 0.0 { (one / both).min(1.0) } else { 0.0 };
    (!columns.is_empty()).then(|| (DMatrix::from_columns(&columns) * wider, share))
}

/// How many times larger than they may be the squared differences are between a step of known covariance and what a problem says: the mean over all directions, at
/// least 1.
fn contradiction(problem: &Quadratic, step: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    let score = &problem.gradient + &problem.information * step;
    let known = &problem.information + &problem.information * covariance * &problem.information;
    let unit = known.diagonal().map(inverse_root);
    let directions = in_units(&known, &unit).symmetric_eigen();
    let score = score.component_mul(&unit);
    let most = directions.eigenvalues.max();
    let told = directions.eigenvalues.iter().enumerate().filter(|(_, e)| **e > TOLD * most);
    let squares: Vec<f64> =
        told.map(|(i, e)| directions.eigenvectors.column(i).dot(&score).powi(2) / e).collect();
    if squares.is_empty() {
        return 1.0;
    }
    (squares.iter().sum::<f64>() / squares.len() as f64).max(1.0)
}

fn inverse_root(known: f64) -> f64 {
    if known > 0.0 { known.sqrt().recip() } else { 0.0 }
}

fn in_units(q: &DMatrix<f64>, unit: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(q.nrows(), q.ncols(), |r, c| q[(r, c)] * unit[r] * unit[c])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks that ask for one of two columns each, with their pulls.
    fn drive(blocks: &[([f64; 2], [f64; 2])]) -> Pulls {
        let one = |(asked, pull): &([f64; 2], [f64; 2])| {
            (DMatrix::from_diagonal(&DVector::from_row_slice(asked)), DVector::from_row_slice(pull))
        };
        Pulls {
            step: DVector::zeros(2),
            covariance: DMatrix::identity(2, 2),
            blocks: blocks.iter().map(one).collect(),
        }
    }

    #[test]
    fn drives_over_the_same_ground_are_not_set_apart_whatever_their_order() {
        let (fast, slow) = (([4.0, 1.0], [0.2, -0.1]), ([1.0, 4.0], [-0.2, 0.1]));
        let (same, of_one) = apart(&drive(&[fast, slow]), &drive(&[slow, fast])).unwrap();
        assert!(same.norm() < 1e-12 && of_one < 1e-12, "{same}");
        // Over other ground both scatter: the sum of squares of either, wider for two blocks.
        let turned = drive(&[(slow.0, [0.1, 0.2]), (fast.0, [-0.1, -0.2])]);
        let (other, of_one) = apart(&drive(&[fast, slow]), &turned).unwrap();
        approx::assert_relative_eq!(of_one, 1.0, epsilon = 1e-12);
        let sigma = &other * other.transpose() / (ninety_of_t(1.0) / NINETY).powi(2);
        approx::assert_relative_eq!(sigma.trace(), 0.2, epsilon = 1e-12);
    }

    #[test]
    fn contradictions_count_by_their_mean_and_not_where_errors_explain_them() {
        let n = 10;
        let problem = Quadratic {
            information: DMatrix::identity(n, n),
            gradient: DVector::from_fn(n, |i, _| if i == 3 { 20.0 } else { 2.0 }),
        };
        let (at, nothing) = (DVector::zeros(n), DMatrix::zeros(n, n));
        approx::assert_relative_eq!(contradiction(&problem, &at, &nothing), 43.6, epsilon = 1e-9);
        // A change of the one column explains its own.
        let changed = DVector::from_fn(n, |i, _| if i == 3 { -20.0 } else { 0.0 });
        approx::assert_relative_eq!(contradiction(&problem, &changed, &nothing), 3.6, epsilon = 1e-9);
        // So do errors that move it so far.
        let mut errors = nothing;
        errors[(3, 3)] = 399.0;
        approx::assert_relative_eq!(contradiction(&problem, &at, &errors), 3.7, epsilon = 1e-9);
    }
}
