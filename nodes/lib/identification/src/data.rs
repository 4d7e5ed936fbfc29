//! Telemetry made ready for fitting: checked, cut into windows, and split into parts for fitting, choosing and judging.

use gripsight_model::{Window, tile};
use gripsight_signals::{DataHealth, Segment, segments};
use gripsight_vehicle::VehicleParameters;

use crate::{Doubt, IdentificationError, Usable};

/// What a window is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// Parameters and weights are fitted to it.
    Training,
    /// Choices are made on it: when training stops, which of two sets is better.
    Validation,
    /// Nothing but the final judgement touches it.
    Test,
}

/// Telemetry of a run.
#[derive(Debug, Clone)]
pub(crate) struct Data {
    pub(crate) health: DataHealth,
    pub(crate) segments: Vec<Segment>,
    pub(crate) dt_s: f64,
    /// Stretches in which the car moves all the time.
    pub(crate) stretches: Vec<Window>,
    /// Windows that tile the stretches, and the part of each.
    pub(crate) windows: Vec<(Window, Part)>,
    pub(crate) mean_speed_mps: f64,
    /// Forward acceleration of the centre of gravity at every sample of every segment, smoothed, m/s2.
    pub(crate) a_x_mps2: Vec<Vec<f64>>,
    /// Noise of v_y and yaw rate, from what neither car nor tire does that fast.
    pub(crate) noise: [f64; 2],
    /// How far the signals may be off by what nothing checks.
    pub(crate) doubt: Doubt,
}

/// Length of a window: several time constants of any car's lateral motion at speed.
pub(crate) const WINDOW_S: f64 = 0.6;
/// A window holds at least this many samples.
const WINDOW_SAMPLES: usize = 12;
/// Windows of one part lie together for this long, so that parts are not neighbours in everything.
const BLOCK_S: f64 = 1.8;
/// Parts of six blocks in a row.
const PATTERN: [Part; 6] =
    [Part::Training, Part::Training, Part::Validation, Part::Training, Part::Training, Part::Test];
/// Slowest speed that counts, as a share of the median speed; slip angles mean little below.
const SLOW_SHARE: f64 = 0.25;
/// Slowest speed that counts in any case.
pub(crate) const SLOW_MPS: f64 = 0.5;
/// Half the length of the lines that give the derivative of v_x.
const SLOPE_HALF_S: f64 = 0.1;
/// Fewest windows to fit anything to.
pub(crate) const MIN_WINDOWS: usize = 12;

impl Data {
    /// # Errors
    /// Telemetry that is malformed, too short, or of a car that stands.
    pub(crate) fn new(
        usable: &Usable,
        vehicle: &VehicleParameters,
        health: &DataHealth,
        min_windows: usize,
    ) -> Result<Self, IdentificationError> {
        vehicle.clone().checked()?;
        let sequence = &usable.sequence;
        let segments = segments(sequence, WINDOW_S)?;
        let dt_s = segments.first().map_or(f64::NAN, |s| s.dt_s);
        let len = ((WINDOW_S / dt_s).round() as usize).max(WINDOW_SAMPLES);
        let mut speeds: Vec<f64> =
            segments.iter().flat_map(|s| &s.v_x_mps).copied().filter(|&v| v > SLOW_MPS).collect();
        let slow_mps = SLOW_MPS.max(SLOW_SHARE * median(&mut speeds).unwrap_or(0.0));
        let stretches = moving_stretches(&segments, slow_mps, len);
        let windows: Vec<Window> = stretches
            .iter()
            .flat_map(|s| {
                tile(&[s.len], len).into_iter().map(|w| Window {
                    segment: s.segment,
                    from: s.from + w.from,
                    ..w
                })
            })
            .collect();
        if windows.len() < min_windows {
            return Err(IdentificationError::TooLittle {
                what: "driving time in s without stops and gaps",
                got: windows.len() as f64 * len as f64 * dt_s,
                needed: min_windows as f64 * len as f64 * dt_s,
                drive: "drive some laps without stopping",
            });
        }
        let a_x_mps2 = segments.iter().map(forward_acceleration).collect();
        // An estimated v_y is smoother than it is known.
        let noise = [
            noise_of(&segments, |s| &s.v_y_mps).max(usable.v_y_sigma_mps()),
            noise_of(&segments, |s| &s.yaw_rate_radps),
        ];
        let mut data = Self {
            health: health.clone(),
            segments,
            dt_s,
            stretches,
            windows: Vec::new(),
            mean_speed_mps: f64::NAN,
            a_x_mps2,
            noise,
            doubt: usable.recorded.doubt,
        };
        data.share_out(&windows, usize::MAX);
        Ok(data)
    }

    /// The same with the other sign of v_y.
    pub(crate) fn with_v_y_turned(&self) -> Self {
        let mut turned = self.clone();
        for segment in &mut turned.segments {
            segment.v_y_mps.iter_mut().for_each(|v_y| *v_y = -*v_y);
        }
        turned.a_x_mps2 = turned.segments.iter().map(forward_acceleration).collect();
        turned
    }

    /// Leaves out what lies before a time, but for the shortest drive that can be fitted. The rest is shared out so that every part gets some.
    pub(crate) fn leave_out_before(&mut self, time_s: f64) {
        let begin_s = |w: &Window| {
            let segment = &self.segments[w.segment];
            segment.start_time_s + w.from as f64 * segment.dt_s
        };
        let after = self.windows.iter().filter(|(w, _)| begin_s(w) >= time_s - 1e-6).count().max(MIN_WINDOWS);
        let windows: Vec<Window> = self.windows.iter().map(|(w, _)| *w).collect();
        let windows = &windows[windows.len().saturating_sub(after)..];
        self.share_out(windows, windows.len() / PATTERN.len());
    }

    /// Gives the windows their parts, in blocks of at most so many.
    fn share_out(&mut self, windows: &[Window], most_per_block: usize) {
        let len_s = windows.first().map_or(WINDOW_S, |w| w.len as f64 * self.dt_s);
        let per_block = (BLOCK_S / len_s).round() as usize;
        let per_block = per_block.min(most_per_block).max(1);
        let part = |i: usize| PATTERN[i / per_block % PATTERN.len()];
        self.windows = windows.iter().enumerate().map(|(i, w)| (*w, part(i))).collect();
        let speeds: Vec<f64> = self.samples(|s, k| s.v_x_mps[k]).collect();
        self.mean_speed_mps = speeds.iter().sum::<f64>() / speeds.len() as f64;
    }

    /// Whether there is a heading, which tells the yaw rate's bias.
    pub(crate) fn has_heading(&self) -> bool {
        self.segments.iter().all(|s| !s.yaw_rad.is_empty())
    }

    /// Windows of one part.
    pub(crate) fn part(&self, part: Part) -> Vec<Window> {
        self.windows.iter().filter(|(_, p)| *p == part).map(|(w, _)| *w).collect()
    }

    /// Samples of a channel over all windows.
    pub(crate) fn samples<'a>(
        &'a self,
        channel: impl Fn(&'a Segment, usize) -> f64 + 'a,
    ) -> impl Iterator<Item = f64> + 'a {
        self.windows.iter().flat_map(move |(w, _)| {
            let segment = &self.segments[w.segment];
            let values: Vec<f64> = (w.from..w.from + w.len).map(|k| channel(segment, k)).collect();
            values
        })
    }
}

/// Stretches of at least `min_len` samples above a speed.
fn moving_stretches(segments: &[Segment], slow_mps: f64, min_len: usize) -> Vec<Window> {
    let mut stretches = Vec::new();
    for (segment, s) in segments.iter().enumerate() {
        let mut from = 0;
        for k in 0..=s.len() {
            if k == s.len() || s.v_x_mps[k] <= slow_mps {
                if k - from >= min_len {
                    stretches.push(Window { segment, from, len: k - from });
                }
                from = k + 1;
            }
        }
    }
    stretches
}

/// dv_x/dt - v_y w, the derivative as the slope of a line through a fifth of a second.
fn forward_acceleration(s: &Segment) -> Vec<f64> {
    let half = (SLOPE_HALF_S / s.dt_s).round().max(1.0) as usize;
    (0..s.len())
        .map(|k| {
            let half = half.min(k).min(s.len() - 1 - k).max(1);
            let (from, to) = (k.saturating_sub(half), (k + half).min(s.len() - 1));
            let middle = 0.5 * (from + to) as f64;
            let (mut up, mut down) = (0.0, 0.0);
            for i in from..=to {
                let t = i as f64 - middle;
                up += t * s.v_x_mps[i];
                down += t * t;
            }
            up / (down * s.dt_s) - s.v_y_mps[k] * s.yaw_rate_radps[k]
        })
        .collect()
}

/// Standard deviation of white noise on a channel, from its third differences (robust: by their median).
fn noise_of<'a>(segments: &'a [Segment], channel: impl Fn(&'a Segment) -> &'a Vec<f64>) -> f64 {
    let mut differences: Vec<f64> = segments
        .iter()
        .flat_map(|s| channel(s).windows(4).map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs()))
        .collect();
    // Var of a third difference of white noise is 20 times its own; the median of |x| is 0.6745 sigma.
    median(&mut differences).unwrap_or(0.0) / 0.6745 / 20_f64.sqrt()
}

/// The median; `None` of nothing.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    quantile(values, 0.5)
}

/// A quantile by the nearest rank; `None` of nothing.
pub(crate) fn quantile(values: &mut [f64], share: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    let at = (share * last as f64).round() as usize;
    Some(*values.select_nth_unstable_by(at.min(last), f64::total_cmp).1)
}
