//! A recording as the inference sees it: stretches without gaps, cut into windows, blocks of windows, and what is held out.

use gripsight_signals::{Segment, StateSequence, segments};

use crate::commands::Commands;
use crate::{Channel, SimulatorError, speed};

/// Length of the windows that are fitted and scored.
pub const WINDOW_S: f64 = 0.5;
/// Length of a block: what is held out goes in blocks, and intervals resample blocks.
const BLOCK_S: f64 = 2.0;
/// Every so many blocks one is held out.
const HELD_OUT_EVERY: usize = 4;
/// Time at the start of a stretch that only fills what is hidden in a simulator.
const WARM_UP_S: f64 = 0.5;
/// Usable time that is needed.
const NEEDED_S: f64 = 8.0;
/// Below this nothing about tires or steering shows.
const LEAST_SPEED_MPS: f64 = 1.0;

/// A window of samples of one stretch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Which stretch.
    pub stretch: usize,
    /// First sample.
    pub from: usize,
    /// Samples.
    pub len: usize,
    /// Its block.
    pub block: usize,
    /// Whether it is only scored.
    pub held_out: bool,
}

/// A stretch of driving without gaps.
#[derive(Debug, Clone)]
pub struct Stretch {
    /// The measurements.
    pub segment: Segment,
    /// The forward speed, smoothed.
    pub v_x_mps: Vec<f64>,
    /// Its derivative.
    pub a_x_mps2: Vec<f64>,
}

/// A recording.
#[derive(Debug, Clone)]
pub struct Drive {
    /// Its stretches.
    pub stretches: Vec<Stretch>,
    /// Its commands.
    pub commands: Commands,
    /// Its windows, in the order of time.
    pub windows: Vec<Window>,
    /// Channels that are compared, with the noise of each.
    pub channels: Vec<(Channel, f64)>,
    /// Time between samples.
    pub dt_s: f64,
}

impl Drive {
    /// Prepares a recording. `wanted`: the channels that the simulator gives and that are to be compared.
    ///
    /// # Errors
    /// [`SimulatorError::Drive`] where too little can be used, or no channel of the simulator is recorded.
    pub fn new(
        sequence: &StateSequence,
        commands: Commands,
        wanted: &[Channel],
    ) -> Result<Self, SimulatorError> {
        let wrong = |text: String| SimulatorError::Drive(text);
        let parts = segments(sequence, 2.0 * WARM_UP_S + WINDOW_S).map_err(|e| wrong(e.to_string()))?;
        if commands.is_empty() {
            return Err(wrong(
                "the bag holds no drive commands: a simulator needs something to follow".to_owned(),
            ));
        }
        let speeds = {
            let runs: Vec<(&[f64], f64)> = parts.iter().map(|s| (s.v_x_mps.as_slice(), s.dt_s)).collect();
            speed::smooth(&runs)
        };
        let stretches: Vec<Stretch> = parts
            .into_iter()
            .zip(speeds)
            .map(|(segment, speeds)| {
                let (v_x_mps, a_x_mps2) = speeds.into_iter().map(|[v, a]| (v, a)).unzip();
                Stretch { segment, v_x_mps, a_x_mps2 }
            })
            .collect();
        let dt_s = stretches.first().map_or(0.01, |s| s.segment.dt_s);
        let windows = windows(&stretches, dt_s);
        let usable_s = windows.iter().map(|w| w.len as f64 * dt_s).sum::<f64>();
        if usable_s < NEEDED_S {
            return Err(wrong(format!(
                "{usable_s:.1} s of {:.1} s can be used (moving at over {LEAST_SPEED_MPS} m/s, without gaps), at least {NEEDED_S} s are needed",
                sequence.duration_s()
            )));
        }
        let mut channels = Vec::new();
        for &channel in wanted {
            let runs: Vec<&[f64]> = stretches.iter().filter_map(|s| s.channel(channel)).collect();
            let moves = runs.iter().any(|run| run.iter().any(|v| *v != run[0]));
            if moves {
                channels.push((channel, noise(&runs)));
            }
        }
        if channels.is_empty() {
            return Err(wrong("the bag records none of the channels that the simulator gives".to_owned()));
        }
        Ok(Self { stretches, commands, windows, channels, dt_s })
    }
}

impl Stretch {
    /// A recorded channel; `None` where it is not recorded.
    #[must_use]
    pub fn channel(&self, channel: Channel) -> Option<&[f64]> {
        let s = &self.segment;
        let of = match channel {
            Channel::VXMps => &s.v_x_mps,
            Channel::VYMps => &s.v_y_mps,
            Channel::YawRateRadps => &s.yaw_rate_radps,
            Channel::SteeringRad => &s.steering_rad,
            Channel::AYMps2 => &s.a_y_mps2,
        };
        (!of.is_empty()).then_some(of.as_slice())
    }
}

fn windows(stretches: &[Stretch], dt_s: f64) -> Vec<Window> {
    let samples = |t_s: f64| (t_s / dt_s).round().max(4.0) as usize;
    let (len, block_len) = (samples(WINDOW_S), samples(BLOCK_S));
    let mut out = Vec::new();
    let mut block = 0;
    for (stretch, s) in stretches.iter().enumerate() {
        let mut from = samples(WARM_UP_S);
        while from + len <= s.segment.len() {
            let to = (from + block_len).min(s.segment.len());
            let held_out = block % HELD_OUT_EVERY == HELD_OUT_EVERY - 2;
            for at in (from..).step_by(len).take_while(|at| at + len <= to) {
                if s.segment.v_x_mps[at..at + len].iter().all(|v| *v >= LEAST_SPEED_MPS) {
                    out.push(Window { stretch, from: at, len, block, held_out });
                }
            }
            block += 1;
            from = to;
        }
    }
    out
}

/// Standard deviation of a channel's noise: of differences of the order that leaves least of the motion, clipped at three of it by the
/// median, so that neither jumps nor fast turns count as noise.
fn noise(runs: &[&[f64]]) -> f64 {
    const CONSISTENT: f64 = 1.4826;
    /// Beyond so many standard deviations it is not noise, and the share of its variance that lies within.
    const CLIP: f64 = 3.0;
    const WITHIN: f64 = 0.9733;
    let mut least = f64::INFINITY;
    let mut largest: f64 = 0.0;
    for order in 2..=6_usize {
        // The variance of white noise grows by this in a difference of the order: the sum of the squares of the binomials.
        let binomials = (0..=order).scan(1.0, |c, k| {
            let now = *c;
            *c = *c * (order - k) as f64 / (k + 1) as f64;
            Some(now * now)
        });
        let growth: f64 = binomials.sum();
        let mut all: Vec<f64> = Vec::new();
        for run in runs {
            let mut d = run.to_vec();
            largest = d.iter().fold(largest, |m, v| m.max(v.abs()));
            for _ in 0..order {
                d = d.windows(2).map(|w| w[1] - w[0]).collect();
            }
            all.extend(d.into_iter().map(f64::abs));
        }
        if all.is_empty() {
            continue;
        }
        let middle = all.len() / 2;
        let median = *all.select_nth_unstable_by(middle, f64::total_cmp).1;
        // The median alone knows the noise of 20 s to 3 %, and the least of several is low by as much.
        let most = CLIP * CONSISTENT * median;
        let (sum, count) =
            all.iter().filter(|d| **d <= most).fold((0.0, 0.0), |(s, n): (f64, f64), d| (s + d * d, n + 1.0));
        least = least.min((sum / count.max(1.0) / WITHIN / growth).sqrt());
    }
    // No finer than a ten-thousandth of the channel: a simulator without noise must not be asked for more.
    least.max(1e-4 * largest).max(1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng as _;
    use rand_distr::{Distribution as _, Normal};

    #[test]
    fn noise_is_told_from_motion() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let normal = Normal::new(0.0, 0.02).unwrap();
        let run: Vec<f64> = (0..4000)
            .map(|k| {
                (0.03 * f64::from(k)).sin() + if k == 2000 { 5.0 } else { 0.0 } + normal.sample(&mut rng)
            })
            .collect();
        approx::assert_relative_eq!(noise(&[&run]), 0.02, max_relative = 0.1);
    }
}
