//! Nelder-Mead within bounds.
//!
//! The simplex of Nelder and Mead (1965) with the dimension-dependent coefficients of Gao and Han (2012), every trial clipped into the
//! bounds, and restarts: a simplex that has collapsed is built anew around its best vertex until that gains nothing. The moves, their order
//! and the initial simplex are those of SciPy's `minimize(method="Nelder-Mead", bounds=..., options={"adaptive": True})`, which the tests
//! take their golden values from.
//!
//! A cost that is NaN counts as infinite: the simplex walks away from it.

use crate::IdentificationError;

/// Settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NelderMeadConfig {
    /// Converged when no vertex is further than this from the best in any coordinate, and
    pub tolerance_x: f64,
    /// no cost differs by more than this from the best.
    pub tolerance_cost: f64,
    /// Evaluations at most, over all restarts.
    pub max_evaluations: usize,
    /// Restarts at most; one that improves the cost by no more than the tolerance is the last.
    pub restarts: usize,
}

impl Default for NelderMeadConfig {
    fn default() -> Self {
        Self { tolerance_x: 1e-4, tolerance_cost: 1e-8, max_evaluations: 2000, restarts: 2 }
    }
}

/// Why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NelderMeadStop {
    /// The simplex is as small and as flat as asked for.
    Converged,
    /// The evaluations were used up.
    MaxEvaluations,
    /// No vertex has a finite cost.
    NotFinite,
}

/// Result of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Minimum {
    /// Best point.
    pub x: Vec<f64>,
    /// Its cost; never above the cost of the (clipped) start.
    pub cost: f64,
    /// Evaluations used.
    pub evaluations: usize,
    /// Why it ended.
    pub stop: NelderMeadStop,
}

/// Minimises `cost` from `start` within `bounds` (low, high of every coordinate).
///
/// # Errors
/// [`IdentificationError::Setting`] for an empty start, a bound that is missing, NaN or reversed, or a start that is not finite.
pub fn minimize(
    mut cost: impl FnMut(&[f64]) -> f64,
    start: &[f64],
    bounds: &[(f64, f64)],
    config: &NelderMeadConfig,
) -> Result<Minimum, IdentificationError> {
    check(start, bounds)?;
    let mut evaluations = 0;
    let mut evaluate = |x: &[f64]| {
        evaluations += 1;
        let value = cost(x);
        if value.is_nan() { f64::INFINITY } else { value }
    };
    let mut left = config.max_evaluations;
    let (mut best, mut stop) = search(&mut evaluate, start, bounds, config, &mut left);
    for _ in 0..config.restarts {
        if stop != NelderMeadStop::Converged {
            break;
        }
        let (again, ended) = search(&mut evaluate, &best.x, bounds, config, &mut left);
        let gain = best.cost - again.cost;
        if gain > 0.0 {
            best = again;
        }
        if gain <= config.tolerance_cost {
            break;
        }
        stop = ended;
    }
    Ok(Minimum { x: best.x, cost: best.cost, evaluations, stop })
}

fn check(start: &[f64], bounds: &[(f64, f64)]) -> Result<(), IdentificationError> {
    let setting = |name, got, must| Err(IdentificationError::Setting { name, got, must });
    if start.is_empty() || start.len() != bounds.len() {
        return setting(
            "number of Nelder-Mead bounds",
            bounds.len() as f64,
            "that of the start's coordinates",
        );
    }
    if let Some(&(low, _)) =
        bounds.iter().find(|(low, high)| !matches!(low.partial_cmp(high), Some(o) if o.is_le()))
    {
        return setting("lower Nelder-Mead bound", low, "a number not above the upper one");
    }
    match start.iter().find(|v| !v.is_finite()) {
        Some(&got) => setting("Nelder-Mead start", got, "finite"),
        None => Ok(()),
    }
}

#[derive(Debug, Clone)]
struct Vertex {
    x: Vec<f64>,
    cost: f64,
}

fn search(
    evaluate: &mut impl FnMut(&[f64]) -> f64,
    start: &[f64],
    bounds: &[(f64, f64)],
    config: &NelderMeadConfig,
    left: &mut usize,
) -> (Vertex, NelderMeadStop) {
    let n = start.len();
    let dimension = n as f64;
    let (reflection, expansion) = (1.0, 1.0 + 2.0 / dimension);
    let (contraction, shrinkage) = (0.75 - 0.5 / dimension, 1.0 - 1.0 / dimension);
    let mut vertex = |x: Vec<f64>| {
        *left = left.saturating_sub(1);
        let cost = evaluate(&x);
        (Vertex { x, cost }, *left == 0)
    };
    let mut simplex = Vec::with_capacity(n + 1);
    let mut spent = false;
    for x in initial_simplex(start, bounds) {
        let (v, out) = vertex(x);
        simplex.push(v);
        spent |= out;
    }
    simplex.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    while !spent && !converged(&simplex, config) {
        let centroid: Vec<f64> =
            (0..n).map(|j| simplex[..n].iter().map(|v| v.x[j]).sum::<f64>() / dimension).collect();
        // The point at `centroid + t (centroid - worst)`.
        let along = |t: f64, worst: &[f64]| -> Vec<f64> {
            (0..n).map(|j| ((1.0 + t) * centroid[j] - t * worst[j]).clamp(bounds[j].0, bounds[j].1)).collect()
        };
        let worst = simplex[n].clone();
        let (reflected, out) = vertex(along(reflection, &worst.x));
        spent = out;
        let replacement = if reflected.cost < simplex[0].cost {
            let (expanded, out) = vertex(along(reflection * expansion, &worst.x));
            spent |= out;
            Some(if expanded.cost < reflected.cost { expanded } else { reflected })
        } else if reflected.cost < simplex[n - 1].cost {
            Some(reflected)
        } else if reflected.cost < worst.cost {
            let (outside, out) = vertex(along(contraction * reflection, &worst.x));
            spent |= out;
            (outside.cost <= reflected.cost).then_some(outside)
        } else {
            let (inside, out) = vertex(along(-contraction, &worst.x));
            spent |= out;
            (inside.cost < worst.cost).then_some(inside)
        };
        match replacement {
            Some(v) => simplex[n] = v,
            None => {
                let best = simplex[0].x.clone();
                for old in &mut simplex[1..] {
                    let x = (0..n)
                        .map(|j| (best[j] + shrinkage * (old.x[j] - best[j])).clamp(bounds[j].0, bounds[j].1))
                        .collect();
                    let (v, out) = vertex(x);
                    *old = v;
                    spent |= out;
                }
            }
        }
        simplex.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    }
    let best = simplex.swap_remove(0);
    let stop = match (best.cost.is_finite(), spent) {
        (false, _) => NelderMeadStop::NotFinite,
        (true, true) => NelderMeadStop::MaxEvaluations,
        (true, false) => NelderMeadStop::Converged,
    };
    (best, stop)
}

/// The start and one vertex a coordinate, 5 % away (0.00025 from zero), mirrored at the upper bound.
fn initial_simplex(start: &[f64], bounds: &[(f64, f64)]) -> Vec<Vec<f64>> {
    let start: Vec<f64> = start.iter().zip(bounds).map(|(v, b)| v.clamp(b.0, b.1)).collect();
    let moved = (0..start.len()).map(|j| {
        let mut x = start.clone();
        x[j] = if x[j] == 0.0 { 0.00025 } else { 1.05 * x[j] };
        if x[j] > bounds[j].1 {
            x[j] = 2.0 * bounds[j].1 - x[j];
        }
        x[j] = x[j].clamp(bounds[j].0, bounds[j].1);
        x
    });
    std::iter::once(start.clone()).chain(moved).collect()
}

/// An infinite best cost never converges: `inf - inf` is NaN, which is not below anything.
fn converged(simplex: &[Vertex], config: &NelderMeadConfig) -> bool {
    let best = &simplex[0];
    simplex[1..].iter().all(|v| {
        (v.cost - best.cost).abs() <= config.tolerance_cost
            && v.x.iter().zip(&best.x).all(|(a, b)| (a - b).abs() <= config.tolerance_x)
    })
}

#[cfg(test)]
mod tests;
