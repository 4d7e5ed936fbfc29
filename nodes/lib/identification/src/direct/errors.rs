//! How well everything is known.

use nalgebra::DMatrix;

use super::SPREAD;
use crate::Doubt;
use crate::rollout::{PARAMETERS, SLIP_SHARE, V_X_SCALE, YAW_RATE_SCALE};
use gripsight_estimation::shooting::{Fit, Parameter};

/// Covariance of all parameters about a fit; zero for those that are held or on a bound, `None` where nothing is known.
///
/// The scales of the motion's signals are *considered* (Schmidt, NASA TN D-3455 (1966)): what they may be off by goes into everything else, and the fit has no
/// say in it. What a fit seems to tell of a scale is what the tire model's form misses, and an observer's v_y contradicts no single-track model, being one.
pub(super) fn covariance(fit: &Fit, all: &[Parameter], doubt: &Doubt) -> Option<DMatrix<f64>> {
    let considered = [
        (V_X_SCALE, doubt.v_x_scale),
        (YAW_RATE_SCALE, doubt.yaw_rate_scale),
        (SLIP_SHARE, doubt.v_y_slip_share),
    ];
    let free: Vec<usize> = (0..all.len()).filter(|&j| all[j].free).collect();
    let place = |j: usize| free.iter().position(|&f| f == j);
    let fitted: Vec<usize> = (0..free.len())
        .filter(|&i| considered.iter().all(|c| c.0 != free[i]) && !fit.on_bound.contains(&free[i]))
        .collect();
    let information = &fit.linearization.information;
    let own = DMatrix::from_fn(fitted.len(), fitted.len(), |i, j| information[(fitted[i], fitted[j])]);
    let inverse = own.cholesky()?.inverse();
    let mut covariance = &inverse * SPREAD.powi(2);
    for (parameter, sigma) in considered {
        let Some(scale) = place(parameter) else { continue };
        let towards = DMatrix::from_fn(fitted.len(), 1, |i, _| information[(fitted[i], scale)]);
        let follows = &inverse * towards * sigma;
        covariance += &follows * follows.transpose();
    }
    let mut whole = DMatrix::zeros(PARAMETERS, PARAMETERS);
    for (i, &a) in fitted.iter().enumerate() {
        for (j, &b) in fitted.iter().enumerate() {
            whole[(free[a], free[b])] = covariance[(i, j)];
        }
    }
    Some(whole)
}
