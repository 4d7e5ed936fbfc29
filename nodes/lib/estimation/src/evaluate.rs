//! Errors of open-loop rollouts in units of the noise, with intervals by block bootstrap.

use gripsight_model::{Channel, Recording, Window};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::windows::Windows;

/// A figure with its 90 % interval. What is not known is not a number, `null` in JSON.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Estimate {
    /// Best value.
    pub value: f64,
    /// Lower end of the 90 % interval.
    pub low: f64,
    /// Upper end of the 90 % interval.
    pub high: f64,
}

impl Estimate {
    /// Not known: `null` in JSON.
    pub const UNKNOWN: Self = Self { value: f64::NAN, low: f64::NAN, high: f64::NAN };
}

/// Errors of a model on windows.
#[derive(Debug, Clone)]
pub struct Score {
    /// Sum of squares of each window over the noise variance.
    pub squares: Vec<f64>,
    /// The start states that go with them.
    pub starts: Vec<[f64; 2]>,
}

/// Resamples of a bootstrap.
const RESAMPLES: usize = 400;

/// Residuals of a window that are free after its start state and the means taken off are counted.
fn freedom(recording: &Recording, window: &Window) -> f64 {
    let scored = || recording.channels.iter().filter(|c| c.scored());
    let means = scored().filter(|c| c.without_mean()).count();
    let jumps = &recording.runs[window.segment].jumps[window.from..window.from + window.len];
    let unasked = scored().filter(|c| **c == Channel::LongitudinalAcceleration).count()
        * jumps.iter().filter(|j| **j).count();
    ((window.len * scored().count() - unasked) as f64 - 2.0 - means as f64).max(1.0)
}

/// Blocks that a bootstrap needs.
const LEAST_BLOCKS: usize = 3;

/// Mean squared error over the noise variance of every block: (sum of squares, degrees of freedom). Of fewer than three blocks every
/// window counts as one, and intervals come out too narrow.
#[must_use]
pub fn by_block(recording: &Recording, windows: &Windows, score: &Score) -> Vec<(f64, f64)> {
    let mut blocks: Vec<(usize, f64, f64)> = Vec::new();
    let mut numbers = windows.block.clone();
    numbers.dedup();
    let few = numbers.len() < LEAST_BLOCKS;
    for (k, (window, &square)) in windows.windows.iter().zip(&score.squares).enumerate() {
        let block = if few { k } else { windows.block[k] };
        let n = freedom(recording, window);
        match blocks.last_mut().filter(|b| b.0 == block) {
            Some(last) => {
                last.1 += square;
                last.2 += n;
            }
            None => blocks.push((block, square, n)),
        }
    }
    blocks.into_iter().map(|(_, s, n)| (s, n)).collect()
}

/// The mean over blocks.
#[must_use]
pub fn mean(blocks: &[(f64, f64)]) -> f64 {
    let (s, n) = blocks.iter().fold((0.0, 0.0), |(s, n), b| (s + b.0, n + b.1));
    if n > 0.0 { s / n } else { f64::NAN }
}

/// A statistic of resampled blocks, the same resamples for all figures: `statistic` gets the indices drawn.
#[must_use]
pub fn bootstrap(blocks: usize, statistic: impl Fn(&[usize]) -> f64) -> Estimate {
    let plain: Vec<usize> = (0..blocks).collect();
    let value = statistic(&plain);
    if blocks < LEAST_BLOCKS {
        return Estimate { value, low: f64::NEG_INFINITY, high: f64::INFINITY };
    }
    let mut random = ChaCha8Rng::seed_from_u64(0x6a70);
    let mut drawn: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let picked: Vec<usize> = (0..blocks).map(|_| random.random_range(0..blocks)).collect();
            statistic(&picked)
        })
        .collect();
    drawn.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| drawn[((RESAMPLES - 1) as f64 * share).round() as usize];
    Estimate { value, low: at(0.05).min(value), high: at(0.95).max(value) }
}

/// The mean over the blocks drawn.
#[must_use]
pub fn of_picked(blocks: &[(f64, f64)], picked: &[usize]) -> f64 {
    let (s, n) = picked.iter().fold((0.0, 0.0), |(s, n), &i| (s + blocks[i].0, n + blocks[i].1));
    s / f64::max(n, 1.0)
}

/// The mean with its interval.
#[must_use]
pub fn interval(blocks: &[(f64, f64)]) -> Estimate {
    bootstrap(blocks.len(), |picked| of_picked(blocks, picked))
}
