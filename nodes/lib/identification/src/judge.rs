//! How well a set predicts: errors of rollouts and of single steps.

use crate::data::Data;
use crate::rollout::{PARAMETERS, SIGNALS, TireRollout};
use gripsight_estimation::shooting::{Parameter, Problem, TOLERANCE, fit};
use gripsight_model::{Rollout, Window};

/// Root mean square errors over windows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Errors {
    /// v_y in m/s, yaw rate in rad/s.
    pub(crate) rms: [f64; 2],
    /// Both, each divided by its noise: the root of their mean square.
    pub(crate) normalized: f64,
}

impl Errors {
    fn of(squares: [f64; 2], samples: usize, noise: &[f64; 2]) -> Self {
        let mean = squares.map(|s| s / samples.max(1) as f64);
        let normalized = (0.5 * (mean[0] / noise[0].powi(2) + mean[1] / noise[1].powi(2))).sqrt();
        Self { rms: mean.map(f64::sqrt), normalized }
    }
}

/// Start states that fit each window best, everything else fixed.
pub(crate) fn best_starts(
    model: &TireRollout<'_>,
    p: &[f64; PARAMETERS],
    windows: &[Window],
    noise: &[f64; 2],
) -> Vec<[f64; 2]> {
    let fixed = p.map(|v| Parameter {
        start: v,
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
        free: false,
        prior: None,
    });
    let problem = Problem {
        model,
        windows,
        sigma: noise,
        parameters: &fixed,
        robust_k: f64::INFINITY,
        tolerance: TOLERANCE,
        max_iterations: 6,
    };
    fit(&problem, None).starts
}

/// Error of open-loop rollouts over whole windows, each from its best start.
pub(crate) fn rollout_errors(
    model: &TireRollout<'_>,
    p: &[f64; PARAMETERS],
    windows: &[Window],
    noise: &[f64; 2],
) -> Errors {
    let starts = best_starts(model, p, windows, noise);
    let (mut predicted, mut measured) = (Vec::new(), Vec::new());
    let (mut squares, mut samples) = ([0.0; 2], 0);
    for (window, start) in windows.iter().zip(&starts) {
        model.rollout(p, *start, window, &mut predicted);
        model.measured(window, &mut measured);
        samples += window.len;
        for (i, (a, b)) in predicted.iter().zip(&measured).enumerate() {
            squares[i % 2] += (a - b).powi(2);
        }
    }
    Errors::of(squares, samples, noise)
}

/// Error of the next sample predicted from this one.
pub(crate) fn one_step_errors(
    model: &TireRollout<'_>,
    p: &[f64; PARAMETERS],
    windows: &[Window],
    noise: &[f64; 2],
) -> Errors {
    let mut predicted = Vec::new();
    let (mut squares, mut samples) = ([0.0; 2], 0);
    for window in windows {
        let segment = &model.segments[window.segment];
        for k in window.from..window.from + window.len - 1 {
            let pair = Window { segment: window.segment, from: k, len: 2 };
            let yaw_rate = segment.yaw_rate_radps[k] - p[SIGNALS + 5];
            let v_y = segment.v_y_mps[k] - p[SIGNALS + 3] * yaw_rate - p[SIGNALS + 4];
            model.rollout(p, [v_y, yaw_rate], &pair, &mut predicted);
            squares[0] += (predicted[2] - segment.v_y_mps[k + 1]).powi(2);
            squares[1] += (predicted[3] - segment.yaw_rate_radps[k + 1]).powi(2);
            samples += 1;
        }
    }
    Errors::of(squares, samples, noise)
}

/// Root mean square errors of v_y (m/s) and yaw rate (rad/s) at each sample after the start of rollouts of `len` samples that begin where the
/// windows begin, from given starts. Windows whose stretch ends before are left out.
pub(crate) fn errors_over_horizon(
    model: &TireRollout<'_>,
    data: &Data,
    p: &[f64; PARAMETERS],
    windows: &[Window],
    starts: &[[f64; 2]],
    len: usize,
) -> Vec<[f64; 2]> {
    let (mut predicted, mut measured) = (Vec::new(), Vec::new());
    let mut squares = vec![[0.0; 2]; len];
    let mut counted = 0;
    for (window, start) in windows.iter().zip(starts) {
        let inside = data.stretches.iter().any(|s| {
            s.segment == window.segment && s.from <= window.from && window.from + len <= s.from + s.len
        });
        if !inside {
            continue;
        }
        let long = Window { len, ..*window };
        model.rollout(p, *start, &long, &mut predicted);
        model.measured(&long, &mut measured);
        counted += 1;
        for (i, (a, b)) in predicted.iter().zip(&measured).enumerate() {
            squares[i / 2][i % 2] += (a - b).powi(2);
        }
    }
    squares.iter().map(|s| s.map(|s| (s / f64::from(counted.max(1))).sqrt())).collect()
}
