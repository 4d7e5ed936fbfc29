//! Noise of a channel from its own fastest part.
//!
//! The difference of order p of white noise has the variance C(2p, p) sigma^2; the car's own motion hardly has one. Median over samples:
//! knocks do not count. Coloured noise and filtered signals are underestimated; chi2 and floor are then relative to this figure,
//! as the report says.

use crate::recording::{Recording, Run};
use crate::smooth::median;

/// Order of the differences: of all samples, and of every second one.
const ORDERS: [u32; 2] = [4, 6];
/// Median of the absolute value of a normal variable over its standard deviation.
const MEDIAN_OF_NORMAL: f64 = 0.674_49;
/// Noise is never taken below this share of the signal's standard deviation: rounding and derived signals.
const LEAST_SHARE: f64 = 2e-3;

/// Standard deviation of the noise of channel `c`.
///
/// Signals that were put on a common time base lie between their samples: neighbours share noise, and differences of neighbours hide it. Every
/// second value does not share it; its figure counts where it is larger, but not so much that motion must be in it.
pub fn sigma(runs: &[Run], c: usize) -> f64 {
    let all = of_all(runs, c);
    let halved = of(halves(runs, c).iter().map(Vec::as_slice), ORDERS[1]);
    let noise = if halved < ROUGH_RATIO * all { all.max(halved) } else { all };
    noise.max(LEAST_SHARE * spread(runs, c, true)).max(1e-6)
}

fn of_all(runs: &[Run], c: usize) -> f64 {
    of(runs.iter().map(|r| r.measured[c].as_slice()), ORDERS[0])
}

/// Every second value, from the first and from the second on.
fn halves(runs: &[Run], c: usize) -> Vec<Vec<f64>> {
    let from = |run: &Run, first: usize| run.measured[c].iter().skip(first).step_by(2).copied().collect();
    runs.iter().flat_map(|r| [from(r, 0), from(r, 1)]).collect()
}

/// A noise that seems so many times larger at half the rate is not white: filtered, simulated, or not to be told from the motion.
pub const WHITE_RATIO: f64 = 1.4;
/// Up to this ratio the figure is rough, but of the right size: a few samples lost, or stamps that jitter, and filled in between.
pub const ROUGH_RATIO: f64 = 2.5;

/// Whether the noise of channel `c` can be told: above the least share, and the same at half the rate, within a ratio.
fn is_clear(runs: &[Run], c: usize, ratio: f64) -> bool {
    let noise = of_all(runs, c);
    let halved = of(halves(runs, c).iter().map(Vec::as_slice), ORDERS[0]);
    noise > LEAST_SHARE * spread(runs, c, true) && halved < ratio * noise
}

/// The scored channels whose noise cannot be told within a ratio.
pub fn unclear(recording: &Recording, ratio: f64) -> Vec<&'static str> {
    let scored = (0..recording.channels.len()).filter(|&c| recording.channels[c].scored());
    scored.filter(|&c| !is_clear(&recording.runs, c, ratio)).map(|c| recording.channels[c].name()).collect()
}

/// Standard deviation of the noise of a series in stretches, from its differences of an order p: the variance of white noise grows
/// by the binomial C(2p, p).
pub fn of<'a>(stretches: impl Iterator<Item = &'a [f64]>, order: u32) -> f64 {
    let mut sizes = Vec::new();
    for stretch in stretches {
        let mut d = stretch.to_vec();
        for _ in 0..order {
            d = d.windows(2).map(|w| w[1] - w[0]).collect();
        }
        sizes.extend(d.iter().map(|v| v.abs()));
    }
    let gain: f64 = (1..=order).map(|k| f64::from(order + k) / f64::from(k)).product();
    median(sizes) / MEDIAN_OF_NORMAL / gain.sqrt()
}

/// Time over which a channel that counts without its mean is looked at.
const COURSE_S: f64 = 0.5;

/// Standard deviation of channel `c`; with `course`, of its course over half a second.
pub fn spread(runs: &[Run], c: usize, course: bool) -> f64 {
    let (mut n, mut square) = (0.0, 0.0);
    for run in runs {
        let len = if course { ((COURSE_S / run.dt_s) as usize).max(2) } else { run.len().max(1) };
        for part in run.measured[c].chunks(len) {
            let mean = part.iter().sum::<f64>() / part.len() as f64;
            n += part.len() as f64;
            square += part.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        }
    }
    if n > 0.0 { (square / n).sqrt() } else { 0.0 }
}

/// Slow noise of the heading: what its course over a second has beyond the integral of the yaw rate, its own scale, offset and
/// drift left free, so that no error of the yaw rate is taken for noise.
pub fn heading_wander(runs: &[Run], heading: usize, yaw_rate: usize) -> f64 {
    const WINDOW_S: f64 = 1.0;
    let mut sizes = Vec::new();
    for run in runs {
        let len = ((WINDOW_S / run.dt_s) as usize).max(8);
        for from in (0..run.len().saturating_sub(len)).step_by(len) {
            let y = &run.measured[heading][from..from + len];
            let r = &run.measured[yaw_rate][from..from + len];
            let mut turned = 0.0;
            let rows: Vec<[f64; 3]> = (0..len)
                .map(|k| {
                    turned += r[k] * run.dt_s;
                    [1.0, k as f64 / len as f64 - 0.5, turned]
                })
                .collect();
            let a = nalgebra::DMatrix::from_fn(len, 3, |i, j| rows[i][j]);
            let b = nalgebra::DVector::from_column_slice(y);
            if let Ok(x) = a.clone().svd(true, true).solve(&b, 1e-9) {
                sizes.push((&a * x - b).norm_squared() / (len - 3) as f64);
            }
        }
    }
    median(sizes).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn run(signal: Vec<f64>) -> Run {
        let n = signal.len();
        Run {
            start_time_s: 0.0,
            dt_s: 0.01,
            v_x_mps: vec![1.0; n],
            steering_rad: vec![0.0; n],
            held_steering_rad: Vec::new(),
            a_x_mps2: vec![0.0; n],
            force_x_mps2: vec![0.0; n],
            recorded_a_x_mps2: vec![0.0; n],
            lap_share: vec![0.0; n],
            heading_rad: vec![0.0; n],
            place_rad: vec![0.0; n],
            smooth: [vec![0.0; n], vec![0.0; n]],
            measured: vec![signal],
            jumps: vec![false; n],
        }
    }

    #[test]
    fn white_noise_on_a_moving_signal_is_measured_and_smoothed_noise_is_not_trusted() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let noise: Vec<f64> = (0..6000).map(|_| StandardNormal.sample(&mut random)).collect();
        let motion = |k: usize| (k as f64 * 0.01 * 6.0).sin();
        let rough = [run(noise.iter().enumerate().map(|(k, n)| motion(k) + 0.02 * n).collect())];
        approx::assert_relative_eq!(sigma(&rough, 0), 0.02, max_relative = 0.05);
        assert!(is_clear(&rough, 0, WHITE_RATIO));
        // Stamps that jitter, put on an even grid: neighbours share noise, and what is left of it is measured.
        let between = |k: usize| noise[k] + (k % 7) as f64 / 10.0 * (noise[k + 1] - noise[k]);
        let even: Vec<f64> = (0..5999).map(|k| motion(k) + 0.02 * between(k)).collect();
        let left = spread(&[run((0..5999).map(|k| 0.02 * between(k)).collect())], 0, false);
        approx::assert_relative_eq!(sigma(&[run(even)], 0), left, max_relative = 0.12);
        let mean = |w: &[f64]| w.iter().sum::<f64>() / w.len() as f64;
        let filtered = [run(noise.windows(2).enumerate().map(|(k, w)| motion(k) + 0.02 * mean(w)).collect())];
        assert!(!is_clear(&filtered, 0, WHITE_RATIO));
        assert!(!is_clear(&[run((0..6000).map(motion).collect())], 0, WHITE_RATIO));
    }
}
