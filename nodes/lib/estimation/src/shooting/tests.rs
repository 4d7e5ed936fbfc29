//! A linear second-order plant with known parameters.

use super::*;
use gripsight_model::{Rollout, Window, tile};
use gripsight_vehicle::Real;
use rand::{RngExt, SeedableRng};

/// x1' = x2, x2' = -a x1 - b x2; x1 is measured, 0.02 s apart.
struct Oscillator {
    measured: Vec<f64>,
}

const DT_S: f64 = 0.02;

impl Rollout for Oscillator {
    fn channels(&self) -> usize {
        1
    }

    fn rollout<T: Real>(&self, parameters: &[T], start: [T; 2], window: &Window, out: &mut Vec<T>) {
        out.clear();
        let [mut x, mut v] = start;
        for _ in 0..window.len {
            out.push(x);
            for _ in 0..10 {
                v += (-(parameters[0] * x) - parameters[1] * v) * (DT_S / 10.0);
                x += v * (DT_S / 10.0);
            }
        }
    }

    fn measured(&self, window: &Window, out: &mut Vec<f64>) {
        out.clear();
        out.extend_from_slice(&self.measured[window.from..window.from + window.len]);
    }

    fn start_guess(&self, window: &Window) -> [f64; 2] {
        [self.measured[window.from], 0.0]
    }
}

fn plant(noise: f64, seed: u64) -> Oscillator {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let clean = Oscillator { measured: vec![] };
    let mut out = Vec::new();
    clean.rollout(&[40.0, 0.3], [1.0, 0.0], &Window { segment: 0, from: 0, len: 1000 }, &mut out);
    let measured = out.iter().map(|x| x + noise * (random.random::<f64>() - 0.5) * 12_f64.sqrt()).collect();
    Oscillator { measured }
}

fn parameters() -> Vec<Parameter> {
    [20.0, 1.0].map(|start| Parameter { start, low: 0.0, high: 100.0, free: true, prior: None }).to_vec()
}

fn solve(plant: &Oscillator, parameters: &[Parameter], robust_k: f64) -> Fit {
    let windows = tile(&[1000], 50);
    fit(
        &Problem {
            model: plant,
            windows: &windows,
            sigma: &[0.01],
            parameters,
            robust_k,
            tolerance: TOLERANCE,
            max_iterations: 50,
        },
        None,
    )
}

#[test]
fn finds_the_parameters_and_its_intervals_cover() {
    let mut covered = 0;
    for seed in 0..60 {
        let found = solve(&plant(0.01, seed), &parameters(), f64::INFINITY);
        assert_eq!(found.stop, StopReason::Converged);
        approx::assert_relative_eq!(found.parameters[0], 40.0, max_relative = 0.05);
        let error = found.standard_error(0).unwrap();
        covered += usize::from((found.parameters[0] - 40.0).abs() < 1.645 * error);
    }
    // Binomial(60, 0.9): 46 or fewer happens once in 900.
    assert!(covered > 46, "90 % intervals covered {covered} of 60");
}

#[test]
fn outlying_windows_hardly_move_the_robust_fit() {
    let mut bad = plant(0.01, 1);
    for k in 300..340 {
        bad.measured[k] += 1.0;
    }
    let plain = (solve(&bad, &parameters(), f64::INFINITY).parameters[1] - 0.3).abs();
    let robust = (solve(&bad, &parameters(), 2.0).parameters[1] - 0.3).abs();
    assert!(robust < 0.3 * plain, "robust {robust}, plain {plain}");
}

#[test]
fn bounds_priors_and_fixed_parameters_hold() {
    let mut bounded = parameters();
    bounded[0].high = 30.0;
    let found = solve(&plant(0.01, 2), &bounded, f64::INFINITY);
    assert_eq!((found.parameters[0], found.on_bound.as_slice()), (30.0, [0].as_slice()));

    let mut fixed = parameters();
    fixed[1].free = false;
    assert_eq!(solve(&plant(0.01, 2), &fixed, f64::INFINITY).parameters[1], 1.0);

    let mut tight = parameters();
    tight[0].prior = Some(Prior { mean: 45.0, sigma: 1e-4 });
    approx::assert_abs_diff_eq!(
        solve(&plant(0.01, 2), &tight, f64::INFINITY).parameters[0],
        45.0,
        epsilon = 1e-2
    );
}

/// A problem that is evaluated where it begins.
fn looked_at<'a>(
    plant: &'a Oscillator,
    windows: &'a [Window],
    parameters: &'a [Parameter],
) -> Problem<'a, Oscillator> {
    Problem {
        model: plant,
        windows,
        sigma: &[0.01],
        parameters,
        robust_k: 2.0,
        tolerance: TOLERANCE,
        max_iterations: 0,
    }
}

#[test]
fn the_gradient_is_the_derivative_of_the_cost() {
    let plant = plant(0.01, 3);
    let windows = tile(&[1000], 50);
    let parameters = parameters();
    let problem = looked_at(&plant, &windows, &parameters);
    // With the starts at their best, the gradient with the starts eliminated is the plain one.
    let found = fit(
        &Problem {
            max_iterations: 30,
            parameters: &parameters.iter().map(|p| Parameter { free: false, ..*p }).collect::<Vec<_>>(),
            ..problem
        },
        None,
    );
    let at = |a: f64| cost(&problem, &[a, 1.0], &found.starts);
    let here = linearize(&problem, &[20.0, 1.0], &found.starts);
    let numeric = (at(20.001) - at(19.999)) / 0.002;
    approx::assert_relative_eq!(2.0 * here.gradient[0], numeric, max_relative = 1e-4);
}

#[test]
fn a_small_step_lowers_the_cost_as_foretold() {
    let plant = plant(0.01, 5);
    let windows = tile(&[1000], 50);
    let parameters = parameters();
    let problem = Problem { robust_k: f64::INFINITY, ..looked_at(&plant, &windows, &parameters) };
    // Near the solution, so that the starts are off by more than the parameters.
    let (at, step) = ([40.5, 0.32], nalgebra::dvector![-0.3, -0.01]);
    let starts: Vec<[f64; 2]> = windows.iter().map(|w| plant.start_guess(w)).collect();
    let here = linearize(&problem, &at, &starts);
    let there = [at[0] + step[0], at[1] + step[1]];
    let fallen = here.cost - cost(&problem, &there, &here.starts_after(&step, &starts));
    approx::assert_relative_eq!(fallen, here.foretold(&step), max_relative = 1e-2);
}

#[test]
fn more_parameters_than_a_rollout_has_derivatives_of_are_taken_in_passes() {
    let plant = plant(0.01, 4);
    let windows = tile(&[1000], 50);
    let parameters = parameters();
    let problem = looked_at(&plant, &windows, &parameters);
    let [(cost, information, gradient), passes] =
        super::linearize::by_lanes_and_in_passes(&problem, &[20.0, 1.0], [0.1, -0.2]);
    assert_eq!(problem.free().len(), 2);
    approx::assert_relative_eq!(cost, passes.0, max_relative = 1e-12);
    approx::assert_relative_eq!(information, passes.1, max_relative = 1e-9);
    approx::assert_relative_eq!(gradient, passes.2, max_relative = 1e-9);
}
