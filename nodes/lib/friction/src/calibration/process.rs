//! A Gaussian process over appearances: friction as a smooth function of what a road looks like.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::error::FrictionError;

/// What is expected of a road of which nothing is known, and its variance.
const MEAN: f64 = 0.6;
const MEAN_VARIANCE: f64 = 0.09;
/// Variance of what the appearance tells.
const AMPLITUDE: f64 = 0.09;

/// The shape of the function.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kernel {
    /// Distance, root of the mean square over the scaled numbers, over which friction changes.
    pub length: f64,
    /// Variance of a part that is linear in the numbers.
    pub linear: f64,
    /// Standard deviation of a picture's friction around the function.
    pub noise: f64,
}

/// What two pictures have to do with each other, whatever the shape.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Pair {
    /// Mean of the squared differences.
    distance2: f64,
    /// Mean of the products.
    product: f64,
}

impl Pair {
    fn of(a: &[f64], b: &[f64]) -> Self {
        let (mut distance2, mut product) = (0.0, 0.0);
        for (a, b) in a.iter().zip(b) {
            distance2 += (a - b) * (a - b);
            product += a * b;
        }
        let count = a.len().max(1) as f64;
        Self { distance2: distance2 / count, product: product / count }
    }

    fn covariance(&self, kernel: &Kernel) -> f64 {
        MEAN_VARIANCE
            + AMPLITUDE * (-self.distance2 / (2.0 * kernel.length * kernel.length)).exp()
            + kernel.linear * self.product
    }
}

/// All examples with each other.
#[derive(Debug)]
pub(super) struct Pairs(DMatrix<Pair>);

impl Pairs {
    pub(super) fn of(inputs: &[Vec<f64>]) -> Self {
        let n = inputs.len();
        let mut pairs = DMatrix::from_element(n, n, Pair { distance2: 0.0, product: 0.0 });
        for i in 0..n {
            for j in 0..=i {
                let pair = Pair::of(&inputs[i], &inputs[j]);
                (pairs[(i, j)], pairs[(j, i)]) = (pair, pair);
            }
        }
        Self(pairs)
    }

    /// Mean of the squared differences of two of them.
    pub(super) fn distance2(&self, i: usize, j: usize) -> f64 {
        self.0[(i, j)].distance2
    }
}

/// The process given examples.
#[derive(Debug, Clone)]
pub(super) struct Process {
    kernel: Kernel,
    factor: Cholesky<f64, Dyn>,
    weights: DVector<f64>,
}

impl Process {
    /// `sigmas`: standard deviations of the labels.
    pub(super) fn new(
        kernel: Kernel,
        pairs: &Pairs,
        labels: &[f64],
        sigmas: &[f64],
    ) -> Result<Self, FrictionError> {
        let n = labels.len();
        let matrix = DMatrix::from_fn(n, n, |i, j| {
            let own = if i == j { kernel.noise * kernel.noise + sigmas[i] * sigmas[i] } else { 0.0 };
            pairs.0[(i, j)].covariance(&kernel) + own
        });
        let factor = Cholesky::new(matrix).ok_or_else(|| FrictionError::BadCalibration {
            message: "the examples' numbers are not finite, or their labels' spreads are zero".into(),
        })?;
        let weights = factor.solve(&DVector::from_iterator(n, labels.iter().map(|mu| mu - MEAN)));
        Ok(Self { kernel, factor, weights })
    }

    /// Mean and variance of a picture's friction, which has this to do with the examples and that with itself.
    fn read(&self, near: &[Pair], own: Pair) -> (f64, f64) {
        let near = DVector::from_iterator(near.len(), near.iter().map(|pair| pair.covariance(&self.kernel)));
        let explained = near.dot(&self.factor.solve(&near));
        let noise = self.kernel.noise * self.kernel.noise;
        let variance = (own.covariance(&self.kernel) - explained).max(0.0) + noise;
        (MEAN + near.dot(&self.weights), variance)
    }

    /// Error and variance of each example when its group is left out: by blocks of the inverse, without fitting anew.
    pub(super) fn left_out(&self, groups: &[Vec<usize>]) -> Vec<(f64, f64)> {
        let inverse = self.factor.inverse();
        let mut out = vec![(0.0, f64::INFINITY); self.weights.len()];
        for group in groups {
            let block = DMatrix::from_fn(group.len(), group.len(), |i, j| inverse[(group[i], group[j])]);
            let weights = DVector::from_iterator(group.len(), group.iter().map(|i| self.weights[*i]));
            let Some(block) = Cholesky::new(block) else { continue };
            let (errors, variances) = (block.solve(&weights), block.inverse());
            for (k, i) in group.iter().enumerate() {
                out[*i] = (errors[k], variances[(k, k)]);
            }
        }
        out
    }
}

/// Processes of several shapes that speak together, each by its share.
#[derive(Debug, Clone)]
pub(super) struct Mixture {
    inputs: Vec<Vec<f64>>,
    members: Vec<(f64, Process)>,
}

impl Mixture {
    /// `members`: their shares, which sum to one.
    pub(super) fn new(inputs: Vec<Vec<f64>>, members: Vec<(f64, Process)>) -> Self {
        Self { inputs, members }
    }

    /// Shares and shapes.
    pub(super) fn kernels(&self) -> impl Iterator<Item = (f64, Kernel)> {
        self.members.iter().map(|(share, process)| (*share, process.kernel))
    }

    /// Mean and variance of a picture's friction, and the distance from the nearest example.
    pub(super) fn read(&self, x: &[f64]) -> (f64, f64, f64) {
        let near: Vec<Pair> = self.inputs.iter().map(|i| Pair::of(x, i)).collect();
        let own = Pair::of(x, x);
        let (mean, variance) =
            moments(self.members.iter().map(|(share, process)| (*share, process.read(&near, own))));
        let nearest = near.iter().map(|pair| pair.distance2).fold(f64::INFINITY, f64::min);
        (mean, variance, nearest.sqrt())
    }

    /// As [`Process::left_out`].
    pub(super) fn left_out(&self, groups: &[Vec<usize>]) -> Vec<(f64, f64)> {
        let each: Vec<(f64, Vec<(f64, f64)>)> =
            self.members.iter().map(|(share, process)| (*share, process.left_out(groups))).collect();
        let count = each.first().map_or(0, |(_, left_out)| left_out.len());
        (0..count).map(|i| moments(each.iter().map(|(share, left_out)| (*share, left_out[i])))).collect()
    }
}

/// Mean and variance of a mixture of means and variances.
fn moments(members: impl Iterator<Item = (f64, (f64, f64))>) -> (f64, f64) {
    let (mut first, mut second) = (0.0, 0.0);
    for (share, (mean, variance)) in members {
        first += share * mean;
        second += share * (variance + mean * mean);
    }
    (first, second - first * first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    const KERNEL: Kernel = Kernel { length: 0.8, linear: 0.05, noise: 0.05 };

    fn process(inputs: &[Vec<f64>], labels: &[f64], sigmas: &[f64]) -> Mixture {
        let process = Process::new(KERNEL, &Pairs::of(inputs), labels, sigmas).unwrap();
        Mixture::new(inputs.to_vec(), vec![(1.0, process)])
    }

    fn line() -> (Vec<Vec<f64>>, Vec<f64>) {
        let inputs: Vec<Vec<f64>> = (0..12).map(|k| vec![f64::from(k) / 4.0, 0.0]).collect();
        let labels = inputs.iter().map(|x| 0.3 + 0.2 * x[0]).collect();
        (inputs, labels)
    }

    #[test]
    fn leaving_out_by_blocks_is_fitting_without_them() {
        let (inputs, labels) = line();
        let sigmas = vec![0.02; 12];
        let whole = process(&inputs, &labels, &sigmas);
        let groups: Vec<Vec<usize>> = (0..4).map(|g| (3 * g..3 * g + 3).collect()).collect();
        let got = whole.left_out(&groups);
        let rest = |v: &[f64]| [&v[..3], &v[6..]].concat();
        let without = [&inputs[..3], &inputs[6..]].concat();
        let smaller = process(&without, &rest(&labels), &rest(&sigmas));
        for i in 3..6 {
            let (mu, variance, _) = smaller.read(&inputs[i]);
            assert_relative_eq!(got[i].0, labels[i] - mu, epsilon = 1e-9);
            assert_relative_eq!(got[i].1, variance + 0.02 * 0.02, epsilon = 1e-9);
        }
    }

    #[test]
    fn a_mixture_doubts_where_its_members_disagree() {
        let (mean, variance) = moments([(0.5, (0.4, 0.01)), (0.5, (0.8, 0.01))].into_iter());
        assert_relative_eq!(mean, 0.6, epsilon = 1e-12);
        assert_relative_eq!(variance, 0.05, epsilon = 1e-12);
    }

    #[test]
    fn it_follows_its_examples_and_knows_nothing_far_away() {
        let (inputs, labels) = line();
        let process = process(&inputs, &labels, &[0.02; 12]);
        let (near, far) = (process.read(&[1.1, 0.0]), process.read(&[1.1, 40.0]));
        assert_relative_eq!(near.0, 0.52, epsilon = 0.03);
        assert!(near.1.sqrt() < 0.08 && far.1.sqrt() > 0.25, "{near:?} {far:?}");
    }
}
