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
            /// `rad`: commanded steering angle, its mean from the sample to the next
            pub command_steering_rad: Vec<f64>,
            /// `m/s`: commanded speed, its mean from the sample to the next
            pub command_speed_mps: Vec<f64>,
            /// `m/s^2`: commanded acceleration, its mean from the sample to the next
            pub command_acceleration_mps2: Vec<f64>,
        }

        impl Segment {
            /// Puts every channel of a sequence through `even`, what was commanded through `held`.
            fn of(
                sequence: &StateSequence,
                start_time_s: f64,
                dt_s: f64,
                even: &dyn Fn(&[f32]) -> Vec<f64>,
                held: &dyn Fn(&[f32]) -> Vec<f64>,
            ) -> Self {
                Self {
                    start_time_s,
                    dt_s,
                    $($name: even(&sequence.$name),)*
                    command_steering_rad: held(&sequence.command_steering_rad),
                    command_speed_mps: held(&sequence.command_speed_mps),
                    command_acceleration_mps2: held(&sequence.command_acceleration_mps2),
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
/// interpolation (the steering too: it stands on odometry stamps already). A command stays what it was from its stamp to the next one's and is
/// averaged over each step. Stretches shorter than `min_length_s` are left out.
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
    let mut bounds = vec![0];
    bounds.extend((1..time_s.len()).filter(|&k| f64::from(time_s[k] - time_s[k - 1]) > GAP_STEPS * dt_s));
    bounds.push(time_s.len());
    Ok(bounds
        .windows(2)
        .filter(|w| f64::from(time_s[w[1] - 1] - time_s[w[0]]) >= min_length_s && w[1] - w[0] >= 2)
        .map(|w| segment(sequence, w[0], w[1], dt_s))
        .collect())
}

fn segment(sequence: &StateSequence, from: usize, to: usize, dt_s: f64) -> Segment {
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
    let held = |values: &[f32]| held(&sequence.command_time_s, values, start_time_s, dt_s, count);
    Segment::of(sequence, start_time_s, dt_s, &even, &held)
}

/// A commanded quantity from every sample to the next, on average: each command holds from its stamp to the next one's, the first one before it, too.
fn held(stamps_s: &[f32], values: &[f32], start_time_s: f64, dt_s: f64, count: usize) -> Vec<f64> {
    if values.is_empty() {
        return Vec::new();
    }
    // float32 seconds: stamps that were one may come out as two, this far apart.
    let same_by = |time_s: f64| time_s + 2e-5 + time_s.abs() * f64::from(f32::EPSILON);
    let stamp_s = |k: usize| stamps_s.get(k).map_or(f64::INFINITY, |&t| f64::from(t));
    let mut k = 0;
    let mean = |i: usize| {
        let (from_s, to_s) = (start_time_s + i as f64 * dt_s, start_time_s + (i + 1) as f64 * dt_s);
        while stamp_s(k + 1) <= same_by(from_s) {
            k += 1;
        }
        // To the last bit the command itself where one holds throughout.
        let mut mean = f64::from(values[k]);
        while same_by(stamp_s(k + 1)) < to_s {
            k += 1;
            let change = f64::from(values[k]) - f64::from(values[k - 1]);
            mean += change * ((to_s - stamp_s(k)) / dt_s).min(1.0);
        }
        mean
    };
    (0..count).map(mean).collect()
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
    fn a_command_holds_from_its_own_stamp() {
        let times: Vec<f32> = (0..100).map(|k| k as f32 * 0.01).collect();
        let mut sequence = ramp(&times);
        // Before the first command, its value; then a jump a quarter of a step after a sample.
        sequence.command_time_s = vec![0.105, 0.5025];
        sequence.command_acceleration_mps2 = vec![1.0, -3.0];
        sequence.command_speed_mps = vec![0.0, 0.0];
        sequence.command_steering_rad = vec![0.1, 0.2];
        let part = &segments(&sequence, 0.5).unwrap()[0];
        for (k, &found) in part.command_acceleration_mps2.iter().enumerate() {
            let expected = match k {
                0..50 => 1.0,
                50 => 0.25 - 3.0 * 0.75,
                _ => -3.0,
            };
            approx::assert_abs_diff_eq!(found, expected, epsilon = 1e-4);
        }
        let steering = &part.command_steering_rad;
        assert!((0..50).all(|k| steering[k] == f64::from(0.1_f32)), "{steering:?}");
        assert!((51..100).all(|k| steering[k] == f64::from(0.2_f32)), "{steering:?}");
    }

    #[test]
    fn a_bad_sequence_is_refused() {
        let mut short = ramp(&[0.0, 0.01, 0.02]);
        short.v_y_mps.pop();
        assert!(matches!(segments(&short, 0.0), Err(SignalError::ChannelLength { channel: "v_y_mps", .. })));
        assert!(matches!(segments(&ramp(&[0.0, 0.01, 0.01]), 0.0), Err(SignalError::StampWentBack { .. })));
    }
}
