//! What is wrong with the messages of one topic, before streams are joined.

use std::borrow::Cow;

use serde::Serialize;

use crate::segment::GAP_STEPS;

/// How regularly messages came.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Pace {
    /// One over the median step; where the stamps stand still between ticks, messages over time; zero with fewer than two messages.
    pub rate_hz: f64,
    /// Standard deviation of the steps that are no gaps.
    pub jitter_s: f64,
    /// Steps of more than 2.5 median steps.
    pub gaps: usize,
    /// The longest step.
    pub longest_step_s: f64,
    /// Share of the messages that the gaps would hold at the median step.
    pub lost_share: f64,
}

impl Pace {
    /// Looks at the steps from message to message, in s.
    #[must_use]
    pub fn of(steps_s: impl IntoIterator<Item = f64>) -> Self {
        let mut steps_s: Vec<f64> = steps_s.into_iter().collect();
        if steps_s.is_empty() {
            return Self::default();
        }
        let middle = steps_s.len() / 2;
        let step_s = *steps_s.select_nth_unstable_by(middle, f64::total_cmp).1;
        // A clock that ticks more slowly than messages come (`--use-sim-time`) gives many of them one stamp: its own ticks tell the gaps, and
        // the messages' number their rate.
        let coarse = step_s <= 0.0;
        let total_s: f64 = steps_s.iter().sum();
        let mut ticks_s: Vec<f64> = steps_s.iter().copied().filter(|&s| !coarse || s > 0.0).collect();
        let middle = ticks_s.len() / 2;
        let median_s =
            if ticks_s.is_empty() { 0.0 } else { *ticks_s.select_nth_unstable_by(middle, f64::total_cmp).1 };
        let rate_hz = match (coarse, median_s > 0.0) {
            (_, false) => 0.0,
            (true, true) => steps_s.len() as f64 / total_s,
            (false, true) => 1.0 / median_s,
        };
        let steps_s = ticks_s;
        let is_gap = |step_s: f64| step_s > GAP_STEPS * median_s;
        let regular: Vec<f64> = steps_s.iter().copied().filter(|&s| !is_gap(s)).collect();
        let gaps: Vec<f64> = steps_s.iter().copied().filter(|&s| is_gap(s)).collect();
        let mean = regular.iter().sum::<f64>() / regular.len().max(1) as f64;
        let variance = regular.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / regular.len().max(1) as f64;
        let missing = |lost: f64, step_s: &f64| lost + (step_s / median_s).round() - 1.0;
        let lost = if median_s > 0.0 { gaps.iter().fold(0.0, missing) } else { 0.0 };
        Self {
            rate_hz,
            jitter_s: variance.sqrt(),
            gaps: gaps.len(),
            longest_step_s: steps_s.iter().copied().fold(0.0, f64::max),
            lost_share: lost / (lost + steps_s.len() as f64 + 1.0),
        }
    }
}

/// Single samples of a channel that differ from both neighbours by far more than neighbours do.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spikes {
    /// Which channel, with its unit.
    pub channel: &'static str,
    /// How many.
    pub count: usize,
    /// When the first came, since the topic's first message.
    pub first_s: f64,
    /// The largest difference from the nearer neighbour, in the channel's unit.
    pub largest: f64,
}

impl Spikes {
    /// Looks at a channel's `values` at `times_s`; `None` where there is none.
    ///
    /// A spike sticks out to one side of both neighbours, from either by more than eight times what 90 % of all steps stay below and by more
    /// than a tenth of what 90 % of the values span.
    #[must_use]
    pub fn of(channel: &'static str, times_s: &[f64], values: &[f64]) -> Option<Self> {
        let found: Vec<(f64, f64)> = spikes_at(values)
            .into_iter()
            .filter_map(|(k, height)| Some((*times_s.get(k)?, height)))
            .collect();
        let &(first_s, _) = found.first()?;
        let largest = found.iter().map(|s| s.1).fold(0.0, f64::max);
        Some(Self { channel, count: found.len(), first_s: first_s - times_s[0], largest })
    }
}

/// Places of the samples that stand out, by the rule of [`Spikes::of`], and by how much.
pub(crate) fn spikes_at(values: &[f64]) -> Vec<(usize, f64)> {
    const STEPS: f64 = 8.0;
    const SPAN: f64 = 0.1;
    let steps = values.windows(2).map(|w| (w[1] - w[0]).abs());
    let (Some(usual_step), Some(low), Some(high)) = (
        quantile(steps, 0.9),
        quantile(values.iter().copied(), 0.05),
        quantile(values.iter().copied(), 0.95),
    ) else {
        return Vec::new();
    };
    let least = (STEPS * usual_step).max(SPAN * (high - low));
    let height = |w: &[f64]| {
        let (before, after) = (w[1] - w[0], w[1] - w[2]);
        if before * after > 0.0 { before.abs().min(after.abs()) } else { 0.0 }
    };
    let all = values.windows(3).enumerate().map(|(k, w)| (k + 1, height(w)));
    all.filter(|(_, height)| *height > least).collect()
}

/// The messages of a stream of telemetry.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TopicHealth {
    /// The stream: `odom`, `drive`, `imu` or `wheels`; of a topic that is read field by field its first signal.
    pub stream: &'static str,
    /// Its topic; `None` (`null`) where it is not recorded.
    pub topic: Option<String>,
    /// Type of its messages.
    #[serde(rename = "type")]
    pub type_name: Cow<'static, str>,
    /// Messages that say something.
    pub messages: usize,
    /// How regularly they were stamped.
    #[serde(flatten)]
    pub pace: Pace,
    /// Median time from the stamp to the log; negative where the stamp is later: the clocks differ. `None` without messages.
    pub delay_s: Option<f64>,
    /// Samples that stand out, by channel.
    pub spikes: Vec<Spikes>,
}

fn quantile(values: impl Iterator<Item = f64>, share: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    let place = (values.len().checked_sub(1)? as f64 * share).round() as usize;
    Some(*values.select_nth_unstable_by(place, f64::total_cmp).1)
}

impl TopicHealth {
    /// The median of delays; `None` of none.
    #[must_use]
    pub fn median_s(delays_s: impl Iterator<Item = f64>) -> Option<f64> {
        quantile(delays_s, 0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_told_from_jitter_and_counted_as_lost() {
        // 100 messages at 10 ms with every other one 1 ms late, and ten left out in one place.
        let times = (0..110)
            .filter(|k| !(50..60).contains(k))
            .map(|k| 0.01 * f64::from(k) + 0.001 * f64::from(k % 2));
        let times: Vec<f64> = times.collect();
        let pace = Pace::of(times.windows(2).map(|w| w[1] - w[0]));
        assert!((pace.jitter_s - 0.002_f64 / 2.0).abs() < 1e-5, "{pace:?}");
        assert!(pace.gaps == 1 && (pace.longest_step_s - 0.11).abs() < 0.002);
        assert!((pace.lost_share - 10.0 / 110.0).abs() < 0.015, "{pace:?}");
        assert_eq!(Pace::of([]), Pace::default());
        // 100 messages a second by a clock of 20 ticks, of which one is left out.
        let ticks = (0..1000).map(|k| 0.05 * f64::from(k / 5)).filter(|t| (t - 25.0).abs() > 1e-9);
        let ticks: Vec<f64> = ticks.collect();
        let pace = Pace::of(ticks.windows(2).map(|w| w[1] - w[0]));
        assert!((pace.rate_hz - 100.0).abs() < 1.0 && pace.gaps == 0, "{pace:?}");
        assert_eq!(Pace::of([0.0, 0.0]).rate_hz, 0.0);
    }

    #[test]
    fn a_single_sample_that_stands_out_is_a_spike_and_a_peak_or_a_step_is_none() {
        let times: Vec<f64> = (0..1000).map(|k| 0.01 * f64::from(k)).collect();
        let smooth: Vec<f64> = times.iter().map(|t| (3.0 * t).sin() + 0.01 * (700.0 * t).sin()).collect();
        assert_eq!(Spikes::of("v_y_mps", &times, &smooth), None);
        let mut steps = smooth.clone();
        steps[500..].iter_mut().for_each(|v| *v += 3.0);
        assert_eq!(Spikes::of("v_y_mps", &times, &steps), None);
        let mut spiked = smooth;
        spiked[200] += 3.0;
        spiked[700] -= 2.0;
        let found = Spikes::of("v_y_mps", &times, &spiked).unwrap();
        assert_eq!(found.count, 2);
        assert!((found.first_s - 2.0).abs() < 1e-9 && (found.largest - 3.0).abs() < 0.1, "{found:?}");
        assert_eq!(Spikes::of("v_y_mps", &[], &[]), None);
    }
}
