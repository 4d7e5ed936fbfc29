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
//! Both the direct fit of the tires and the diagnosis of the gap run on this engine; they differ in the [`gripsight_model::Rollout`] that they
//! give it. It knows no effect by name.

mod linearize;
mod solve;

use gripsight_model::Window;

pub use linearize::{Linearization, cost, linearize};
pub use solve::{Fit, StopReason, fit, within};

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
    pub fn free(&self) -> Vec<usize> {
        (0..self.parameters.len()).filter(|&j| self.parameters[j].free).collect()
    }
}

#[cfg(test)]
mod tests;
