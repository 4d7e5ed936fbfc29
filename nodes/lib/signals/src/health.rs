//! What is wrong with the data, before anything is concluded from them.

use serde::Serialize;

use crate::channels::Kind;
use crate::{Pace, SignalError, StateSequence, segment};

/// A pause in the samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gap {
    /// Last sample before it, since the start of the sequence.
    pub from_s: f64,
    /// First sample after it.
    pub to_s: f64,
}

/// A sensor that reported the very same values while the car was moving.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrozenSpan {
    /// Which channel.
    pub channel: &'static str,
    /// Since the start of the sequence.
    pub from_s: f64,
    /// Since the start of the sequence.
    pub to_s: f64,
}

/// Figures about a sequence's samples.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DataHealth {
    /// Samples in the sequence.
    pub samples: usize,
    /// From the first to the last.
    pub duration_s: f64,
    /// One over the median step.
    pub rate_hz: f64,
    /// Standard deviation of the steps that are no gaps.
    pub jitter_s: f64,
    /// Pauses over 2.5 median steps.
    pub gaps: Vec<Gap>,
    /// Channels that stood still for over half a second at speed.
    pub frozen: Vec<FrozenSpan>,
    /// Share of the time in which the car moved (over 0.3 m/s).
    pub moving_share: f64,
    /// Channels that are there, stamps left out: optional ones that were recorded, and those of every sequence that are not zero throughout.
    pub recorded: Vec<&'static str>,
}

/// A real sensor does not repeat itself to the last digit for this long.
const FROZEN_S: f64 = 0.5;
/// Below this the car stands, and a sensor may well repeat itself.
pub(crate) const MOVING_MPS: f32 = 0.3;

impl DataHealth {
    /// Looks at a sequence.
    ///
    /// # Errors
    /// What [`StateSequence::check`] finds.
    pub fn of(sequence: &StateSequence) -> Result<Self, SignalError> {
        sequence.check()?;
        let time_s = &sequence.time_s;
        let dt_s = segment::median_step_s(time_s);
        let steps = time_s.windows(2).map(|w| (f64::from(w[0]), f64::from(w[1])));
        let pace = Pace::of(steps.clone().map(|(a, b)| b - a));
        let is_gap = |from_s: f64, to_s: f64| to_s - from_s > segment::GAP_STEPS * dt_s;
        let gaps = steps.filter(|&(a, b)| is_gap(a, b)).map(|(from_s, to_s)| Gap { from_s, to_s }).collect();
        let moving = sequence.v_x_mps.iter().filter(|v| v.abs() > MOVING_MPS).count();
        Ok(Self {
            samples: sequence.len(),
            duration_s: sequence.duration_s(),
            rate_hz: pace.rate_hz,
            jitter_s: pace.jitter_s,
            gaps,
            frozen: frozen(sequence),
            moving_share: moving as f64 / sequence.len() as f64,
            recorded: sequence
                .table()
                .into_iter()
                .filter(|(channel, values)| {
                    let is_there =
                        if channel.required { values.iter().any(|&v| v != 0.0) } else { !values.is_empty() };
                    channel.kind != Kind::Time && is_there
                })
                .map(|(channel, _)| channel.name)
                .collect(),
        })
    }
}

fn frozen(sequence: &StateSequence) -> Vec<FrozenSpan> {
    let measured = ["v_x_mps", "v_y_mps", "yaw_rate_radps", "x_m", "a_y_mps2", "gyro_yaw_rate_radps"];
    let mut spans = Vec::new();
    for (channel, values) in sequence.channels() {
        // A channel that is constant throughout is not measured at all; what that means is for the user of it to say.
        let constant = values.iter().all(|v| Some(v) == values.first());
        if !measured.contains(&channel) || values.is_empty() || constant {
            continue;
        }
        let wide: Vec<f64> = values.iter().map(|&v| f64::from(v)).collect();
        let time_s: Vec<f64> = sequence.time_s.iter().map(|&t| f64::from(t)).collect();
        for (from, to) in still_spans(&time_s, &wide, |k| sequence.v_x_mps[k].abs() > MOVING_MPS) {
            spans.push(FrozenSpan { channel, from_s: time_s[from], to_s: time_s[to] });
        }
    }
    spans
}

/// Whether a channel says nothing of a motion: in most of the half of the samples with the most steering it repeats one value for over half a second.
/// A sensor's dead band, or a simulator's constant speed, does so on the straights alone.
#[must_use]
pub fn stands_still(sequence: &StateSequence, values: &[f32]) -> bool {
    const MOST: f64 = 0.5;
    if values.len() != sequence.len() || values.is_empty() {
        return true;
    }
    let mut sorted = sequence.steering_rad.clone();
    let middle = sorted.len() / 2;
    let straight = *sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
    let mut sizes: Vec<f32> = sequence.steering_rad.iter().map(|d| (d - straight).abs()).collect();
    let usual = *sizes.clone().select_nth_unstable_by(middle, f32::total_cmp).1;
    sizes.iter_mut().for_each(|size| *size -= usual);
    let wide: Vec<f64> = values.iter().map(|&v| f64::from(v)).collect();
    let time_s: Vec<f64> = sequence.time_s.iter().map(|&t| f64::from(t)).collect();
    let mut still = vec![false; values.len()];
    still_spans(&time_s, &wide, |_| true).into_iter().for_each(|(from, to)| still[from..=to].fill(true));
    let turning: Vec<bool> =
        sizes.iter().zip(&still).filter(|(size, _)| **size >= 0.0).map(|(_, &still)| still).collect();
    turning.iter().filter(|still| **still).count() as f64 > MOST * turning.len() as f64
}

/// First and last sample of every stretch over which a channel repeats itself for over half a second while `moving`.
pub(crate) fn still_spans(
    time_s: &[f64],
    values: &[f64],
    moving: impl Fn(usize) -> bool,
) -> Vec<(usize, usize)> {
    let mut spans = Vec::new();
    let mut start = 0;
    for k in 1..=values.len() {
        if k < values.len() && values[k] == values[start] && moving(k) {
            continue;
        }
        if time_s[k - 1] - time_s[start] > FROZEN_S {
            spans.push((start, k - 1));
        }
        start = k.min(values.len() - 1);
    }
    spans
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_jitter_and_frozen_channels_are_found() {
        let mut time_s: Vec<f32> = (0..300).map(|k| k as f32 * 0.01).collect();
        time_s.extend((0..300).map(|k| 4.0 + k as f32 * 0.01));
        let wave = |f: f32| time_s.iter().map(|t| (f * t).sin()).collect::<Vec<_>>();
        let mut v_y_mps = wave(3.0);
        let stuck = v_y_mps[100];
        v_y_mps[100..180].fill(stuck);
        let sequence = StateSequence {
            v_x_mps: time_s.iter().map(|t| 5.0 + 0.1 * t).collect(),
            yaw_rate_radps: wave(2.0),
            steering_rad: wave(1.0),
            v_y_mps,
            time_s: time_s.clone(),
            ..Default::default()
        };
        let health = DataHealth::of(&sequence).unwrap();
        assert_eq!(health.gaps.len(), 1);
        approx::assert_relative_eq!(health.rate_hz, 100.0, max_relative = 1e-3);
        assert_eq!(health.frozen.len(), 1);
        assert_eq!(health.frozen[0].channel, "v_y_mps");
        approx::assert_abs_diff_eq!(health.frozen[0].from_s, 1.0, epsilon = 1e-3);
        assert_eq!(health.moving_share, 1.0);
    }

    #[test]
    fn what_repeats_itself_in_corners_stands_still_and_a_dead_band_does_not() {
        let time_s: Vec<f32> = (0..2000).map(|k| k as f32 * 0.01).collect();
        let steering: Vec<f32> = time_s.iter().map(|t| 0.2 * (0.8 * t).sin()).collect();
        let sequence = StateSequence {
            v_x_mps: vec![5.0; 2000],
            yaw_rate_radps: steering.iter().map(|d| if d.abs() < 0.1 { 0.0 } else { 10.0 * d }).collect(),
            v_y_mps: vec![0.3; 2000],
            steering_rad: steering,
            time_s,
            ..Default::default()
        };
        assert!(stands_still(&sequence, &sequence.v_y_mps));
        assert!(!stands_still(&sequence, &sequence.yaw_rate_radps));
        assert!(stands_still(&sequence, &[]));
    }
}
