//! Errors of held-out windows over the noise, with intervals from blocks, and where they lie.

use std::collections::BTreeMap;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::Channel;
use crate::drive::Drive;
use crate::linear::Layout;
use crate::outcome::{Estimate, Place, Where};

const DRAWS: usize = 1000;
const SEED: u64 = 16;

/// Held-out windows, block by block; the training ones where nothing is held out.
pub(crate) struct Scored<'a> {
    layout: &'a Layout,
    /// Degrees of freedom that the starts take from each window.
    starts: usize,
    blocks: Vec<Vec<usize>>,
    pub(crate) on: &'static str,
}

impl<'a> Scored<'a> {
    pub(crate) fn new(layout: &'a Layout, starts: usize) -> Self {
        let held_out = layout.held_out.iter().any(|h| *h);
        let mut blocks: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for w in (0..layout.windows.len()).filter(|&w| layout.held_out[w] == held_out) {
            blocks.entry(layout.block[w]).or_default().push(w);
        }
        let on = if held_out { "held-out blocks" } else { "the training blocks" };
        Self { layout, starts, blocks: blocks.into_values().collect(), on }
    }

    fn freedom(&self, w: usize) -> f64 {
        self.layout.windows[w].1.saturating_sub(self.starts).max(1) as f64
    }

    fn sums(&self, squares: &[f64]) -> Vec<(f64, f64)> {
        let of =
            |b: &Vec<usize>| b.iter().fold((0.0, 0.0), |(s, n), &w| (s + squares[w], n + self.freedom(w)));
        self.blocks.iter().map(of).collect()
    }

    /// A figure made of several models' squares, resampled block by block.
    pub(crate) fn estimate(&self, models: &[&[f64]], figure: impl Fn(&[f64]) -> f64) -> Estimate {
        let sums: Vec<Vec<(f64, f64)>> = models.iter().map(|m| self.sums(m)).collect();
        let count = self.blocks.len();
        let of = |picked: &[usize]| {
            let errors: Vec<f64> = sums
                .iter()
                .map(|s| {
                    let (square, n) = picked.iter().fold((0.0, 0.0), |(a, b), &k| (a + s[k].0, b + s[k].1));
                    square / n
                })
                .collect();
            figure(&errors)
        };
        let value = of(&(0..count).collect::<Vec<_>>());
        if count < 2 {
            return Estimate { value, low: f64::NEG_INFINITY, high: f64::INFINITY };
        }
        let mut rng = ChaCha8Rng::seed_from_u64(SEED);
        let mut draws: Vec<f64> = (0..DRAWS)
            .map(|_| of(&(0..count).map(|_| rng.random_range(0..count)).collect::<Vec<_>>()))
            .collect();
        if !value.is_finite() || draws.iter().any(|d| !d.is_finite()) {
            return Estimate { value, low: f64::NAN, high: f64::NAN };
        }
        draws.sort_by(f64::total_cmp);
        let at = |share: f64| draws[(share * (DRAWS - 1) as f64) as usize];
        Estimate { value, low: at(0.05), high: at(0.95) }
    }

    /// Every window, fitted or not: what nothing was fitted for.
    pub(crate) fn everywhere(layout: &'a Layout, starts: usize) -> Self {
        let blocks = (0..layout.windows.len()).map(|w| vec![w]).collect();
        Self { layout, starts, blocks, on: "all of it" }
    }

    /// Whether one model beats another by more than noise gives at 5 %: where predictions are `d` apart, squares differ by noise of `2 |d|`.
    pub(crate) fn is_clearly_better(&self, worse: &[f64], better: &[f64]) -> bool {
        const Z: f64 = 1.645;
        let (mut gained, mut apart, mut left, mut freedom) = (0.0, 0.0, 0.0, 0.0);
        for &w in self.blocks.iter().flatten() {
            let (from, len) = self.layout.windows[w];
            for (a, b) in worse[from..from + len].iter().zip(&better[from..from + len]) {
                gained += a * a - b * b;
                apart += (a - b) * (a - b);
                left += b * b;
            }
            freedom += self.freedom(w);
        }
        let noise = (left / f64::max(freedom, 1.0)).max(1.0).sqrt();
        gained > 2.0 * Z * noise * apart.sqrt()
    }

    /// How sure one model beats another: the mean of the blocks' differences over its standard error.
    pub(crate) fn z(&self, worse: &[f64], better: &[f64]) -> f64 {
        let (a, b) = (self.sums(worse), self.sums(better));
        let d: Vec<f64> = a.iter().zip(&b).map(|(x, y)| x.0 - y.0).collect();
        let n = d.len() as f64;
        if n < 2.0 {
            return 0.0;
        }
        let mean = d.iter().sum::<f64>() / n;
        let variance = d.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        mean / (variance / n).sqrt().max(f64::MIN_POSITIVE)
    }
}

/// Where the errors of a model lie: by channel, speed, lateral acceleration and time.
pub(crate) fn places(drive: &Drive, layout: &Layout, projected: &[f64]) -> Where {
    let count = drive.channels.len();
    let total: f64 = projected.iter().map(|r| r * r).sum();
    // Of every sample: which window and sample, and its squares by channel.
    let samples = || {
        drive.windows.iter().zip(&layout.windows).flat_map(move |(w, (from, _))| {
            (0..w.len).map(move |i| (w, w.from + i, &projected[from + i * count..from + (i + 1) * count]))
        })
    };
    let channel = drive.channels.iter().enumerate().map(|(c, (channel, _))| {
        let (sum, n) = samples().fold((0.0, 0.0), |(s, n), (_, _, r)| (s + r[c] * r[c], n + 1.0));
        let n: f64 = n;
        Place {
            low: 0.0,
            high: 0.0,
            unit: "1",
            channel: channel.name(),
            chi2_per_dof: sum / n.max(1.0),
            share: sum / total,
        }
    });
    let bins = |unit: &'static str, of: &dyn Fn(&crate::Window, usize) -> f64| {
        const BINS: usize = 6;
        let values: Vec<f64> = samples().map(|(w, k, _)| of(w, k)).collect();
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let width = ((high - low) / BINS as f64).max(1e-9);
        let mut sums = [(0.0, 0.0); BINS];
        for (value, (_, _, r)) in values.iter().zip(samples()) {
            let bin = &mut sums[(((value - low) / width) as usize).min(BINS - 1)];
            bin.0 += r.iter().map(|r| r * r).sum::<f64>();
            bin.1 += count as f64;
        }
        let place = |(k, (sum, n)): (usize, &(f64, f64))| Place {
            low: low + k as f64 * width,
            high: low + (k + 1) as f64 * width,
            unit,
            channel: "all",
            chi2_per_dof: sum / n,
            share: sum / total,
        };
        sums.iter().enumerate().filter(|(_, (_, n))| *n > 0.0).map(place).collect::<Vec<_>>()
    };
    let stretch = |w: &crate::Window| &drive.stretches[w.stretch];
    Where {
        channel: channel.collect(),
        speed: bins("m/s", &|w, k| stretch(w).v_x_mps[k]),
        lateral_acceleration: bins("m/s2", &|w, k| {
            (stretch(w).v_x_mps[k] * stretch(w).segment.yaw_rate_radps[k]).abs()
        }),
        time: bins("s", &|w, k| stretch(w).segment.time_s(k)),
    }
}

/// What pictures are drawn from: by channel, time with the measured value and those of two models, over held-out windows.
pub(crate) fn series(
    drive: &Drive,
    layout: &Layout,
    models: [&[f64]; 2],
) -> Vec<(&'static str, Vec<[f64; 4]>)> {
    let count = drive.channels.len();
    let of = |(c, (channel, sigma)): (usize, &(Channel, f64))| {
        let rows = drive.windows.iter().zip(&layout.windows).filter(|(w, _)| w.held_out).flat_map(
            |(w, (from, _))| {
                let s = &drive.stretches[w.stretch];
                (0..w.len).map(move |i| {
                    let measured = s.channel(*channel).map_or(f64::NAN, |v| v[w.from + i]);
                    let predicted = models.map(|m| measured - sigma * m[from + i * count + c]);
                    [s.segment.time_s(w.from + i), measured, predicted[0], predicted[1]]
                })
            },
        );
        (channel.name(), rows.collect())
    };
    drive.channels.iter().enumerate().map(of).collect()
}
