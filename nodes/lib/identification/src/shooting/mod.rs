//! Least squares on open-loop rollouts of short windows with free starts ("multiple shooting").
//!
//! The data are cut into windows of 0.3-1 s. In each the model runs open loop from a start state that is free: neither the
//! noise of the first sample nor the drift of a long rollout gets into the parameters. One-step errors would drown in sensor noise (errors in
//! variables). The start states are eliminated window by window (Schur complement), so that a step costs no more than one rollout with derivatives.
//!
//! ```text
//! minimise over theta, x_w:   sum_w n_w rho( |r_w|^2 / n_w )  +  sum_j ((theta_j - mean_j)/sigma_j)^2
//! r_w = (y_measured - y(theta, x_w)) / sigma_y,      rho(s) = 2 k^2 (sqrt(1 + s/k^2) - 1)
//! ```
//!
//! theta: parameters of the model, x_w: start state of window w, n_w: residuals in it, k: robustness (rho(s) = s for k = infinity).
//! Derivatives are exact (dual numbers); the step is Levenberg-Marquardt's, within bounds.
//!
//! Both the direct fit of the tires and the diagnosis of the gap run on this engine; they differ in the [`Rollout`] that they give it.

mod linearize;
mod solve;

use gripsight_vehicle::Real;

pub use linearize::{Evaluation, Linearization, evaluate, linearize};
pub use solve::{Descent, Fit, StopReason, descend, fit};

/// A stretch of samples of one segment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Which segment.
    pub segment: usize,
    /// First sample.
    pub from: usize,
    /// Samples.
    pub len: usize,
}

/// Cuts segments of the given lengths (in samples) into windows of `len` samples, one after the other; a rest shorter than a window is
/// left out.
#[must_use]
pub fn tile(segment_lengths: &[usize], len: usize) -> Vec<Window> {
    let len = len.max(1);
    segment_lengths
        .iter()
        .enumerate()
        .flat_map(|(segment, &n)| (0..n / len).map(move |k| Window { segment, from: k * len, len }))
        .collect()
}

/// A model that can be run over a window, for any number type.
pub trait Rollout: Sync {
    /// Channels that it predicts at every sample.
    fn channels(&self) -> usize;

    /// Predicts the channels at every sample of the window, sample after sample, into `out` (cleared before).
    fn rollout<T: Real>(&self, parameters: &[T], start: [T; 2], window: &Window, out: &mut Vec<T>);

    /// The measurement in the layout of [`Self::rollout`], into `out` (cleared before); NaN where there is none.
    fn measured(&self, window: &Window, out: &mut Vec<f64>);

    /// A first guess of the start state.
    fn start_guess(&self, window: &Window) -> [f64; 2];
}

/// What is known of a parameter beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Its most likely value.
    pub mean: f64,
    /// How far from it it may well be.
    pub sigma: f64,
}

/// A parameter of the model, as the fit sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Where the fit starts, or where the parameter stays if it is not free.
    pub start: f64,
    /// Smallest value allowed.
    pub low: f64,
    /// Largest value allowed.
    pub high: f64,
    /// Whether the fit may move it.
    pub free: bool,
    /// A soft bound, if any.
    pub prior: Option<Prior>,
}

/// Everything that defines a fit.
#[derive(Debug)]
pub struct Problem<'a, M> {
    /// The model, which also knows the measurement.
    pub model: &'a M,
    /// The windows that count.
    pub windows: &'a [Window],
    /// Standard deviation of each channel: what residuals are divided by.
    pub sigma: &'a [f64],
    /// The model's parameters.
    pub parameters: &'a [Parameter],
    /// Robustness k; infinite for plain least squares.
    pub robust_k: f64,
    /// Relative change of the cost under which the fit has converged.
    pub tolerance: f64,
    /// Iterations at most.
    pub max_iterations: usize,
}

/// A tolerance under which results are the same to every digit that is stated.
pub const TOLERANCE: f64 = 1e-6;

impl<M> Problem<'_, M> {
    /// Places of the free parameters.
    pub(crate) fn free(&self) -> Vec<usize> {
        (0..self.parameters.len()).filter(|&j| self.parameters[j].free).collect()
    }
}

#[cfg(test)]
mod tests;
