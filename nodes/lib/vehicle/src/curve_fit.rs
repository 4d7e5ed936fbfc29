//! The Magic Formula through points of a curve.

use nalgebra::{SMatrix, SVector};

use crate::{Dual, MagicFormula, Real as _};

/// What F_y/F_z of a point is taken to be known to.
const FORCE_SIGMA: f64 = 0.002;
/// What holds stiffness, C, D and E where points do not tell, around those of the start: stiffness and D relative, C and E absolute.
const NEAR: [f64; 4] = [0.5, 0.3, 0.5, 1.0];
/// C of a plain curve.
const PLAIN_C: f64 = 1.4;
/// Range of C.
const C_RANGE: [f64; 2] = [1.0, 2.2];
const STEPS: usize = 100;

/// Parameters of a curve without bounds: ln(B C D), the place of C within its range as a logit, ln D, ln(1 - E).
#[derive(Clone, Copy)]
struct Unbounded([f64; 4]);

impl Unbounded {
    fn of(tire: &MagicFormula) -> Self {
        const INSIDE: f64 = 0.01;
        let share = ((tire.c - C_RANGE[0]) / (C_RANGE[1] - C_RANGE[0])).clamp(INSIDE, 1.0 - INSIDE);
        Self([
            tire.normalized_stiffness().abs().max(INSIDE).ln(),
            (share / (1.0 - share)).ln(),
            tire.d.abs().max(INSIDE).ln(),
            (1.0 - tire.e).max(INSIDE).ln(),
        ])
    }

    /// Stiffness, C, D, E, and the derivative of each by its own.
    fn values(&self) -> ([f64; 4], [f64; 4]) {
        let [k, c, d, e] = self.0;
        let (share, width) = (1.0 / (1.0 + (-c).exp()), C_RANGE[1] - C_RANGE[0]);
        (
            [k.exp(), C_RANGE[0] + width * share, d.exp(), 1.0 - e.exp()],
            [k.exp(), width * share * (1.0 - share), d.exp(), -e.exp()],
        )
    }

    fn tire(&self) -> MagicFormula {
        let [k, c, d, e] = self.values().0;
        MagicFormula::from_stiffness(k, c, d, e)
    }
}

impl MagicFormula {
    /// The curve nearest to points (slip angle in rad, F_y/F_z), by least squares (Levenberg and Marquardt). Where they do not tell, above the slips that they
    /// have, its shape stays near that of `near`. `None` where a point or the start is not finite, or there is no point.
    #[must_use]
    pub fn through(points: &[(f64, f64)], near: &Self) -> Option<Self> {
        let finite = points.iter().all(|(a, f)| a.is_finite() && f.is_finite());
        if points.is_empty() || !finite || !near.is_finite() {
            return None;
        }
        let start = Unbounded::of(near).values().0;
        let sigma = [NEAR[0] * start[0], NEAR[1], NEAR[2] * start[2], NEAR[3]];
        let cost = |p: &Unbounded| {
            let tire = p.tire();
            let of_points: f64 = points
                .iter()
                .map(|&(slip, force)| ((tire.normalized_force(slip) - force) / FORCE_SIGMA).powi(2))
                .sum();
            let values = p.values().0;
            of_points + (0..4).map(|i| ((values[i] - start[i]) / sigma[i]).powi(2)).sum::<f64>()
        };
        // From a shape with little curvature, too: between large and small E lies a ridge.
        let plain = Self { c: PLAIN_C, e: 0.0, ..*near };
        let fits =
            [*near, plain].map(|from| descended(points, Unbounded::of(&from), (&start, &sigma), &cost));
        let best = fits.into_iter().flatten().min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(best.0.tire())
    }
}

/// Where Levenberg's and Marquardt's steps end, with the cost there; means and standard deviations of the priors are of [`Unbounded::values`].
fn descended(
    points: &[(f64, f64)],
    mut p: Unbounded,
    (start, sigma): (&[f64; 4], &[f64; 4]),
    cost: &impl Fn(&Unbounded) -> f64,
) -> Option<(Unbounded, f64)> {
    let (mut lowest, mut damping) = (cost(&p), 1e-3);
    for _ in 0..STEPS {
        let (mut normal, mut gradient) = (SMatrix::<f64, 4, 4>::zeros(), SVector::<f64, 4>::zeros());
        let (values, by) = p.values();
        let [k, c, d, e]: [Dual<4>; 4] = std::array::from_fn(|i| Dual::variable(values[i], i));
        let tire = MagicFormula { b: k / (c * d), c, d, e };
        for &(slip, force) in points {
            let at = tire.normalized_force(Dual::from(slip));
            let row = SVector::<f64, 4>::from_fn(|i, _| at.derivatives()[i] * by[i] / FORCE_SIGMA);
            normal += row * row.transpose();
            gradient += row * ((force - at.re()) / FORCE_SIGMA);
        }
        for i in 0..4 {
            normal[(i, i)] += (by[i] / sigma[i]).powi(2);
            gradient[i] += by[i] * (start[i] - values[i]) / sigma[i].powi(2);
            normal[(i, i)] = normal[(i, i)] * (1.0 + damping) + f64::EPSILON;
        }
        let step = normal.cholesky()?.solve(&gradient);
        let next = Unbounded(std::array::from_fn(|i| p.0[i] + step[i].clamp(-1.0, 1.0)));
        let of_next = cost(&next);
        if of_next < lowest {
            let ends = damping < 1e-3 && lowest - of_next < 1e-9 * (1.0 + lowest);
            (p, lowest, damping) = (next, of_next, (damping / 4.0).max(1e-12));
            if ends {
                break;
            }
        } else if damping > 1e12 {
            break;
        } else {
            damping *= 4.0;
        }
    }
    Some((p, lowest))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(tire: &MagicFormula, to_rad: f64) -> Vec<(f64, f64)> {
        (-50..=50).map(|k| to_rad * f64::from(k) / 50.0).map(|a| (a, tire.normalized_force(a))).collect()
    }

    #[test]
    fn a_curve_is_found_again_over_the_slips_that_there_are() {
        let tire = MagicFormula { b: 9.0, c: 1.5, d: 0.9, e: -0.5 };
        for near in [
            MagicFormula { b: 6.0, c: 1.3, d: 1.2, e: 0.0 },
            MagicFormula { b: 14.0, c: 1.7, d: 0.6, e: 0.4 },
        ] {
            let found = MagicFormula::through(&points(&tire, 0.4), &near).unwrap();
            for (slip, force) in points(&tire, 0.4) {
                approx::assert_abs_diff_eq!(found.normalized_force(slip), force, epsilon = 0.004);
            }
        }
    }

    #[test]
    fn small_slips_tell_the_stiffness_and_leave_the_shape() {
        let tire = MagicFormula { b: 9.0, c: 1.5, d: 0.9, e: -0.5 };
        let near = MagicFormula { b: 7.0, c: 1.4, d: 1.1, e: 0.0 };
        let found = MagicFormula::through(&points(&tire, 0.01), &near).unwrap();
        approx::assert_relative_eq!(
            found.normalized_stiffness(),
            tire.normalized_stiffness(),
            max_relative = 0.01
        );
        assert!((found.d - near.d).abs() < 0.2 && (found.c - near.c).abs() < 0.2, "{found:?}");
    }

    #[test]
    fn what_is_no_curve_is_refused() {
        let near = MagicFormula { b: 9.0, c: 1.5, d: 0.9, e: -0.5 };
        assert!(MagicFormula::through(&[], &near).is_none());
        assert!(MagicFormula::through(&[(0.1, f64::NAN)], &near).is_none());
    }
}
