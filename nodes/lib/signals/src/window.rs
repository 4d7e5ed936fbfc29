//! Cuts aligned telemetry into sequences, by stamps.

use std::collections::VecDeque;

use crate::sequence::HISTORY_S;
use crate::{DriveSample, NS_PER_S, PoseSample, SignalError, StateSequence, TelemetrySample};

/// How windows are cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindowConfig {
    /// Length of a window; infinite: one window to the end of the data.
    pub length_s: f64,
    /// From the start of a window to the start of the next.
    pub hop_s: f64,
}

impl Default for WindowConfig {
    /// The paper collects 30 s of telemetry.
    fn default() -> Self {
        Self { length_s: 30.0, hop_s: 30.0 }
    }
}

/// Buffers samples and gives out a [`StateSequence`] whenever a window is full.
///
/// A window runs from its first sample up to, not including, the first sample at least `length_s` later; the next one starts
/// at the first sample at least `hop_s` after the start of this one.
///
/// [`Self::growing_from`] gives the first window out early, too: when it is so long, and again a quarter longer each time until it is full. Such
/// a sequence has a number of its own, see [`StateSequence::grows`].
#[derive(Debug, Clone)]
pub struct WindowCutter {
    config: WindowConfig,
    growth: Option<Growth>,
    buffer: Vec<TelemetrySample>,
    commands: VecDeque<DriveSample>,
    poses: VecDeque<PoseSample>,
}

/// How the first window grows.
#[derive(Debug, Clone, Copy)]
struct Growth {
    first_s: f64,
    /// Early windows given out; `None` after the first full one.
    given: Option<u32>,
}

/// An early window over the one before: what a tenth of the data more tells does not pay for another run, and early on seconds count.
const GROWS_BY: f64 = 1.25;

impl Growth {
    /// Whether an early window is due at a length, where a full one has `length_s`.
    fn is_due(&self, elapsed_s: f64, length_s: f64) -> bool {
        let due_s = self.given.map(|given| self.first_s * GROWS_BY.powi(given as i32));
        // One that is nearly full is not worth a run of its own.
        due_s.is_some_and(|due_s| elapsed_s >= due_s && due_s * GROWS_BY.sqrt() <= length_s)
    }
}

impl WindowCutter {
    /// # Errors
    /// [`SignalError::Config`] where a length is not positive, or the hop is longer than the window.
    pub fn new(config: WindowConfig) -> Result<Self, SignalError> {
        if config.length_s.is_nan() || config.length_s <= 0.0 {
            return Err(SignalError::Config { name: "length_s", must: "positive", got: config.length_s });
        }
        if config.hop_s.is_nan() || config.hop_s <= 0.0 || config.hop_s > config.length_s {
            return Err(SignalError::Config {
                name: "hop_s",
                must: "positive and at most length_s",
                got: config.hop_s,
            });
        }
        let (buffer, commands, poses) = (Vec::new(), VecDeque::new(), VecDeque::new());
        Ok(Self { config, growth: None, buffer, commands, poses })
    }

    /// Gives the first window out from a length on, while it grows.
    ///
    /// # Errors
    /// [`SignalError::Config`] where the length is not positive.
    pub fn growing_from(mut self, first_s: f64) -> Result<Self, SignalError> {
        if first_s.is_nan() || first_s <= 0.0 {
            return Err(SignalError::Config { name: "first_s", must: "positive", got: first_s });
        }
        self.growth = Some(Growth { first_s, given: Some(0) });
        Ok(self)
    }

    /// Takes a sample; gives the window that it closes.
    pub fn push(&mut self, sample: TelemetrySample) -> Option<StateSequence> {
        let length_s = self.buffer.first().map_or(0.0, |first| elapsed_s(first, &sample));
        let full = length_s >= self.config.length_s;
        let closed = if full { self.rest().ok() } else { self.early(length_s) };
        if full {
            self.growth.iter_mut().for_each(|growth| growth.given = None);
            let start = self.buffer[0];
            self.buffer.retain(|s| elapsed_s(&start, s) >= self.config.hop_s);
        }
        self.buffer.push(sample);
        let from_ns = self.buffer[0].odometry.stamp_ns.saturating_sub((HISTORY_S * NS_PER_S) as i64);
        drop_before(&mut self.commands, |c| c.stamp_ns < from_ns);
        drop_before(&mut self.poses, |p| p.stamp_ns < from_ns);
        closed
    }

    /// The first window while it grows, where one is due.
    fn early(&mut self, so_far_s: f64) -> Option<StateSequence> {
        let growth = self.growth.as_mut().filter(|g| g.is_due(so_far_s, self.config.length_s))?;
        let given = growth.given.unwrap_or(0) + 1;
        growth.given = Some(given);
        let mut sequence = self.rest().ok()?;
        sequence.sequence_id += u64::from(given);
        Some(sequence)
    }

    /// Takes a command as it was received; before the samples that it holds for. Without any, the commands are those that the samples have.
    pub fn push_command(&mut self, command: DriveSample) {
        self.commands.push_back(command);
    }

    /// Takes a pose with a stamp of its own; before the first sample after it.
    pub fn push_pose(&mut self, pose: PoseSample) {
        self.poses.push_back(pose);
    }

    /// The window still open.
    ///
    /// # Errors
    /// [`SignalError::TooShort`] where it holds fewer than two samples.
    pub fn rest(&self) -> Result<StateSequence, SignalError> {
        if self.commands.is_empty() && self.poses.is_empty() {
            return StateSequence::from_samples(&self.buffer);
        }
        let commands: Vec<DriveSample> = self.commands.iter().copied().collect();
        let poses: Vec<PoseSample> = self.poses.iter().copied().collect();
        StateSequence::from_parts(&self.buffer, &commands, &poses)
    }

    /// Samples in the window still open.
    #[must_use]
    pub fn buffered(&self) -> usize {
        self.buffer.len()
    }

    /// Forgets everything: after the clock jumped back, nothing old may be mixed with what comes.
    pub fn clear(&mut self) {
        self.buffer.clear();
        self.commands.clear();
        self.poses.clear();
        self.growth.iter_mut().for_each(|growth| growth.given = Some(0));
    }
}

fn drop_before<T>(queue: &mut VecDeque<T>, is_old: impl Fn(&T) -> bool) {
    while queue.front().is_some_and(&is_old) {
        queue.pop_front();
    }
}

fn elapsed_s(from: &TelemetrySample, to: &TelemetrySample) -> f64 {
    (to.odometry.stamp_ns - from.odometry.stamp_ns) as f64 / NS_PER_S
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::OdometrySample;

    fn sample(t_ms: i64) -> TelemetrySample {
        TelemetrySample {
            odometry: OdometrySample { stamp_ns: t_ms * 1_000_000, ..Default::default() },
            ..Default::default()
        }
    }

    #[test]
    fn windows_overlap_by_length_less_hop() {
        let mut cutter = WindowCutter::new(WindowConfig { length_s: 1.0, hop_s: 0.4 }).unwrap();
        let windows: Vec<_> = (0..300).filter_map(|k| cutter.push(sample(10 * k))).collect();
        let starts: Vec<_> = windows.iter().map(|w| w.start_stamp_ns / 1_000_000).collect();
        assert_eq!(starts, [0, 400, 800, 1200, 1600]);
        assert!(windows.iter().all(|w| w.len() == 100));
    }

    #[test]
    fn the_first_window_grows_and_each_has_its_number() {
        let window = WindowConfig { length_s: 30.0, hop_s: 10.0 };
        let mut cutter = WindowCutter::new(window).unwrap().growing_from(8.0).unwrap();
        let mut feed =
            |from: i64| (from..from + 4200).filter_map(|k| cutter.push(sample(10 * k))).collect::<Vec<_>>();
        let windows = feed(0);
        let lengths: Vec<_> = windows.iter().map(StateSequence::len).collect();
        assert_eq!(lengths, [800, 1000, 1250, 1563, 1954, 2442, 3000, 3000]);
        let numbers: Vec<_> = windows.iter().map(|w| w.sequence_id).collect();
        assert_eq!(numbers, [1, 2, 3, 4, 5, 6, 0, 10_000_000_000]);
        assert_eq!(windows.iter().filter(|w| w.grows()).count(), 6);
        cutter.clear();
        assert_eq!(cutter.push(sample(90_000)).map(|w| w.len()), None);
        assert_eq!((0..801).filter_map(|k| cutter.push(sample(90_010 + 10 * k))).count(), 1);
        assert!(WindowCutter::new(window).unwrap().growing_from(0.0).is_err());
    }

    #[test]
    fn an_infinite_window_is_cut_at_the_end() {
        let mut cutter =
            WindowCutter::new(WindowConfig { length_s: f64::INFINITY, hop_s: f64::INFINITY }).unwrap();
        assert!((0..500).all(|k| cutter.push(sample(10 * k)).is_none()));
        assert_eq!(cutter.rest().unwrap().len(), 500);
    }

    #[test]
    fn lengths_are_checked() {
        for (length_s, hop_s) in [(0.0, 1.0), (f64::NAN, 1.0), (1.0, 2.0), (1.0, 0.0)] {
            assert!(WindowCutter::new(WindowConfig { length_s, hop_s }).is_err());
        }
    }
}
