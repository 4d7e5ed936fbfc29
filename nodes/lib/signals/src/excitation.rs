//! How much a sequence can tell about the tires, in figures that are cheap enough to compute on every window.
//!
//! Only what no model is needed for: whether the car moved, turned and steered. What the tires' parameters can be known from it is
//! for identification to say.

use serde::Serialize;

use crate::{DataHealth, SignalError, StateSequence};

/// Figures of a sequence's excitation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Excitation {
    /// Why the sequence is not worth an identification; `None` if it is.
    pub insufficient: Option<String>,
    /// Length of the sequence.
    pub duration_s: f64,
    /// Samples in it.
    pub samples: usize,
    /// Pauses in it.
    pub gaps: usize,
    /// Mean forward speed.
    pub v_x_mean_mps: f64,
    /// Smallest and largest forward speed.
    pub v_x_range_mps: [f64; 2],
    /// Smallest and largest v_x times yaw rate, left positive.
    pub lateral_acceleration_range_mps2: [f64; 2],
    /// Smallest and largest steering angle.
    pub steering_range_rad: [f64; 2],
    /// Root mean square of the steering rate.
    pub steering_rate_rms_radps: f64,
    /// Root mean square of the lateral velocity; zero where it is not measured.
    pub v_y_rms_mps: f64,
}

/// The tires' stiffness and peak need some seconds of cornering.
const MIN_DURATION_S: f64 = 5.0;
/// A car that stands half of the time tells about the other half only.
const MIN_MOVING_SHARE: f64 = 0.5;
/// Span of lateral acceleration: at a twentieth of gravity sensor noise is as large as the tires' slip.
const MIN_LATERAL_ACCELERATION_SPAN_MPS2: f64 = 0.5;
/// Span of the steering angle.
const MIN_STEERING_SPAN_RAD: f64 = 0.005;

impl Excitation {
    /// Looks at a sequence.
    ///
    /// # Errors
    /// What [`StateSequence::check`] finds.
    pub fn of(sequence: &StateSequence) -> Result<Self, SignalError> {
        let health = DataHealth::of(sequence)?;
        let n = sequence.len() as f64;
        let lateral: Vec<f32> =
            sequence.v_x_mps.iter().zip(&sequence.yaw_rate_radps).map(|(v, w)| v * w).collect();
        let rates = sequence
            .steering_rad
            .windows(2)
            .zip(sequence.time_s.windows(2))
            .map(|(d, t)| f64::from(d[1] - d[0]) / f64::from(t[1] - t[0]));
        let mut excitation = Self {
            insufficient: None,
            duration_s: health.duration_s,
            samples: health.samples,
            gaps: health.gaps.len(),
            v_x_mean_mps: sequence.v_x_mps.iter().map(|&v| f64::from(v)).sum::<f64>() / n,
            v_x_range_mps: range(&sequence.v_x_mps),
            lateral_acceleration_range_mps2: range(&lateral),
            steering_range_rad: range(&sequence.steering_rad),
            steering_rate_rms_radps: (rates.map(|r| r * r).sum::<f64>() / (n - 1.0)).sqrt(),
            v_y_rms_mps: (sequence.v_y_mps.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>() / n).sqrt(),
        };
        excitation.insufficient = excitation.shortcoming(&health);
        Ok(excitation)
    }

    fn shortcoming(&self, health: &DataHealth) -> Option<String> {
        let span = |r: [f64; 2]| r[1] - r[0];
        // A sample stands for a step: 500 of them at 100 Hz are 5 s, though the last comes 4.99 s after the first. Half a step
        // more for jitter.
        let step_s = 1.0 / health.rate_hz;
        let covered_s = self.duration_s + step_s;
        if covered_s + step_s / 2.0 < MIN_DURATION_S {
            Some(format!("only {covered_s:.2} s of data: drive at least {MIN_DURATION_S} s"))
        } else if health.moving_share < MIN_MOVING_SHARE {
            Some(format!("the car moved in {:.0} % of the time only", 100.0 * health.moving_share))
        } else if span(self.steering_range_rad) < MIN_STEERING_SPAN_RAD {
            Some(format!(
                "the steering moved by {:.4} rad only: drive corners both ways",
                span(self.steering_range_rad)
            ))
        } else if span(self.lateral_acceleration_range_mps2) < MIN_LATERAL_ACCELERATION_SPAN_MPS2 {
            Some(format!(
                "the lateral acceleration spans {:.2} m/s2 only: corner faster or tighter",
                span(self.lateral_acceleration_range_mps2)
            ))
        } else if self.v_y_rms_mps == 0.0 {
            Some("v_y is zero throughout: the odometry does not measure it".to_owned())
        } else {
            None
        }
    }
}

fn range(values: &[f32]) -> [f64; 2] {
    values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &v| {
        [low.min(f64::from(v)), high.max(f64::from(v))]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten seconds of weaving at 4 m/s.
    fn weave() -> StateSequence {
        let time_s: Vec<f32> = (0..1000).map(|k| k as f32 * 0.01).collect();
        let wave = |scale: f32| time_s.iter().map(|t| scale * (2.0 * t).sin()).collect::<Vec<_>>();
        StateSequence {
            v_x_mps: vec![4.0; 1000],
            v_y_mps: wave(0.1),
            yaw_rate_radps: wave(1.0),
            steering_rad: wave(0.1),
            time_s,
            ..Default::default()
        }
    }

    #[test]
    fn weaving_is_enough_and_its_figures_are_right() {
        let e = Excitation::of(&weave()).unwrap();
        assert_eq!(e.insufficient, None);
        approx::assert_abs_diff_eq!(e.lateral_acceleration_range_mps2[1], 4.0, epsilon = 0.01);
        approx::assert_abs_diff_eq!(e.steering_rate_rms_radps, 0.2 / 2_f64.sqrt(), epsilon = 0.01);
        approx::assert_abs_diff_eq!(e.v_y_rms_mps, 0.1 / 2_f64.sqrt(), epsilon = 0.01);
    }

    #[test]
    fn a_window_of_five_seconds_is_five_seconds_long() {
        let of = |samples: usize| {
            let mut sequence = weave();
            for channel in [
                &mut sequence.time_s,
                &mut sequence.v_x_mps,
                &mut sequence.v_y_mps,
                &mut sequence.yaw_rate_radps,
                &mut sequence.steering_rad,
            ] {
                channel.truncate(samples);
            }
            Excitation::of(&sequence).unwrap().insufficient
        };
        assert_eq!(of(500), None);
        assert!(of(498).unwrap().starts_with("only 4.98 s of data"));
        assert!(of(480).unwrap().starts_with("only 4.80 s of data"));
    }

    #[test]
    fn what_is_missing_is_said() {
        let because = |change: &dyn Fn(&mut StateSequence)| {
            let mut sequence = weave();
            change(&mut sequence);
            Excitation::of(&sequence).unwrap().insufficient.unwrap()
        };
        assert!(because(&|s| s.v_x_mps.fill(0.0)).contains("moved in 0 %"));
        assert!(because(&|s| s.steering_rad.fill(0.1)).contains("steering"));
        assert!(because(&|s| s.yaw_rate_radps.fill(0.1)).contains("lateral acceleration"));
        assert!(because(&|s| s.v_y_mps.fill(0.0)).contains("v_y"));
    }
}
