//! Golden values: SciPy 1.17.1, `minimize(method="Nelder-Mead", bounds=..., options=dict(adaptive=True, xatol=1e-6, fatol=1e-10))`.

use super::*;
use approx::assert_relative_eq;
use proptest::prelude::*;

const GOLDEN: NelderMeadConfig =
    NelderMeadConfig { tolerance_x: 1e-6, tolerance_cost: 1e-10, max_evaluations: 4000, restarts: 0 };

fn rosenbrock(x: &[f64]) -> f64 {
    x.windows(2).map(|p| 100.0 * (p[1] - p[0] * p[0]).powi(2) + (1.0 - p[0]).powi(2)).sum()
}

/// Squared distance of a tire curve to the one with (9, 1.5, 1.05, -0.3), at 41 slips within 0.2 rad.
fn tire(x: &[f64]) -> f64 {
    let curve = |b: f64, c: f64, d: f64, e: f64, a: f64| {
        d * (c * (b * a - e * (b * a - (b * a).atan())).atan()).sin()
    };
    (-20..=20)
        .map(|k| f64::from(k) * 0.01)
        .map(|a| (curve(x[0], x[1], x[2], x[3], a) - curve(9.0, 1.5, 1.05, -0.3, a)).powi(2))
        .sum()
}

fn agrees(cost: fn(&[f64]) -> f64, start: &[f64], bounds: &[(f64, f64)], x: &[f64], evaluations: usize) {
    let found = minimize(cost, start, bounds, &GOLDEN).unwrap();
    assert_eq!(found.stop, NelderMeadStop::Converged);
    for (a, b) in found.x.iter().zip(x) {
        assert_relative_eq!(*a, *b, epsilon = 2e-6, max_relative = 2e-6);
    }
    // Rounding moves a decision by a step or two in hundreds.
    assert!(found.evaluations.abs_diff(evaluations) <= evaluations / 20, "{} evaluations", found.evaluations);
}

#[test]
fn agrees_with_scipy() {
    let wide = [(-5.0, 5.0); 4];
    agrees(rosenbrock, &[-1.2, 1.0], &wide[..2], &[0.999_999_869_473_974_5, 0.999_999_754_728_729_5], 189);
    agrees(rosenbrock, &[0.0, 0.5, 2.0, -1.0], &wide, &[1.0; 4], 937);
}

#[test]
fn agrees_with_scipy_on_bounds() {
    agrees(rosenbrock, &[-1.2, 1.0], &[(-2.0, 0.5), (-1.0, 2.0)], &[0.5, 0.249_999_918_938_398_07], 140);
}

#[test]
fn agrees_with_scipy_on_a_tire() {
    let bounds = [(1.0, 40.0), (1.0, 2.2), (0.05, 3.0), (-5.0, 1.0)];
    agrees(tire, &[5.0, 1.2, 0.8, 0.0], &bounds, &[9.0, 1.5, 1.05, -0.3], 744);
}

#[test]
fn a_restart_leaves_a_collapsed_simplex() {
    let bounds = [(1.0, 40.0), (1.0, 2.2), (0.05, 0.9), (-5.0, 1.0)];
    let start = [5.0, 1.2, 0.8, 0.0];
    let once = minimize(tire, &start, &bounds, &GOLDEN).unwrap();
    let again = minimize(tire, &start, &bounds, &NelderMeadConfig { restarts: 5, ..GOLDEN }).unwrap();
    assert!(again.cost <= once.cost && again.evaluations > once.evaluations);
}

#[test]
fn walks_out_of_nan() {
    let holed = |x: &[f64]| if x[0] < 0.0 { f64::NAN } else { (x[0] - 1.0).powi(2) + x[1].powi(2) };
    let found = minimize(holed, &[-0.01, 1.0], &[(-5.0, 5.0); 2], &GOLDEN).unwrap();
    assert_eq!(found.stop, NelderMeadStop::NotFinite, "all three vertices lie in the hole");
    let found = minimize(holed, &[0.1, 1.0], &[(-5.0, 5.0); 2], &GOLDEN).unwrap();
    assert_relative_eq!(found.x[0], 1.0, epsilon = 1e-4);
}

#[test]
fn says_when_evaluations_run_out() {
    let short = NelderMeadConfig { max_evaluations: 20, ..GOLDEN };
    let found = minimize(rosenbrock, &[-1.2, 1.0], &[(-5.0, 5.0); 2], &short).unwrap();
    assert_eq!(found.stop, NelderMeadStop::MaxEvaluations);
    assert!(found.evaluations <= 23, "one move may end what was begun: {}", found.evaluations);
}

#[test]
fn refuses_what_makes_no_sense() {
    for (start, bounds) in [
        (vec![], vec![]),
        (vec![0.0], vec![]),
        (vec![f64::NAN], vec![(0.0, 1.0)]),
        (vec![0.0], vec![(1.0, 0.0)]),
        (vec![0.0], vec![(f64::NAN, 0.0)]),
    ] {
        assert!(minimize(rosenbrock, &start, &bounds, &GOLDEN).is_err(), "{start:?} {bounds:?}");
    }
}

proptest! {
    #[test]
    fn never_worse_than_its_start_and_never_out_of_bounds(
        start in prop::collection::vec(-10.0_f64..10.0, 1..6),
        low in -4.0_f64..0.0,
        width in 0.0_f64..6.0,
    ) {
        let bounds = vec![(low, low + width); start.len()];
        let bowl = |x: &[f64]| x.iter().enumerate().map(|(j, v)| (v - j as f64).powi(2) * (1.0 + j as f64)).sum::<f64>();
        let clipped: Vec<f64> = start.iter().map(|v| v.clamp(low, low + width)).collect();
        let found = minimize(bowl, &start, &bounds, &NelderMeadConfig::default()).unwrap();
        prop_assert!(found.cost <= bowl(&clipped));
        prop_assert!(found.x.iter().all(|v| (low..=low + width).contains(v)));
    }
}
