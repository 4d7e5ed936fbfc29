//! Which effects: joint refits of the best candidates, one effect after the other.
use gripsight_identification::shooting::Rollout;

use crate::engine::{Engine, State};
use crate::smooth::median;
use crate::windows::Windows;

/// Mean square of each channel's residuals over the noise variance: median over windows.
pub(crate) fn channel_excess(engine: &Engine<'_>, state: &State, windows: &Windows) -> Vec<f64> {
    let model = engine.model(&state.effects, None);
    let channels = model.channels();
    let (mut predicted, mut measured) = (Vec::new(), Vec::new());
    let mut squares: Vec<Vec<f64>> = vec![Vec::new(); channels];
    for (window, start) in windows.windows.iter().zip(&state.starts) {
        model.rollout(&state.parameters, *start, window, &mut predicted);
        model.measured(window, &mut measured);
        let mut sum = vec![0.0; channels];
        for (i, (m, y)) in measured.iter().zip(&predicted).enumerate() {
            sum[i % channels] += ((m - y) / engine.recording.sigma[i % channels]).powi(2);
        }
        for (c, s) in sum.into_iter().enumerate() {
            squares[c].push(s / window.len as f64);
        }
    }
    squares.into_iter().map(median).collect()
}

/// Share of what a model leaves unexplained that counts as noise when the next one is fitted.
const MISFIT_SHARE: f64 = 0.3;

/// Weighs the channels by their noise and a share of what the current model leaves in them.
pub(crate) fn reweigh(engine: &mut Engine<'_>, state: &State, windows: &Windows) {
    let excess = channel_excess(engine, state, windows);
    let recording = engine.recording;
    engine.sigma = recording
        .weights
        .iter()
        .zip(recording.sigma.iter().zip(excess))
        .map(|(weight, (noise, e))| weight.max(noise * (1.0 + MISFIT_SHARE * (e - 1.0).max(0.0)).sqrt()))
        .collect();
}
