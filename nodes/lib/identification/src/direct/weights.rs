//! How much a residual counts.

use super::ROBUST_K;
use crate::data::median;
use crate::rollout::TireRollout;
use gripsight_estimation::shooting::Fit;
use gripsight_model::{Rollout, Window};

/// What residuals are divided by: the scatter of each channel about the fit (the median window's root mean square, at least the noise),
/// times the root of their correlation length. Errors of the model are correlated; counted as independent they would overrule every prior.
/// Beyond a window they are still the same errors, corner after corner: hence [`MISFIT`].
pub(super) fn weights(model: &TireRollout<'_>, fit: &Fit, windows: &[Window], noise: &[f64; 2]) -> Weights {
    let (mut predicted, mut measured) = (Vec::new(), Vec::new());
    let mut squares = [Vec::new(), Vec::new()];
    let len = windows.first().map_or(0, |w| w.len);
    let mut covariance = [vec![0.0; len], vec![0.0; len]];
    for (window, start) in windows.iter().zip(&fit.starts) {
        model.rollout(&fit.parameters, *start, window, &mut predicted);
        model.measured(window, &mut measured);
        for channel in 0..2 {
            let errors: Vec<f64> =
                predicted.iter().zip(&measured).skip(channel).step_by(2).map(|(p, m)| p - m).collect();
            squares[channel].push(errors.iter().map(|e| e * e).sum::<f64>() / window.len as f64);
            for (lag, sum) in covariance[channel].iter_mut().enumerate() {
                *sum += errors.iter().zip(&errors[lag..]).map(|(a, b)| a * b).sum::<f64>();
            }
        }
    }
    let scatter =
        std::array::from_fn(|c| median(&mut squares[c]).unwrap_or(0.0).sqrt().max(0.5 * noise[c]).max(1e-6));
    let length = |c: usize| {
        let rho = covariance[c].iter().skip(1).map(|v| v / covariance[c][0].max(f64::MIN_POSITIVE));
        1.0 + 2.0 * rho.take_while(|r| *r > 0.0).sum::<f64>()
    };
    Weights { scatter, sigma: std::array::from_fn(|c| scatter[c] * (MISFIT * length(c)).sqrt()) }
}

/// How much the scores of windows vary over what the correlation within them explains: 2 to 4 on development drives.
const MISFIT: f64 = 4.0;

/// Share of how a window moved that a fit explains at least where it shows forces: more than it leaves.
const LEAST_EXPLAINED: f64 = 0.5;

/// Scatter of a fit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weights {
    /// Of v_y and yaw rate about the rollouts.
    pub(super) scatter: [f64; 2],
    /// The same for samples that count as independent.
    pub(super) sigma: [f64; 2],
}

impl Weights {
    /// Whether a window shows the forces at the slips that a fit drives it at. It does not where the fit misses it by more than others and leaves more of how it
    /// moved than it explains: there something else than the tires made what was recorded, such as commands that never came to the wheels.
    pub(super) fn shows(
        &self,
        model: &TireRollout<'_>,
        parameters: &[f64],
        start: [f64; 2],
        window: &Window,
    ) -> bool {
        let (mut predicted, mut measured) = (Vec::new(), Vec::new());
        model.rollout(parameters, start, window, &mut predicted);
        model.measured(window, &mut measured);
        let (mut missed, mut moved) = (0.0, 0.0);
        for (channel, scatter) in self.scatter.iter().enumerate() {
            let pairs =
                predicted.iter().zip(&measured).skip(channel).step_by(2).filter(|(_, m)| m.is_finite());
            let n = pairs.clone().count().max(1) as f64;
            let mean = pairs.clone().map(|(_, m)| m).sum::<f64>() / n;
            missed += pairs.clone().map(|(p, m)| ((p - m) / scatter).powi(2)).sum::<f64>() / n;
            moved += pairs.map(|(_, m)| ((m - mean) / scatter).powi(2)).sum::<f64>() / n;
        }
        missed <= (ROBUST_K.powi(2) * self.scatter.len() as f64).max(LEAST_EXPLAINED * moved)
    }
}
