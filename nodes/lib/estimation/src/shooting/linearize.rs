//! One look at every window: cost, gradient, and the information matrix with the start states eliminated.

use gripsight_model::{Rollout, Window};
use gripsight_vehicle::{Dual, Real};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix2xX, Vector2};
use rayon::prelude::*;

use super::Problem;

/// The problem around a point: J^T J of the free parameters with the start states eliminated, and what goes with it.
#[derive(Debug, Clone)]
pub struct Linearization {
    /// The objective.
    pub cost: f64,
    /// Information matrix of the free parameters (P x P).
    pub information: DMatrix<f64>,
    /// Half the gradient of the objective by the free parameters (P).
    pub gradient: DVector<f64>,
    /// The share of every window in the gradient: what cluster-robust intervals and scores are made of.
    pub window_gradients: Vec<DVector<f64>>,
    /// The share of every window in the information matrix.
    pub window_information: Vec<DMatrix<f64>>,
    /// The share of every window in the cost.
    pub window_costs: Vec<f64>,
    /// Residuals that count.
    pub residuals: usize,
    /// By how much the best start states alone lower the cost of the linearized problem.
    by_starts: f64,
    eliminations: Vec<Elimination>,
}

impl Linearization {
    /// By how much a step of the free parameters, and the best start states for it, lower the cost of the linearized problem.
    #[must_use]
    pub fn foretold(&self, step: &DVector<f64>) -> f64 {
        self.by_starts - step.dot(&(&self.information * step + &self.gradient * 2.0))
    }

    /// The best start states after a step of the free parameters.
    #[must_use]
    pub fn starts_after(&self, step: &DVector<f64>, starts: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let moved = |(x, e): (&[f64; 2], &Elimination)| {
            let dx = e.offset + &e.slope * step;
            [x[0] - dx[0], x[1] - dx[1]]
        };
        starts.iter().zip(&self.eliminations).map(moved).collect()
    }
}

/// How the start of a window follows a step of the parameters: dx = -(offset + slope dtheta).
#[derive(Debug, Clone)]
struct Elimination {
    offset: Vector2<f64>,
    slope: Matrix2xX<f64>,
    /// By how much the best start alone lowers the cost.
    gain: f64,
}

struct WindowPart {
    cost: f64,
    residuals: usize,
    information: DMatrix<f64>,
    gradient: DVector<f64>,
    elimination: Elimination,
}

/// Linearizes the problem at given parameters (all of the model's) and start states (one a window). Deterministic: windows are summed in order,
/// however many threads work on them.
///
/// A window whose rollout is not finite gives an infinite cost.
#[must_use]
pub fn linearize<M: Rollout>(
    problem: &Problem<'_, M>,
    parameters: &[f64],
    starts: &[[f64; 2]],
) -> Linearization {
    let free = problem.free();
    let parts: Vec<WindowPart> = problem
        .windows
        .par_iter()
        .zip(starts)
        .map(|(window, start)| {
            // The number of derivatives is fixed at compile time; take the smallest that holds them all.
            match free.len() + 2 {
                0..=4 => part::<M, 4>(problem, &free, parameters, *start, window),
                5..=8 => part::<M, 8>(problem, &free, parameters, *start, window),
                9..=12 => part::<M, 12>(problem, &free, parameters, *start, window),
                13..=16 => part::<M, 16>(problem, &free, parameters, *start, window),
                17..=20 => part::<M, 20>(problem, &free, parameters, *start, window),
                21..=24 => part::<M, 24>(problem, &free, parameters, *start, window),
                25..=28 => part::<M, 28>(problem, &free, parameters, *start, window),
                29..=32 => part::<M, 32>(problem, &free, parameters, *start, window),
                33..=40 => part::<M, 40>(problem, &free, parameters, *start, window),
                _ => in_passes::<M, 40>(problem, &free, parameters, *start, window),
            }
        })
        .collect();
    let p = free.len();
    let mut sum = Linearization {
        cost: 0.0,
        information: DMatrix::zeros(p, p),
        gradient: DVector::zeros(p),
        window_gradients: Vec::with_capacity(parts.len()),
        window_information: Vec::with_capacity(parts.len()),
        window_costs: Vec::with_capacity(parts.len()),
        residuals: 0,
        by_starts: 0.0,
        eliminations: Vec::with_capacity(parts.len()),
    };
    for part in parts {
        sum.cost += part.cost;
        sum.residuals += part.residuals;
        sum.information += &part.information;
        sum.gradient += &part.gradient;
        sum.window_gradients.push(part.gradient);
        sum.window_information.push(part.information);
        sum.window_costs.push(part.cost);
        sum.by_starts += part.elimination.gain;
        sum.eliminations.push(part.elimination);
    }
    for (row, &j) in free.iter().enumerate() {
        if let Some(prior) = problem.parameters[j].prior {
            let r = (parameters[j] - prior.mean) / prior.sigma;
            sum.cost += r * r;
            sum.information[(row, row)] += prior.sigma.powi(-2);
            sum.gradient[row] += r / prior.sigma;
        }
    }
    sum
}

/// The objective at given parameters (all of the model's) and start states (one a window), without derivatives.
#[must_use]
pub fn cost<M: Rollout>(problem: &Problem<'_, M>, parameters: &[f64], starts: &[[f64; 2]]) -> f64 {
    let windows: Vec<f64> = problem
        .windows
        .par_iter()
        .zip(starts)
        .map_init(
            || (Vec::new(), Vec::new()),
            |(predicted, measured), (window, start)| {
                problem.model.rollout(parameters, *start, window, predicted);
                problem.model.measured(window, measured);
                let scaled = residuals(problem, measured, predicted);
                let (square, n) = scaled.fold((0.0, 0), |(s, n), (_, r)| (s + r * r, n + 1));
                loss(square, n, problem.robust_k).0
            },
        )
        .collect();
    let priors = problem.parameters.iter().zip(parameters).filter_map(|(p, v)| {
        p.prior.filter(|_| p.free).map(|prior| ((v - prior.mean) / prior.sigma).powi(2))
    });
    windows.iter().sum::<f64>() + priors.sum::<f64>()
}

/// The residuals that are measured, with their place.
fn residuals<'a, M, T: Real>(
    problem: &'a Problem<'_, M>,
    measured: &'a [f64],
    predicted: &'a [T],
) -> impl Iterator<Item = (usize, f64)> + 'a {
    let channels = problem.sigma.len();
    measured
        .iter()
        .zip(predicted)
        .enumerate()
        .filter(|(_, (m, _))| !m.is_nan())
        .map(move |(i, (m, y))| (i, (m - y.re()) / problem.sigma[i % channels]))
}

/// n rho(s/n) of a window's sum of squares s, and the weight that its residuals get: rho'(s/n).
fn loss(square: f64, n: usize, k: f64) -> (f64, f64) {
    if !square.is_finite() {
        return (f64::INFINITY, 0.0);
    }
    if k.is_infinite() || n == 0 {
        return (square, 1.0);
    }
    let root = (1.0 + square / n as f64 / (k * k)).sqrt();
    (n as f64 * 2.0 * k * k * (root - 1.0), 1.0 / root)
}

fn part<M: Rollout, const N: usize>(
    problem: &Problem<'_, M>,
    free: &[usize],
    parameters: &[f64],
    start: [f64; 2],
    window: &Window,
) -> WindowPart {
    let p = free.len();
    let mut theta: Vec<Dual<N>> = parameters.iter().map(|&v| Dual::from(v)).collect();
    for (lane, &j) in free.iter().enumerate() {
        theta[j] = Dual::variable(parameters[j], lane);
    }
    let start = [Dual::variable(start[0], p), Dual::variable(start[1], p + 1)];
    let (mut predicted, mut measured) = (Vec::new(), Vec::new());
    problem.model.rollout(&theta, start, window, &mut predicted);
    problem.model.measured(window, &mut measured);

    let mut square = 0.0;
    let mut n = 0;
    // J^T J and J^T r over all lanes, the two start states last; J = d(residual) = -d(predicted)/sigma.
    let mut lower = [[0.0; N]; N];
    let mut product = [0.0; N];
    let channels = problem.sigma.len();
    for (i, r) in residuals(problem, &measured, &predicted) {
        square += r * r;
        n += 1;
        let scale = -1.0 / problem.sigma[i % channels];
        let jacobian = predicted[i].derivatives().map(|d| d * scale);
        for (a, &ja) in jacobian.iter().enumerate().take(p + 2).filter(|(_, ja)| **ja != 0.0) {
            product[a] += ja * r;
            // Four at a time: a few beyond the diagonal cost less than a rest would.
            for (sum, jb) in lower[a].iter_mut().zip(&jacobian[..(a / 4 * 4 + 4).min(N)]) {
                *sum += ja * jb;
            }
        }
    }
    let (cost, weight) = loss(square, n, problem.robust_k);
    let jtj = DMatrix::from_fn(p + 2, p + 2, |a, b| weight * lower[a.max(b)][a.min(b)]);
    let jtr = DVector::from_fn(p + 2, |a, _| weight * product[a]);
    eliminated(cost, n, &jtj, &jtr)
}

/// The same for more parameters than one rollout has derivatives of: a rollout for each N - 2 of them.
fn in_passes<M: Rollout, const N: usize>(
    problem: &Problem<'_, M>,
    free: &[usize],
    parameters: &[f64],
    start: [f64; 2],
    window: &Window,
) -> WindowPart {
    let (p, lanes) = (free.len(), N - 2);
    let start = [Dual::<N>::variable(start[0], lanes), Dual::variable(start[1], lanes + 1)];
    let (mut predicted, mut measured) = (Vec::new(), Vec::new());
    problem.model.measured(window, &mut measured);
    let channels = problem.sigma.len();
    let mut rows: Vec<f64> = Vec::new();
    let mut jacobian = DMatrix::zeros(0, p + 2);
    for (pass, chunk) in free.chunks(lanes).enumerate() {
        let mut theta: Vec<Dual<N>> = parameters.iter().map(|&v| Dual::from(v)).collect();
        for (lane, &j) in chunk.iter().enumerate() {
            theta[j] = Dual::variable(parameters[j], lane);
        }
        problem.model.rollout(&theta, start, window, &mut predicted);
        let kept: Vec<(usize, f64)> = residuals(problem, &measured, &predicted).collect();
        if pass == 0 {
            rows = kept.iter().map(|(_, r)| *r).collect();
            jacobian = DMatrix::zeros(kept.len(), p + 2);
        }
        for (row, (i, _)) in kept.iter().enumerate() {
            let scale = -1.0 / problem.sigma[i % channels];
            let derivatives = predicted[*i].derivatives();
            for lane in 0..chunk.len() {
                jacobian[(row, pass * lanes + lane)] = scale * derivatives[lane];
            }
            for s in 0..2 {
                jacobian[(row, p + s)] = scale * derivatives[lanes + s];
            }
        }
    }
    let residual = DVector::from_vec(rows);
    let (cost, weight) = loss(residual.norm_squared(), residual.len(), problem.robust_k);
    eliminated(
        cost,
        residual.len(),
        &(jacobian.tr_mul(&jacobian) * weight),
        &(jacobian.tr_mul(&residual) * weight),
    )
}

/// A window of `n` residuals with its start state, the last two of J^T J and J^T r, taken out.
fn eliminated(cost: f64, n: usize, jtj: &DMatrix<f64>, jtr: &DVector<f64>) -> WindowPart {
    let p = jtr.len() - 2;
    let start_block = Matrix2::new(jtj[(p, p)], jtj[(p, p + 1)], jtj[(p + 1, p)], jtj[(p + 1, p + 1)]);
    // A start that the outputs do not show stays where it is.
    let inverse = (start_block + Matrix2::identity() * 1e-12).try_inverse().unwrap_or_else(Matrix2::zeros);
    let cross = jtj.view((p, 0), (2, p)).into_owned();
    let toward = Vector2::new(jtr[p], jtr[p + 1]);
    let offset = inverse * toward;
    let slope =
        Matrix2xX::from_fn(p, |r, c| inverse[(r, 0)] * cross[(0, c)] + inverse[(r, 1)] * cross[(1, c)]);
    let information = jtj.view((0, 0), (p, p)) - cross.transpose() * &slope;
    let gradient = jtr.rows(0, p) - cross.transpose() * offset;
    WindowPart {
        cost,
        residuals: n,
        information,
        gradient,
        elimination: Elimination { offset, slope, gain: offset.dot(&toward) },
    }
}

#[cfg(test)]
pub(super) fn by_lanes_and_in_passes<M: Rollout>(
    problem: &Problem<'_, M>,
    parameters: &[f64],
    start: [f64; 2],
) -> [(f64, DMatrix<f64>, DVector<f64>); 2] {
    let free = problem.free();
    let window = &problem.windows[0];
    let told = |part: WindowPart| (part.cost, part.information, part.gradient);
    [
        told(part::<M, 4>(problem, &free, parameters, start, window)),
        told(in_passes::<M, 3>(problem, &free, parameters, start, window)),
    ]
}
