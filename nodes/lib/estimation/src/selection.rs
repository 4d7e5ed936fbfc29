//! Which terms of a model the data ask for: all subsets of many candidate terms compared on one linearisation.
//!
//! Around the present parameters a least-squares problem is quadratic: information H, gradient g, the noise's dispersion phi. Every term has a
//! few alternative Gaussian priors, narrow ("as little as any car has") and wide ("it matters here"). Which alternative of which term holds is
//! a discrete configuration; its evidence is closed:
//!
//! ```text
//! A = H/phi + Lambda,   b = -g/phi + Lambda (mu - theta),   m = A^-1 b
//! ln Z = 1/2 b' m - 1/2 (mu - theta)' Lambda (mu - theta) + 1/2 ln|Lambda| - 1/2 ln|A| + const
//! ```
//!
//! Gibbs sampling over the configurations gives the probability of every alternative, with all others averaged over (George and McCulloch 1993,
//! "Variable selection via Gibbs sampling"). A change of one term is an update of rank k, so a sweep over a hundred terms costs less than one
//! rollout of the car.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A least-squares problem around a point: cost(theta + d) = cost + 2 g'd + d'Hd.
#[derive(Debug, Clone)]
pub struct Quadratic {
    /// H: J'J of all terms, start states eliminated; of the data alone.
    pub information: DMatrix<f64>,
    /// g: half the gradient; of the data alone.
    pub gradient: DVector<f64>,
}

/// A prior of one column: its mean as a difference to the present value, and a standard deviation for each alternative of its term.
#[derive(Debug, Clone, PartialEq)]
pub struct ColumnPrior {
    /// Mean less the present value.
    pub offset: f64,
    /// Standard deviations, one for each alternative of the term.
    pub sigma: Vec<f64>,
    /// Where the step may lie: a time constant is not negative.
    pub bounds: [f64; 2],
}

/// A term: columns that share one choice.
#[derive(Debug, Clone, PartialEq)]
pub struct Term {
    /// First column; the others follow.
    pub from: usize,
    /// Priors of its columns.
    pub priors: Vec<ColumnPrior>,
    /// Logarithm of the prior weight of each alternative; its length is the number of alternatives.
    pub log_weights: Vec<f64>,
}

impl Term {
    /// The same with one alternative alone.
    #[must_use]
    pub fn only(&self, alternative: usize) -> Self {
        let one = |p: &ColumnPrior| ColumnPrior { sigma: vec![p.sigma[alternative]], ..p.clone() };
        Self { from: self.from, priors: self.priors.iter().map(one).collect(), log_weights: vec![0.0] }
    }

    fn columns(&self) -> std::ops::Range<usize> {
        self.from..self.from + self.priors.len()
    }

    fn precision(&self, column: usize, alternative: usize) -> f64 {
        self.priors[column].sigma[alternative].powi(-2)
    }
}

/// What a selection comes to.
#[derive(Debug, Clone)]
pub struct Selection {
    /// Probability of each alternative of each term.
    pub probability: Vec<Vec<f64>>,
    /// Mean step of each term's columns where an alternative holds (term, alternative, column), and its standard deviation.
    pub mean: Vec<Vec<Vec<f64>>>,
    /// Standard deviations that go with [`Self::mean`].
    pub sigma: Vec<Vec<Vec<f64>>>,
    /// The most probable configuration that was met: an alternative for each term.
    pub best: Vec<usize>,
    /// The mean step of all columns there.
    pub best_step: DVector<f64>,
    /// The configurations met after the run-in, a sweep each: what joint probabilities are counted from.
    pub visited: Vec<Vec<u8>>,
}

impl Selection {
    /// Probability of a statement about the configuration.
    #[must_use]
    pub fn probability_that(&self, holds: impl Fn(&[u8]) -> bool) -> f64 {
        let count = self.visited.iter().filter(|c| holds(c)).count();
        count as f64 / self.visited.len().max(1) as f64
    }
}

/// Sweeps before configurations count, and those that count.
const RUN_IN: usize = 30;
const SWEEPS: usize = 150;
/// Sweeps after which the covariance is computed anew.
const REFRESH: usize = 10;
/// Pairs of terms whose choices are swapped in a sweep.
const SWAPS: usize = 40;

struct Sampler<'a> {
    problem: &'a Quadratic,
    terms: &'a [Term],
    /// Present alternative of each term.
    chosen: Vec<usize>,
    covariance: DMatrix<f64>,
    mean: DVector<f64>,
}

/// Compares all configurations of the terms, which together cover every column of the problem once. `dispersion`: phi. `start`: the
/// configuration to begin with. Deterministic for a seed; `None` where the problem is singular or not finite.
#[must_use]
pub fn select(
    problem: &Quadratic,
    dispersion: f64,
    terms: &[Term],
    start: &[usize],
    seed: u64,
) -> Option<Selection> {
    let scaled = Quadratic {
        information: &problem.information / dispersion,
        gradient: &problem.gradient / dispersion,
    };
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut sampler = Sampler {
        problem: &scaled,
        terms,
        chosen: start.to_vec(),
        covariance: DMatrix::zeros(0, 0),
        mean: DVector::zeros(0),
    };
    let mut evidence = sampler.refresh()?;
    let mut best = (evidence + sampler.log_within_bounds(), sampler.chosen.clone(), sampler.mean.clone());
    let count = |t: &Term| t.log_weights.len();
    let mut sums: Vec<Vec<(f64, Vec<[f64; 2]>)>> =
        terms.iter().map(|t| vec![(0.0, vec![[0.0; 2]; t.priors.len()]); count(t)]).collect();
    let mut visited = Vec::with_capacity(SWEEPS);
    let open: Vec<usize> = (0..terms.len()).filter(|&i| count(&terms[i]) > 1).collect();
    for sweep in 0..RUN_IN + SWEEPS {
        if sweep % REFRESH == 0 {
            evidence = sampler.refresh()?;
        }
        for &i in &open {
            let (own, weights, total) = match sampler.weights(i) {
                Some(found) => found,
                None => {
                    // The updates have lost too many digits: from scratch.
                    evidence = sampler.refresh()?;
                    let Some(found) = sampler.weights(i) else { continue };
                    found
                }
            };
            if sweep >= RUN_IN {
                for (a, w) in weights.iter().enumerate() {
                    let share = w / total;
                    sums[i][a].0 += share;
                    if share > 1e-6 {
                        for (sum, [m, v]) in sums[i][a].1.iter_mut().zip(&own[a]) {
                            sum[0] += share * m;
                            sum[1] += share * (v + m * m);
                        }
                    }
                }
            }
            let mut left = random.random::<f64>() * total;
            let drawn = weights.iter().position(|w| {
                left -= w;
                left <= 0.0
            });
            let drawn = drawn.unwrap_or(weights.len() - 1);
            if drawn != sampler.chosen[i] {
                evidence += sampler.ratio(&[(i, drawn)]);
                sampler.change(&[(i, drawn)]);
            }
        }
        for _ in 0..SWAPS.min(open.len() * open.len()) {
            let pick = |random: &mut ChaCha8Rng| open[random.random_range(0..open.len())];
            let (i, j) = (pick(&mut random), pick(&mut random));
            let (a, b) = (sampler.chosen[i], sampler.chosen[j]);
            if i == j || a == b || a >= count(&terms[j]) || b >= count(&terms[i]) {
                continue;
            }
            let ratio = sampler.ratio(&[(i, b), (j, a)]);
            if ratio >= 0.0 || random.random::<f64>() < ratio.exp() {
                evidence += ratio;
                sampler.change(&[(i, b), (j, a)]);
            }
        }
        if sweep < RUN_IN {
            evidence += sampler.simplified(&open);
        }
        let possible = evidence + sampler.log_within_bounds();
        if possible > best.0 {
            best = (possible, sampler.chosen.clone(), sampler.mean.clone());
        }
        if sweep >= RUN_IN {
            visited.push(sampler.chosen.iter().map(|&a| a as u8).collect());
        }
    }
    let shares = |of: &[(f64, Vec<[f64; 2]>)]| -> Vec<f64> {
        let all: f64 = of.iter().map(|s| s.0).sum();
        of.iter().map(|s| if all > 0.0 { s.0 / all } else { 1.0 / of.len() as f64 }).collect()
    };
    let moment = |s: &(f64, Vec<[f64; 2]>), f: fn([f64; 2]) -> f64| -> Vec<f64> {
        s.1.iter().map(|sum| if s.0 > 0.0 { f(sum.map(|v| v / s.0)) } else { f64::NAN }).collect()
    };
    Some(Selection {
        probability: sums.iter().map(|t| shares(t)).collect(),
        mean: sums.iter().map(|t| t.iter().map(|s| moment(s, |m| m[0])).collect()).collect(),
        sigma: sums
            .iter()
            .map(|t| t.iter().map(|s| moment(s, |m| (m[1] - m[0] * m[0]).max(0.0).sqrt())).collect())
            .collect(),
        best: best.1,
        best_step: best.2,
        visited,
    })
}

/// One configuration by itself.
#[derive(Debug, Clone)]
pub struct Configuration {
    /// Logarithm of its evidence, up to a constant that all configurations share; prior weights not counted.
    pub log_evidence: f64,
    /// The part of it that is not the least cost: what its freedom costs (Occam's factor), prior weights counted.
    pub log_occam: f64,
    /// Mean step of all columns.
    pub step: DVector<f64>,
    precision: Cholesky<f64, Dyn>,
}

impl Configuration {
    /// Covariance of all columns.
    #[must_use]
    pub fn covariance(&self) -> DMatrix<f64> {
        self.precision.inverse()
    }
}

/// Evidence, step and covariance of one configuration; `None` where it is singular or not finite.
#[must_use]
pub fn configuration(
    problem: &Quadratic,
    dispersion: f64,
    terms: &[Term],
    chosen: &[usize],
) -> Option<Configuration> {
    let scaled = Quadratic {
        information: &problem.information / dispersion,
        gradient: &problem.gradient / dispersion,
    };
    let mut sampler = Sampler {
        problem: &scaled,
        terms,
        chosen: chosen.to_vec(),
        covariance: DMatrix::zeros(0, 0),
        mean: DVector::zeros(0),
    };
    let (log_evidence, precision) = sampler.solved()?;
    let log_evidence = log_evidence - sampler.log_weight();
    let step = sampler.mean.clone();
    // Twice the drop of the cost, less what the priors take.
    let data = -2.0 * scaled.gradient.dot(&step) - (&scaled.information * &step).dot(&step);
    let priors: f64 = terms
        .iter()
        .zip(chosen)
        .flat_map(|(t, &a)| t.columns().enumerate().map(move |(c, column)| (t, a, c, column)))
        .map(|(t, a, c, column)| (step[column] - t.priors[c].offset).powi(2) * t.precision(c, a))
        .sum();
    let log_occam = log_evidence - 0.5 * (data - priors) + sampler.log_weight();
    Some(Configuration { log_evidence, log_occam, step, precision })
}

/// Logarithm of how much more of a term's posterior than of its prior lies within the bounds: columns taken one by one.
fn within_bounds(term: &Term, alternative: usize, posterior: &[[f64; 2]]) -> f64 {
    let column = |(prior, [mean, variance]): (&ColumnPrior, &[f64; 2])| {
        let after = share_within(*mean, variance.sqrt().max(f64::MIN_POSITIVE), prior.bounds);
        (after / share_within(prior.offset, prior.sigma[alternative], prior.bounds)).ln()
    };
    term.priors
        .iter()
        .zip(posterior)
        .filter(|(p, _)| p.bounds.iter().any(|b| b.is_finite()))
        .map(column)
        .sum()
}

/// A probability below this counts as this.
const LEAST_SHARE: f64 = 1e-300;

/// Probability that a normal variable lies within bounds.
fn share_within(mean: f64, sigma: f64, [low, high]: [f64; 2]) -> f64 {
    // Upper tails, so that what lies far out on one side keeps its digits.
    let upper = |z: f64| 0.5 * libm::erfc(z / std::f64::consts::SQRT_2);
    let (from, to) = ((low - mean) / sigma, (high - mean) / sigma);
    let share = if from > 0.0 { upper(from) - upper(to) } else { upper(-to) - upper(-from) };
    share.max(LEAST_SHARE)
}

impl Sampler<'_> {
    fn log_weight(&self) -> f64 {
        self.terms.iter().zip(&self.chosen).map(|(t, &a)| t.log_weights[a]).sum()
    }

    /// Logarithm of how much more of the posterior than of the priors lies within the bounds: a configuration that explains the data best with an
    /// impossible value is not the most probable one.
    fn log_within_bounds(&self) -> f64 {
        self.terms
            .iter()
            .zip(&self.chosen)
            .filter(|(t, _)| t.log_weights.len() > 1)
            .map(|(term, &alternative)| {
                let moments: Vec<[f64; 2]> =
                    term.columns().map(|c| [self.mean[c], self.covariance[(c, c)].max(0.0)]).collect();
                within_bounds(term, alternative, &moments)
            })
            .sum()
    }

    /// Moments of a term's columns under each of its alternatives, the alternatives' weights, and their sum; `None` where rounding has made them no
    /// weights.
    #[expect(clippy::type_complexity, reason = "used in one place, and taken apart at once")]
    fn weights(&self, i: usize) -> Option<(Vec<Vec<[f64; 2]>>, Vec<f64>, f64)> {
        let term = &self.terms[i];
        let alternatives = 0..term.log_weights.len();
        let own: Vec<Vec<[f64; 2]>> = alternatives.clone().map(|a| self.moments(i, a)).collect();
        let ratio = |a: usize| self.ratio(&[(i, a)]) + within_bounds(term, a, &own[a]);
        let ratios: Vec<f64> = alternatives.map(ratio).collect();
        let largest = ratios.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = ratios.iter().map(|r| (r - largest).exp()).collect();
        let total: f64 = weights.iter().sum();
        (total.is_finite() && total > 0.0).then_some((own, weights, total))
    }

    /// Covariance and mean from scratch; the logarithm of evidence times prior weight.
    fn refresh(&mut self) -> Option<f64> {
        let (evidence, precision) = self.solved()?;
        self.covariance = precision.inverse();
        Some(evidence)
    }

    /// The mean from scratch; the logarithm of evidence times prior weight, and the precision of all columns.
    fn solved(&mut self) -> Option<(f64, Cholesky<f64, Dyn>)> {
        let n = self.problem.gradient.len();
        let mut a = self.problem.information.clone();
        let mut b = -&self.problem.gradient;
        let (mut log_prior, mut quadratic) = (0.0, 0.0);
        for (term, &alternative) in self.terms.iter().zip(&self.chosen) {
            for (c, column) in term.columns().enumerate() {
                let precision = term.precision(c, alternative);
                let offset = term.priors[c].offset;
                a[(column, column)] += precision;
                b[column] += precision * offset;
                log_prior += 0.5 * precision.ln();
                quadratic += precision * offset * offset;
            }
        }
        let cholesky = a.cholesky()?;
        let log_det: f64 = (0..n).map(|i| cholesky.l_dirty()[(i, i)].ln()).sum();
        self.mean = cholesky.solve(&b);
        let evidence = 0.5 * b.dot(&self.mean) - 0.5 * quadratic + log_prior - log_det + self.log_weight();
        evidence.is_finite().then_some((evidence, cholesky))
    }

    /// Columns of changed terms with the change of their precisions and their offsets.
    fn delta(&self, changes: &[(usize, usize)]) -> Vec<(usize, f64, f64, f64)> {
        let mut out = Vec::new();
        for &(i, to) in changes {
            let term = &self.terms[i];
            for (c, column) in term.columns().enumerate() {
                let (now, then) = (term.precision(c, self.chosen[i]), term.precision(c, to));
                if now != then {
                    out.push((column, then - now, term.priors[c].offset, 0.5 * (then / now).ln()));
                }
            }
        }
        out
    }

    /// I + C_SS D of a change D of precisions, and the step's residual offset - mean.
    fn around(&self, delta: &[(usize, f64, f64, f64)]) -> (DMatrix<f64>, DVector<f64>) {
        let k = delta.len();
        let matrix = DMatrix::from_fn(k, k, |a, b| {
            self.covariance[(delta[a].0, delta[b].0)] * delta[b].1 + if a == b { 1.0 } else { 0.0 }
        });
        (matrix, DVector::from_fn(k, |a, _| delta[a].2 - self.mean[delta[a].0]))
    }

    /// Logarithm of the evidence times prior weight after a change, less that now.
    fn ratio(&self, changes: &[(usize, usize)]) -> f64 {
        let weights: f64 = changes
            .iter()
            .map(|&(i, a)| self.terms[i].log_weights[a] - self.terms[i].log_weights[self.chosen[i]])
            .sum();
        let delta = self.delta(changes);
        if delta.is_empty() {
            return weights;
        }
        let (matrix, away) = self.around(&delta);
        let lu = matrix.lu();
        let determinant = lu.determinant();
        let Some(solved) = lu.solve(&away) else { return f64::NEG_INFINITY };
        if determinant <= 0.0 || !determinant.is_finite() {
            return f64::NEG_INFINITY;
        }
        // The change of the least cost: away' D (I + C D)^-1 away, by the matrix inversion lemma.
        let cost: f64 = delta.iter().enumerate().map(|(a, d)| away[a] * d.1 * solved[a]).sum();
        let priors: f64 = delta.iter().map(|d| d.3).sum();
        weights + priors - 0.5 * determinant.ln() - 0.5 * cost
    }

    /// Takes out pairs of terms that do nothing but cancel each other: neither goes alone, and a chain seldom tries both at once. How much the
    /// logarithm of the evidence gains.
    fn simplified(&mut self, open: &[usize]) -> f64 {
        let mut gain = 0.0;
        loop {
            let there: Vec<usize> = open.iter().copied().filter(|&i| self.chosen[i] > 0).collect();
            let pairs = there.iter().enumerate().flat_map(|(n, &i)| there[..n].iter().map(move |&j| (i, j)));
            let of = |(i, j): (usize, usize)| (i, j, self.ratio(&[(i, 0), (j, 0)]));
            let best = pairs.map(of).max_by(|a, b| a.2.total_cmp(&b.2));
            let Some((i, j, ratio)) = best.filter(|b| b.2 > 0.0 && b.2.is_finite()) else { return gain };
            gain += ratio;
            self.change(&[(i, 0), (j, 0)]);
        }
    }

    /// Mean and variance of a term's columns were one of its alternatives chosen.
    fn moments(&self, i: usize, to: usize) -> Vec<[f64; 2]> {
        let term = &self.terms[i];
        let k = term.priors.len();
        let from = term.from;
        let block = DMatrix::from_fn(k, k, |a, b| self.covariance[(from + a, from + b)]);
        let d: Vec<f64> = (0..k).map(|c| term.precision(c, to) - term.precision(c, self.chosen[i])).collect();
        let matrix = DMatrix::from_fn(k, k, |a, b| block[(a, b)] * d[b] + if a == b { 1.0 } else { 0.0 });
        let Some(inverse) = matrix.try_inverse() else { return vec![[f64::NAN; 2]; k] };
        let covariance = inverse * &block;
        let pull = DVector::from_fn(k, |a, _| d[a] * (term.priors[a].offset - self.mean[from + a]));
        let step = &covariance * pull;
        (0..k).map(|a| [self.mean[from + a] + step[a], covariance[(a, a)].max(0.0)]).collect()
    }

    fn change(&mut self, changes: &[(usize, usize)]) {
        let delta = self.delta(changes);
        if !delta.is_empty() {
            let (matrix, away) = self.around(&delta);
            if let Some(inverse) = matrix.try_inverse() {
                let n = self.mean.len();
                let k = delta.len();
                let columns = DMatrix::from_fn(n, k, |r, a| self.covariance[(r, delta[a].0)]);
                // C' = C - C_S D (I + C_SS D)^-1 C_S'.
                let middle = DMatrix::from_fn(k, k, |a, b| delta[a].1 * inverse[(a, b)]);
                self.covariance -= &columns * &middle * columns.transpose();
                let pull = DVector::from_fn(k, |a, _| delta[a].1 * away[a]);
                for r in 0..n {
                    self.mean[r] += (0..k).map(|a| self.covariance[(r, delta[a].0)] * pull[a]).sum::<f64>();
                }
            }
        }
        for &(i, a) in changes {
            self.chosen[i] = a;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = 2 x_1 + noise, x_2 close to x_1, x_3 something else.
    fn problem(noise: f64) -> Quadratic {
        let n = 400;
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
        let x = DMatrix::from_fn(n, 3, |_, _| normal());
        let x = DMatrix::from_fn(n, 3, |r, c| if c == 1 { x[(r, 0)] + 0.3 * x[(r, 1)] } else { x[(r, c)] });
        let residual = DVector::from_fn(n, |r, _| (2.0 * x[(r, 0)]) / noise + normal());
        let x = x / noise;
        // residual = measured - predicted; predicted grows by x d.
        Quadratic { information: x.tr_mul(&x), gradient: -x.tr_mul(&residual) }
    }

    fn terms() -> Vec<Term> {
        (0..3)
            .map(|from| Term {
                from,
                priors: vec![ColumnPrior {
                    offset: 0.0,
                    sigma: vec![0.02, 2.0],
                    bounds: [f64::NEG_INFINITY, f64::INFINITY],
                }],
                log_weights: vec![0.95_f64.ln(), 0.05_f64.ln()],
            })
            .collect()
    }

    #[test]
    fn the_term_that_is_there_is_selected_and_its_size_told() {
        let s = select(&problem(1.0), 1.0, &terms(), &[0, 0, 0], 1).unwrap();
        assert_eq!(s.best, [1, 0, 0]);
        assert!(
            s.probability[0][1] > 0.95 && s.probability[1][1] < 0.2 && s.probability[2][1] < 0.1,
            "{s:?}"
        );
        assert!((s.mean[0][1][0] - 2.0).abs() < 4.0 * s.sigma[0][1][0] && s.sigma[0][1][0] < 0.3);
    }

    /// Of two terms that pull opposite ways the data like the one a little better by a value that it cannot have.
    #[test]
    fn the_best_configuration_rests_on_no_impossible_value() {
        let information = DMatrix::from_row_slice(2, 2, &[400.0, -396.0, -396.0, 400.0]);
        let problem = Quadratic { information, gradient: DVector::from_row_slice(&[400.0, -396.0]) };
        let mut terms = terms();
        terms.truncate(2);
        let best = |terms: &[Term]| select(&problem, 1.0, terms, &[1, 0], 1).unwrap().best;
        assert_eq!(best(&terms), [1, 0]);
        terms[0].priors[0].bounds = [0.0, f64::INFINITY];
        assert_eq!(best(&terms), [0, 1]);
    }

    #[test]
    fn what_the_data_cannot_tell_apart_shares_its_probability() {
        let (problem, terms) = (problem(8.0), terms());
        let s = select(&problem, 1.0, &terms, &[0, 0, 0], 1).unwrap();
        let weight = |chosen: &[usize]| {
            let prior: f64 = terms.iter().zip(chosen).map(|(t, &a)| t.log_weights[a]).sum();
            (configuration(&problem, 1.0, &terms, chosen).unwrap().log_evidence + prior).exp()
        };
        let all: Vec<[usize; 3]> = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2]).collect();
        let total: f64 = all.iter().map(|c| weight(c)).sum();
        for term in 0..3 {
            let exact = all.iter().filter(|c| c[term] == 1).map(|c| weight(c)).sum::<f64>() / total;
            // A standard deviation of a sampled probability is at most 0.5 / sqrt(150) = 0.04.
            approx::assert_abs_diff_eq!(s.probability[term][1], exact, epsilon = 0.12);
        }
        let either = s.probability_that(|c| c[0] == 1 || c[1] == 1);
        assert!(
            either > 0.8 && s.probability[0][1] > 0.1 && s.probability[1][1] > 0.1,
            "{either} {:?}",
            s.probability
        );
    }

    #[test]
    fn ratios_and_updates_agree_with_the_evidence_from_scratch() {
        let (problem, terms) = (problem(2.0), terms());
        let all = |chosen: &[usize]| configuration(&problem, 1.3, &terms, chosen).unwrap();
        let scaled = Quadratic { information: &problem.information / 1.3, gradient: &problem.gradient / 1.3 };
        let mut sampler = Sampler {
            problem: &scaled,
            terms: &terms,
            chosen: vec![0, 0, 0],
            covariance: DMatrix::zeros(0, 0),
            mean: DVector::zeros(0),
        };
        sampler.refresh().unwrap();
        let weights = (0.05_f64 / 0.95).ln();
        let ratio = sampler.ratio(&[(0, 1), (2, 1)]);
        approx::assert_relative_eq!(
            ratio,
            all(&[1, 0, 1]).log_evidence - all(&[0, 0, 0]).log_evidence + 2.0 * weights,
            epsilon = 1e-8,
            max_relative = 1e-8
        );
        let expected = sampler.moments(0, 1);
        sampler.change(&[(0, 1)]);
        let found = all(&[1, 0, 0]);
        let (mean, covariance) = (found.step.clone(), found.covariance());
        approx::assert_relative_eq!(expected[0][0], mean[0], max_relative = 1e-8);
        approx::assert_relative_eq!(expected[0][1], covariance[(0, 0)], max_relative = 1e-8);
        approx::assert_relative_eq!(sampler.mean, mean, max_relative = 1e-7, epsilon = 1e-10);
        approx::assert_relative_eq!(sampler.covariance, covariance, max_relative = 1e-7, epsilon = 1e-10);
    }
}
