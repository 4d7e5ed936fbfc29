//! Levenberg-Marquardt within bounds.

use gripsight_model::Rollout;
use nalgebra::{DMatrix, DVector};

use super::{Linearization, Parameter, Problem, cost, linearize};

/// Why a fit ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StopReason {
    /// The last step changed the cost by less than the tolerance.
    Converged,
    /// No step lowers the cost any more.
    NoDescent,
    /// The iterations were used up.
    MaxIterations,
    /// The start itself gives no finite cost.
    NotFinite,
}

/// Result of a fit.
#[derive(Debug, Clone)]
pub struct Fit {
    /// All parameters of the model.
    pub parameters: Vec<f64>,
    /// Start state of every window.
    pub starts: Vec<[f64; 2]>,
    /// The problem around the solution.
    pub linearization: Linearization,
    /// Free parameters that ended on a bound.
    pub on_bound: Vec<usize>,
    /// Why it ended.
    pub stop: StopReason,
    /// Steps taken.
    pub iterations: usize,
    /// The free parameters of the model: rows of the linearization.
    pub free: Vec<usize>,
}

impl Fit {
    /// Covariance of the free parameters, in their order, robust to errors that are correlated within a window and, in long drives,
    /// over neighbouring windows, as banking and a drifting v_y make them: a sandwich H^-1 (sum_c g_c g_c^T) H^-1 with at most 40 clusters. Parameters on a bound count as known. `None` where the information is singular.
    #[must_use]
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        let p = self.free.len();
        let pinned: Vec<bool> = self.free.iter().map(|j| self.on_bound.contains(j)).collect();
        let mut information = self.linearization.information.clone();
        pin(&mut information, None, &pinned);
        let inverse = information.cholesky()?.inverse();
        let mut meat = DMatrix::zeros(p, p);
        let gradients = &self.linearization.window_gradients;
        let clusters = gradients.chunks(gradients.len().div_ceil(CLUSTERS).max(1));
        let count = clusters.len() as f64;
        for cluster in clusters {
            let mut g = cluster.iter().fold(DVector::zeros(p), |sum, g| sum + g);
            (0..p).filter(|&a| pinned[a]).for_each(|a| g[a] = 0.0);
            meat += &g * g.transpose();
        }
        let small_sample = count / (count - p as f64).max(1.0);
        Some(&inverse * meat * inverse * small_sample)
    }

    /// Covariance of some parameters of the model; those that were not free count as known. `None` where the information is singular.
    #[must_use]
    pub fn covariance_of(&self, parameters: &[usize]) -> Option<DMatrix<f64>> {
        let all = self.covariance()?;
        let place = |j: usize| self.free.iter().position(|&f| f == j);
        Some(DMatrix::from_fn(parameters.len(), parameters.len(), |a, b| {
            match (place(parameters[a]), place(parameters[b])) {
                (Some(a), Some(b)) => all[(a, b)],
                _ => 0.0,
            }
        }))
    }

    /// Covariance of some parameters of the model where noise, errors of the model and priors are as large as the problem says: the inverse of
    /// the information. Parameters that were not free, or ended on a bound, count as known. `None` where the information is singular.
    #[must_use]
    pub fn posterior_of(&self, parameters: &[usize]) -> Option<DMatrix<f64>> {
        let mut information = self.linearization.information.clone();
        let pinned: Vec<bool> = self.free.iter().map(|j| self.on_bound.contains(j)).collect();
        pin(&mut information, None, &pinned);
        let inverse = information.cholesky()?.inverse();
        let place = |j: usize| self.free.iter().position(|&f| f == j).filter(|&p| !pinned[p]);
        Some(DMatrix::from_fn(parameters.len(), parameters.len(), |a, b| {
            match (place(parameters[a]), place(parameters[b])) {
                (Some(a), Some(b)) => inverse[(a, b)],
                _ => 0.0,
            }
        }))
    }

    /// Standard error of parameter `j` of the model; `None` if it was not free or nothing is known of it.
    #[must_use]
    pub fn standard_error(&self, j: usize) -> Option<f64> {
        let place = self.free.iter().position(|&f| f == j)?;
        self.covariance().map(|c| c[(place, place)].max(0.0).sqrt())
    }
}

/// Most clusters of the covariance: enough for its rank, few enough that a long drive's clusters outlast a corner.
const CLUSTERS: usize = 40;

/// Fits the free parameters of a problem, from its start values and the given start states (else the model's guesses).
#[must_use]
pub fn fit<M: Rollout>(problem: &Problem<'_, M>, starts: Option<Vec<[f64; 2]>>) -> Fit {
    let free = problem.free();
    let mut parameters: Vec<f64> = problem.parameters.iter().map(|p| p.start.clamp(p.low, p.high)).collect();
    let mut starts =
        starts.unwrap_or_else(|| problem.windows.iter().map(|w| problem.model.start_guess(w)).collect());
    let mut here = linearize(problem, &parameters, &starts);
    let mut damping = Damping(1e-3);
    let mut iterations = 0;
    let mut stop = StopReason::MaxIterations;
    if !here.cost.is_finite() {
        stop = StopReason::NotFinite;
    }
    while stop == StopReason::MaxIterations && iterations < problem.max_iterations {
        iterations += 1;
        match step(problem, &free, &parameters, &starts, &here, &mut damping) {
            Some((trial, trial_starts, there)) => {
                if here.cost - there.cost < problem.tolerance * here.cost {
                    stop = StopReason::Converged;
                }
                (parameters, starts, here) = (trial, trial_starts, there);
            }
            None => stop = StopReason::NoDescent,
        }
    }
    let on_bound = free
        .iter()
        .copied()
        .filter(|&j| {
            let p = &problem.parameters[j];
            let margin = 1e-6 * (p.high - p.low);
            parameters[j] <= p.low + margin || parameters[j] >= p.high - margin
        })
        .collect();
    Fit { parameters, starts, linearization: here, on_bound, stop, iterations, free }
}

/// How far a step stays behind that of Gauss and Newton: what is added to the information's diagonal, as a share of it.
struct Damping(f64);

impl Damping {
    const LEAST: f64 = 1e-9;
    /// By how much a step that fails raises it, and one that succeeds lowers it at most.
    const STRIDE: f64 = 5.0;

    /// Follows how well the linearized problem foretold the cost (Nielsen, Damping parameter in Marquardt's method, 1999): lowered by its stride after
    /// every success, every other step would fail. `ratio`: by how much the cost fell over by how much it was foretold to.
    fn succeeded(&mut self, ratio: f64) {
        self.0 = (self.0 * (1.0 - (2.0 * ratio - 1.0).powi(3)).max(1.0 / Self::STRIDE)).max(Self::LEAST);
    }

    fn failed(&mut self) {
        self.0 *= Self::STRIDE;
    }
}

/// Finds a step that lowers the cost, raising the damping until one does.
fn step<M: Rollout>(
    problem: &Problem<'_, M>,
    free: &[usize],
    parameters: &[f64],
    starts: &[[f64; 2]],
    here: &Linearization,
    damping: &mut Damping,
) -> Option<(Vec<f64>, Vec<[f64; 2]>, Linearization)> {
    let room = |bound: fn(&Parameter) -> f64| {
        DVector::from_iterator(
            free.len(),
            free.iter().map(|&j| bound(&problem.parameters[j]) - parameters[j]),
        )
    };
    let (low, high) = (room(|p| p.low), room(|p| p.high));
    // Damping changes no step of the start states alone.
    let attempts = if free.is_empty() { 1 } else { 12 };
    for attempt in 0..attempts {
        let mut information = here.information.clone();
        for a in 0..free.len() {
            information[(a, a)] += damping.0 * information[(a, a)].max(1e-12);
        }
        if let Some(step) = within(&information, &here.gradient, &low, &high) {
            let mut trial = parameters.to_vec();
            for (row, &j) in free.iter().enumerate() {
                let p = &problem.parameters[j];
                trial[j] = (trial[j] + step[row]).clamp(p.low, p.high);
            }
            let taken = DVector::from_iterator(free.len(), free.iter().map(|&j| trial[j] - parameters[j]));
            let trial_starts = here.starts_after(&taken, starts);
            // Most steps succeed, and then the derivatives there are wanted; after one that did not, the cost alone is asked for first.
            if attempt > 0 && cost(problem, &trial, &trial_starts) >= here.cost {
                damping.failed();
                continue;
            }
            let there = linearize(problem, &trial, &trial_starts);
            if there.cost < here.cost {
                damping.succeeded((here.cost - there.cost) / here.foretold(&taken));
                return Some((trial, trial_starts, there));
            }
        }
        damping.failed();
    }
    None
}

/// The step within bounds that lowers s^T H s/2 + g^T s most, for a gradient g and information H: what would leave is held at its bound, and the others go where that leaves them (an active
/// set: Nocedal and Wright, Numerical Optimization, 16.5). Cut off there instead, they go on as if it had moved. `None` where H is not positive definite.
#[must_use]
pub fn within(
    information: &DMatrix<f64>,
    gradient: &DVector<f64>,
    low: &DVector<f64>,
    high: &DVector<f64>,
) -> Option<DVector<f64>> {
    let n = gradient.len();
    let mut held = vec![None; n];
    let mut step = DVector::zeros(n);
    for _ in 0..2 * n + 2 {
        let pinned: Vec<bool> = held.iter().map(Option::is_some).collect();
        let at: DVector<f64> = DVector::from_iterator(n, held.iter().map(|h| h.unwrap_or(0.0)));
        let mut matrix = information.clone();
        let mut side = -gradient - information * &at;
        pin(&mut matrix, Some(&mut side), &pinned);
        step = at + matrix.cholesky()?.solve(&side);
        let outside = |a: usize| match step[a] {
            s if s < low[a] => Some(low[a]),
            s if s > high[a] => Some(high[a]),
            _ => None,
        };
        let leaving: Vec<usize> = (0..n).filter(|&a| held[a].is_none() && outside(a).is_some()).collect();
        if !leaving.is_empty() {
            leaving.into_iter().for_each(|a| held[a] = outside(a));
            continue;
        }
        let slope = information * &step + gradient;
        let inwards =
            |a: usize| held[a].is_some_and(|at| if at <= low[a] { slope[a] < 0.0 } else { slope[a] > 0.0 });
        let Some(back) =
            (0..n).filter(|&a| inwards(a)).max_by(|&a, &b| slope[a].abs().total_cmp(&slope[b].abs()))
        else {
            break;
        };
        held[back] = None;
    }
    Some(step)
}

/// Takes rows and columns out of a system without changing its size.
fn pin(information: &mut DMatrix<f64>, gradient: Option<&mut DVector<f64>>, pinned: &[bool]) {
    for a in (0..pinned.len()).filter(|&a| pinned[a]) {
        information.row_mut(a).fill(0.0);
        information.column_mut(a).fill(0.0);
        information[(a, a)] = 1.0;
    }
    if let Some(gradient) = gradient {
        for a in (0..pinned.len()).filter(|&a| pinned[a]) {
            gradient[a] = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn damping_falls_only_after_what_was_foretold() {
        let after = |ratio: f64| {
            let mut damping = Damping(1.0);
            damping.succeeded(ratio);
            damping.0
        };
        approx::assert_relative_eq!(after(1.0), 0.2);
        approx::assert_relative_eq!(after(0.5), 1.0);
        assert!(after(0.1) > 1.0);
        // Where nothing was foretold, as of no parameters.
        approx::assert_relative_eq!(after(f64::NAN), 0.2);
    }

    proptest! {
        #[test]
        fn no_step_within_the_bounds_leads_lower(
            root in proptest::collection::vec(-1.0..1.0, 16),
            gradient in proptest::collection::vec(-3.0..3.0, 4),
            low in proptest::collection::vec(-1.0..0.0, 4),
            high in proptest::collection::vec(0.0..1.0, 4),
            other in proptest::collection::vec(0.0..1.0, 4),
        ) {
            let root = DMatrix::from_vec(4, 4, root);
            let information = &root * root.transpose() + DMatrix::identity(4, 4) * 0.01;
            let [gradient, low, high] = [gradient, low, high].map(DVector::from_vec);
            let cost = |s: &DVector<f64>| 0.5 * s.dot(&(&information * s)) + s.dot(&gradient);
            let best = within(&information, &gradient, &low, &high).unwrap();
            for a in 0..4 {
                prop_assert!(low[a] - 1e-9 <= best[a] && best[a] <= high[a] + 1e-9, "{best} leaves the bounds");
            }
            let there = DVector::from_fn(4, |a, _| low[a] + other[a] * (high[a] - low[a]));
            for share in [1.0, 0.1, 0.01] {
                let step = &best + (&there - &best) * share;
                prop_assert!(cost(&step) >= cost(&best) - 1e-9, "{step} is lower than {best}");
            }
        }
    }
}
