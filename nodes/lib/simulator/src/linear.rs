//! Residuals with the start of every window eliminated, and least squares on them.
//!
//! ```text
//! minimise over theta, x_w:  sum_w n_w rho(|r_w|^2 / n_w),   rho(s) = 2 k^2 (sqrt(1 + s/k^2) - 1)
//! P_w = I - A_w (A_w' A_w)^-1 A_w',   A_w = d r_w / d x_w:   what no start of the window can explain
//! ```

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::model::Residuals;

/// Robustness: a window whose error per residual is above this counts by its size, not by its square.
const ROBUST_K: f64 = 3.0;
/// Most clusters of windows: enough for the rank of a covariance, few enough to outlast a corner.
const CLUSTERS: usize = 40;
/// Share of a cluster's error that a fit leaves in it, at least: one that holds all of a parameter's information tells no variance.
const LEAST_SHOWN: f64 = 0.01;

/// Where the residuals of each window lie, and whether it is only scored.
#[derive(Debug, Clone)]
pub(crate) struct Layout {
    pub(crate) windows: Vec<(usize, usize)>,
    pub(crate) held_out: Vec<bool>,
    pub(crate) block: Vec<usize>,
}

impl Layout {
    /// Windows that are fitted.
    pub(crate) fn training(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.windows.len()).filter(|&w| !self.held_out[w])
    }

    /// The cluster of each training window, in their order, and how many there are.
    pub(crate) fn clusters(&self) -> (Vec<usize>, usize) {
        let count = self.training().count();
        let each = count.div_ceil(CLUSTERS).max(1);
        ((0..count).map(|k| k / each).collect(), count.div_ceil(each))
    }
}

/// How the starts of the windows act.
#[derive(Debug, Clone)]
pub(crate) struct Starts {
    /// By window: d r / d x (n x F), and the inverse of its square.
    blocks: Vec<(DMatrix<f64>, DMatrix<f64>)>,
}

impl Starts {
    /// Of derivatives by each free state, every window's in one vector.
    pub(crate) fn new(layout: &Layout, columns: &[Residuals]) -> Self {
        let blocks = layout.windows.iter().map(|&(from, len)| {
            let a = DMatrix::from_fn(len, columns.len(), |i, f| columns[f][from + i]);
            let mut square = a.transpose() * &a;
            for f in 0..columns.len() {
                square[(f, f)] += 1e-12 + 1e-9 * square[(f, f)];
            }
            let inverse =
                square.try_inverse().unwrap_or_else(|| DMatrix::zeros(columns.len(), columns.len()));
            (a, inverse)
        });
        Self { blocks: blocks.collect() }
    }

    /// How far residuals move where every window's start moves by so much.
    pub(crate) fn moved_by(&self, layout: &Layout, shifts: &[DVector<f64>]) -> Residuals {
        let mut out = vec![0.0; layout.windows.iter().map(|(from, len)| from + len).max().unwrap_or(0)];
        for ((&(from, len), (a, _)), shift) in layout.windows.iter().zip(&self.blocks).zip(shifts) {
            if a.ncols() > 0 {
                out[from..from + len].copy_from_slice((a * shift).as_slice());
            }
        }
        out
    }

    /// What no start explains of a vector, and by how much each window's start must move to explain the rest.
    pub(crate) fn project(&self, layout: &Layout, v: &[f64]) -> (Residuals, Vec<DVector<f64>>) {
        let mut out = v.to_vec();
        let mut shifts = Vec::with_capacity(self.blocks.len());
        for (&(from, len), (a, inverse)) in layout.windows.iter().zip(&self.blocks) {
            if a.ncols() == 0 {
                shifts.push(DVector::zeros(0));
                continue;
            }
            let part = DVector::from_column_slice(&v[from..from + len]);
            let shift = -(inverse * (a.transpose() * &part));
            let left = part + a * &shift;
            out[from..from + len].copy_from_slice(left.as_slice());
            shifts.push(shift);
        }
        (out, shifts)
    }
}

/// Cost of every window.
pub(crate) fn window_costs(layout: &Layout, projected: &[f64]) -> Vec<f64> {
    layout
        .windows
        .iter()
        .map(|&(from, len)| {
            let square: f64 = projected[from..from + len].iter().map(|r| r * r).sum();
            if square.is_finite() { loss(square, len).0 } else { f64::INFINITY }
        })
        .collect()
}

/// Squares of every window: for stating errors.
pub(crate) fn window_squares(layout: &Layout, projected: &[f64]) -> Vec<f64> {
    layout
        .windows
        .iter()
        .map(|&(from, len)| projected[from..from + len].iter().map(|r| r * r).sum())
        .collect()
}

/// n rho(s/n), and the weight rho'(s/n).
fn loss(square: f64, n: usize) -> (f64, f64) {
    let root = (1.0 + square / n.max(1) as f64 / (ROBUST_K * ROBUST_K)).sqrt();
    (n as f64 * 2.0 * ROBUST_K * ROBUST_K * (root - 1.0), root.recip())
}

/// The least squares problem around a point.
#[derive(Debug)]
pub(crate) struct Normal {
    pub(crate) information: DMatrix<f64>,
    pub(crate) gradient: DVector<f64>,
    clusters: Vec<(DVector<f64>, DMatrix<f64>)>,
}

/// What is known of the parameters of a problem.
#[derive(Debug)]
pub(crate) struct Known {
    pub(crate) covariance: DMatrix<f64>,
    /// Degrees of freedom that the variance of each parameter was estimated with.
    pub(crate) freedom: Vec<f64>,
}

impl Normal {
    /// Of projected residuals and the projected derivatives of each parameter, on the training windows.
    pub(crate) fn new(layout: &Layout, projected: &[f64], columns: &[&Residuals]) -> Self {
        let p = columns.len();
        let (clusters, count) = layout.clusters();
        let mut by_cluster = vec![(DVector::zeros(p), DMatrix::zeros(p, p)); count];
        for (w, cluster) in layout.training().zip(clusters) {
            let (from, len) = layout.windows[w];
            let r = &projected[from..from + len];
            let square: f64 = r.iter().map(|v| v * v).sum();
            if !square.is_finite() {
                continue;
            }
            let weight = loss(square, len).1;
            for (a, column) in columns.iter().enumerate() {
                let ca = &column[from..from + len];
                let (gradient, information) = &mut by_cluster[cluster];
                gradient[a] += weight * dot(ca, r);
                for (b, other) in columns.iter().enumerate().take(a + 1) {
                    let sum = weight * dot(ca, &other[from..from + len]);
                    information[(a, b)] += sum;
                    if a != b {
                        information[(b, a)] += sum;
                    }
                }
            }
        }
        let gradient = by_cluster.iter().fold(DVector::zeros(p), |sum, (g, _)| sum + g);
        let information = by_cluster.iter().fold(DMatrix::zeros(p, p), |sum, (_, i)| sum + i);
        Self { information, gradient, clusters: by_cluster }
    }

    /// The step that lowers the cost most as far as the derivatives reach, damped by a share of each parameter's own information.
    pub(crate) fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let mut h = self.information.clone();
        for a in 0..h.nrows() {
            h[(a, a)] += damping * h[(a, a)] + 1e-12;
        }
        let step = -h.cholesky()?.solve(&self.gradient);
        step.iter().all(|v| v.is_finite()).then_some(step)
    }

    /// Lets some parameters of a step follow the others, as [`Self::step`] does all. Returns whether they can.
    pub(crate) fn follow(&self, step: &mut DVector<f64>, which: &[usize], damping: f64) -> bool {
        for &j in which {
            step[j] = 0.0;
        }
        let slope = &self.gradient + &self.information * &*step;
        let h = DMatrix::from_fn(which.len(), which.len(), |a, b| {
            let own = if a == b { damping * self.information[(which[a], which[a])] + 1e-12 } else { 0.0 };
            self.information[(which[a], which[b])] + own
        });
        let Some(h) = h.cholesky() else { return false };
        let followed = h.solve(&DVector::from_iterator(which.len(), which.iter().map(|&j| -slope[j])));
        which.iter().zip(followed.iter()).for_each(|(&j, s)| step[j] = *s);
        step.iter().all(|v| v.is_finite())
    }

    /// What a step gains as far as the derivatives reach.
    pub(crate) fn gain(&self, step: &DVector<f64>) -> f64 {
        -(2.0 * self.gradient.dot(step) + (step.transpose() * &self.information * step)[(0, 0)])
    }

    /// Covariance robust to errors that hold on over a cluster. A fit leaves less in the clusters that hold most of its information than noise
    /// does, and where these are few their scatter says little of a variance: both are corrected for (CR2 with Satterthwaite's degrees of
    /// freedom: Bell and McCaffrey 2002; Pustejovsky and Tipton 2018).
    pub(crate) fn known(&self) -> Option<Known> {
        let p = self.gradient.len();
        let inverse = self.information.clone().cholesky()?.inverse();
        let power = |m: DMatrix<f64>, of: &dyn Fn(f64) -> f64| {
            let e = m.symmetric_eigen();
            &e.eigenvectors * DMatrix::from_diagonal(&e.eigenvalues.map(of)) * e.eigenvectors.transpose()
        };
        let root = power(inverse.clone(), &|v| v.max(0.0).sqrt());
        // At an optimum the sum is nothing; what is left of it, where a bound or the tolerance stopped, is not spread.
        let mean = &self.gradient / self.clusters.len() as f64;
        let mut robust = DMatrix::zeros(p, p);
        for (gradient, information) in &self.clusters {
            let hidden = power(&root * information * &root, &|v| (1.0 - v).max(LEAST_SHOWN).sqrt().recip());
            let shown = &root * hidden * &root * (gradient - &mean);
            robust += &shown * shown.transpose();
        }
        // Neither can errors be less than the noise, which is known.
        let floor =
            DMatrix::from_diagonal(&DVector::from_fn(p, |a, _| (inverse[(a, a)] - robust[(a, a)]).max(0.0)));
        let freedom = (0..p).map(|a| {
            let of = |(_, information): &(_, DMatrix<f64>)| (&inverse * information * &inverse)[(a, a)];
            freedom(&self.clusters.iter().map(of).collect::<Vec<_>>())
        });
        Some(Known { freedom: freedom.collect(), covariance: robust + floor })
    }
}

/// Degrees of freedom of a variance to which clusters contribute so much: one less than there are, where all contribute alike.
fn freedom(shares: &[f64]) -> f64 {
    let whole: f64 = shares.iter().sum();
    let shares: Vec<f64> =
        shares.iter().map(|s| (s / whole.max(f64::MIN_POSITIVE)).min(1.0 - LEAST_SHOWN)).collect();
    let together: Vec<f64> = shares.iter().map(|m| m * m / (1.0 - m)).collect();
    let all: f64 = together.iter().sum();
    let squares: f64 = shares.iter().zip(&together).map(|(m, t)| m * m + t * (all - t)).sum();
    squares.max(f64::MIN_POSITIVE).recip().max(1.0)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// What Student's t with so many degrees of freedom exceeds with a chance (one side).
pub(crate) fn student(chance: f64, freedom: f64) -> f64 {
    StudentsT::new(0.0, 1.0, freedom.max(1.0)).map_or(f64::INFINITY, |t| t.inverse_cdf(1.0 - chance))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_take_what_they_explain_and_no_more() {
        let layout = Layout { windows: vec![(0, 4), (4, 4)], held_out: vec![false; 2], block: vec![0, 0] };
        let column = vec![1.0, 0.5, 0.25, 0.125, 2.0, 1.0, 0.5, 0.25];
        let starts = Starts::new(&layout, std::slice::from_ref(&column));
        let v: Vec<f64> = column.iter().enumerate().map(|(i, c)| if i < 4 { 3.0 * c } else { -c }).collect();
        let (left, shifts) = starts.project(&layout, &v);
        assert!(left.iter().all(|r| r.abs() < 1e-6));
        approx::assert_relative_eq!(shifts[0][0], -3.0, max_relative = 1e-6);
        let (again, _) = starts.project(&layout, &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(again[0].abs() < 1.0 && again[1] < 0.0 && again[5] == 0.0);
    }

    #[test]
    fn a_variance_that_few_clusters_tell_is_known_less_and_is_not_taken_for_less() {
        approx::assert_relative_eq!(freedom(&[1.0; 30]), 29.0, max_relative = 1e-6);
        let few: Vec<f64> = (0..30).map(|k| if k < 3 { 30.0 } else { 0.1 }).collect();
        assert!((2.0..4.0).contains(&freedom(&few)), "{}", freedom(&few));
        // Two windows hold nearly all of what tells a parameter, and their errors hold on: over draws, the variance is the scatter.
        use rand::SeedableRng as _;
        use rand_distr::{Distribution as _, Normal as Gauss};
        let gauss = Gauss::new(0.0, 1.0).unwrap();
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let windows: Vec<(usize, usize)> = (0..20).map(|w| (10 * w, 10)).collect();
        let layout = Layout { windows, held_out: vec![false; 20], block: (0..20).collect() };
        let column: Residuals = (0..200).map(|i| if i < 20 { 1.0 } else { 0.2 }).collect();
        let (mut scatter, mut stated, mut inside) = (0.0, 0.0, 0.0);
        let draws = 3000;
        for _ in 0..draws {
            let held: Vec<f64> = (0..20).map(|_| gauss.sample(&mut rng)).collect();
            let r: Residuals = (0..200).map(|i| held[i / 10] + gauss.sample(&mut rng)).collect();
            let first = Normal::new(&layout, &r, &[&column]);
            let size = first.step(0.0).unwrap()[0];
            let left: Residuals = r.iter().zip(&column).map(|(r, c)| r + size * c).collect();
            let known = Normal::new(&layout, &left, &[&column]).known().unwrap();
            let variance = known.covariance[(0, 0)];
            scatter += size * size / f64::from(draws);
            stated += variance / f64::from(draws);
            let is_inside = size.abs() < student(0.05, known.freedom[0]) * variance.sqrt();
            inside += f64::from(u8::from(is_inside)) / f64::from(draws);
        }
        assert!((0.85..1.25).contains(&(stated / scatter)), "{stated} {scatter}");
        assert!((0.85..0.97).contains(&inside), "{inside}");
    }

    #[test]
    fn students_t_is_as_tabled() {
        for (chance, freedom, t) in [
            (0.05, 5.0, 2.015),
            (0.05, 10.0, 1.812),
            (0.05, 30.0, 1.697),
            (0.0005, 20.0, 3.850),
            (0.0005, 30.0, 3.646),
        ] {
            approx::assert_relative_eq!(student(chance, freedom), t, max_relative = 0.01);
        }
    }
}
