//! Evenly sampled stretches without gaps: what models are run on.

use crate::{SignalError, StateSequence};

/// Makes the struct of the rows on the odometry's stamps, and how it is filled.
macro_rules! segment {
    (@rows [$($done:tt)*] time_s, $clock:ident, $r:literal, $k:ident, $u:literal, $m:literal; $($rest:tt)*) => {
        segment!(@rows [$($done)*] $($rest)*);
    };
    (@rows [$($done:tt)*] $name:ident, Samples, $r:literal, $k:ident, $u:literal, $m:literal; $($rest:tt)*) => {
        segment!(@rows [$($done)* ($name, $u, $m)] $($rest)*);
    };
    (@rows [$($done:tt)*] $name:ident, $clock:ident, $r:literal, $k:ident, $u:literal, $m:literal; $($rest:tt)*) => {
        segment!(@rows [$($done)*] $($rest)*);
    };
    (@rows [$(($name:ident, $unit:literal, $meaning:literal))*]) => {
        /// A stretch of one sequence on an even grid, as float64. Optional channels are empty where not recorded.
        #[derive(Debug, Clone, PartialEq, Default)]
        pub struct Segment {
            /// Time of the first sample since the start of the sequence.
            pub start_time_s: f64,
            /// Step of the grid.
            pub dt_s: f64,
            $(#[doc = concat!("`", $unit, "`: ", $meaning)] pub $name: Vec<f64>,)*
            /// [m/s] commanded speed in force
            pub command_speed_mps: Vec<f64>,
            /// [m/s^2] commanded acceleration in force
            pub command_acceleration_mps2: Vec<f64>,
        }

        impl Segment {
            /// Puts every channel of a sequence through `even`; what was commanded has been put on its samples before.
            fn of(sequence: &StateSequence, held: &[Vec<f32>; 2], start_time_s: f64, dt_s: f64, even: &dyn Fn(&[f32]) -> Vec<f64>) -> Self {
                let [speed_mps, acceleration_mps2] = held;
                Self {
                    start_time_s,
                    dt_s,
                    $($name: even(&sequence.$name),)*
                    command_speed_mps: even(speed_mps),
                    command_acceleration_mps2: even(acceleration_mps2),
                }
            }
        }
    };
    ($($rows:tt)*) => { segment!(@rows [] $($rows)*); };
}

crate::for_each_channel!(segment);

impl Segment {
    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.v_x_mps.len()
    }

    /// Whether there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.v_x_mps.is_empty()
    }

    /// Time of sample `k` since the start of the sequence.
    #[must_use]
    pub fn time_s(&self, k: usize) -> f64 {
        self.start_time_s + k as f64 * self.dt_s
    }
}

/// A pause longer than this many median steps ends a segment.
pub(crate) const GAP_STEPS: f64 = 2.5;

/// The median time step of a sequence.
pub(crate) fn median_step_s(time_s: &[f32]) -> f64 {
    let mut steps: Vec<f64> = time_s.windows(2).map(|w| f64::from(w[1]) - f64::from(w[0])).collect();
    if steps.is_empty() {
        return 0.0;
    }
    let middle = steps.len() / 2;
    *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Splits a sequence at its gaps (a pause over 2.5 median steps) and puts each stretch on an even grid of the median step, by linear
/// interpolation (the steering too: it stands on odometry stamps already). Stretches shorter than `min_length_s` are left out.
///
/// # Errors
/// What [`StateSequence::check`] finds.
pub fn segments(sequence: &StateSequence, min_length_s: f64) -> Result<Vec<Segment>, SignalError> {
    sequence.check()?;
    // float32 seconds carry about 1e-5 s of rounding after minutes: a step is known to that.
    let dt_s = (median_step_s(&sequence.time_s) * 1e5).round() / 1e5;
    if dt_s <= 0.0 {
        return Err(SignalError::Config { name: "median time step_s", must: "at least 1e-5", got: dt_s });
    }
    let time_s = &sequence.time_s;
    let held = [&sequence.command_speed_mps, &sequence.command_acceleration_mps2]
        .map(|values| held(sequence, values));
    let mut bounds = vec![0];
    bounds.extend((1..time_s.len()).filter(|&k| f64::from(time_s[k] - time_s[k - 1]) > GAP_STEPS * dt_s));
    bounds.push(time_s.len());
    Ok(bounds
        .windows(2)
        .filter(|w| f64::from(time_s[w[1] - 1] - time_s[w[0]]) >= min_length_s && w[1] - w[0] >= 2)
        .map(|w| segment(sequence, &held, w[0], w[1], dt_s))
        .collect())
}

fn segment(sequence: &StateSequence, held: &[Vec<f32>; 2], from: usize, to: usize, dt_s: f64) -> Segment {
    let time_s = &sequence.time_s[from..to];
    let start_time_s = f64::from(time_s[0]);
    let count = ((f64::from(time_s[time_s.len() - 1]) - start_time_s) / dt_s + 1e-2).floor() as usize + 1;
    // Place of every grid point: the sample before it and the weight of the sample after it.
    let mut places = Vec::with_capacity(count);
    let mut k = 0;
    for i in 0..count {
        let t_s = start_time_s + i as f64 * dt_s;
        while k + 2 < time_s.len() && f64::from(time_s[k + 1]) <= t_s {
            k += 1;
        }
        let span_s = f64::from(time_s[k + 1]) - f64::from(time_s[k]);
        places.push((from + k, ((t_s - f64::from(time_s[k])) / span_s).clamp(0.0, 1.0)));
    }
    let even = |channel: &[f32]| -> Vec<f64> {
        if channel.is_empty() {
            return Vec::new();
        }
        places
            .iter()
            .map(|&(k, w)| {
                let (a, b) = (f64::from(channel[k]), f64::from(channel[k + 1]));
                a + (b - a) * w
            })
            .collect()
    };
    Segment::of(sequence, held, start_time_s, dt_s, &even)
}

/// A commanded quantity at every sample: the command in force, the first one before it.
fn held(sequence: &StateSequence, values: &[f32]) -> Vec<f32> {
    let stamps_s = &sequence.command_time_s;
    let at = |t_s: f32| values[stamps_s.partition_point(|&t| t <= t_s).saturating_sub(1)];
    if values.is_empty() { Vec::new() } else { sequence.time_s.iter().map(|&t| at(t)).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(times_s: &[f32]) -> StateSequence {
        let zeros = vec![0.0; times_s.len()];
        StateSequence {
            time_s: times_s.to_vec(),
            v_x_mps: times_s.iter().map(|t| 2.0 * t).collect(),
            v_y_mps: zeros.clone(),
            yaw_rate_radps: zeros.clone(),
            steering_rad: zeros,
            ..Default::default()
        }
    }

    #[test]
    fn gaps_split_and_jitter_is_evened() {
        let mut times: Vec<f32> =
            (0..100).map(|k| k as f32 * 0.01 + if k % 2 == 0 { 0.0 } else { 0.001 }).collect();
        times.extend((0..100).map(|k| 2.0 + k as f32 * 0.01));
        let parts = segments(&ramp(&times), 0.5).unwrap();
        assert_eq!(parts.len(), 2);
        for part in &parts {
            for k in 0..part.len() {
                approx::assert_abs_diff_eq!(part.v_x_mps[k], 2.0 * part.time_s(k), epsilon = 1e-5);
            }
        }
        assert!(segments(&ramp(&times), 1.5).unwrap().is_empty());
    }

    #[test]
    fn a_bad_sequence_is_refused() {
        let mut short = ramp(&[0.0, 0.01, 0.02]);
        short.v_y_mps.pop();
        assert!(matches!(segments(&short, 0.0), Err(SignalError::ChannelLength { channel: "v_y_mps", .. })));
        assert!(matches!(segments(&ramp(&[0.0, 0.01, 0.01]), 0.0), Err(SignalError::StampWentBack { .. })));
    }
}
