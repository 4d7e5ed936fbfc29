//! A model that can be run over a window of the data, whatever is fitted with it.

use gripsight_vehicle::Real;

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
