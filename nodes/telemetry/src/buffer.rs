//! What the node holds: the streams on their way to a window. No ROS, no clock.

use gripsight_signals::{Layout, Measurement, Sequencer, Signal, SignalError, StateSequence, WindowConfig};

/// Counts for the diagnostics.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Messages by stream: what carries the speed (odometry), what carries the steering (drive), inertial unit, wheels.
    pub(crate) taken: [usize; 4],
    /// Messages left out: not finite, late, or with the stamp of the one before.
    pub(crate) rejected: usize,
    /// Odometry left out because no drive command was in force.
    pub(crate) without_drive: usize,
    /// Times that the clock jumped back.
    pub(crate) clock_jumps: usize,
    /// Sequences given out.
    pub(crate) sequences: usize,
}

/// Aligns the streams and cuts windows, by the rules that the offline command follows.
pub(crate) struct Buffer {
    window: WindowConfig,
    /// The streams that the counts are of.
    streams: [usize; 4],
    sequencer: Sequencer,
    sequences: usize,
    /// What was wrong with the last message that was left out.
    pub(crate) last_problem: Option<String>,
}

impl Buffer {
    pub(crate) fn new(window: WindowConfig, layout: Layout) -> Result<Self, SignalError> {
        let steering = layout.source(Signal::Steering).or(layout.source(Signal::MeasuredSteering));
        let streams = [layout.clock(), steering.unwrap_or(1), 2, 3];
        Ok(Self {
            window,
            streams,
            sequencer: Sequencer::new(window, layout)?,
            sequences: 0,
            last_problem: None,
        })
    }

    /// Gives the first window out from a length on, while it grows; 0: not before it is full.
    pub(crate) fn growing_from(mut self, first_s: f64) -> Result<Self, SignalError> {
        if first_s > 0.0 {
            self.sequencer = self.sequencer.growing_from(first_s)?;
        }
        Ok(self)
    }

    /// Takes a message; gives the windows that it closes.
    pub(crate) fn push(&mut self, message: Measurement) -> Vec<StateSequence> {
        let jumps = self.sequencer.taken().clock_jumps;
        let (closed, problem) = self.sequencer.push(message);
        if let Some(problem) = problem {
            self.last_problem = Some(problem.to_string());
        }
        if self.sequencer.taken().clock_jumps > jumps {
            tracing::warn!("the clock jumped back: starting over");
        }
        self.sequences += closed.len();
        closed
    }

    /// Samples in the window still open, and how long it is to be.
    pub(crate) fn filling(&self) -> (usize, f64) {
        (self.sequencer.buffered(), self.window.length_s)
    }

    pub(crate) fn counts(&self) -> Counts {
        let taken = self.sequencer.taken();
        Counts {
            taken: self.streams.map(|stream| self.sequencer.aligner().count(stream)),
            rejected: taken.left_out(),
            without_drive: taken.without_drive,
            clock_jumps: taken.clock_jumps,
            sequences: self.sequences,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gripsight_signals::{DriveSample, OdometrySample};

    fn second(buffer: &mut Buffer, from_ms: i64) -> Vec<StateSequence> {
        (0..100)
            .flat_map(|k| {
                let stamp_ns = (from_ms + 10 * k) * 1_000_000;
                let mut out = buffer.push(Measurement::Drive(DriveSample { stamp_ns, ..Default::default() }));
                out.extend(buffer.push(Measurement::Odometry(OdometrySample {
                    stamp_ns,
                    v_x_mps: 1.0,
                    ..Default::default()
                })));
                out
            })
            .collect()
    }

    fn buffer() -> Buffer {
        Buffer::new(WindowConfig { length_s: 1.5, hop_s: 1.5 }, Layout::default()).unwrap()
    }

    #[test]
    fn a_clock_that_jumps_back_clears_the_window() {
        let mut buffer = buffer();
        assert!(second(&mut buffer, 10_000).is_empty());
        assert!(second(&mut buffer, 1_000).is_empty());
        let window = second(&mut buffer, 2_000).remove(0);
        assert_eq!(window.start_stamp_ns, 1_000_000_000);
        let counts = buffer.counts();
        assert_eq!((counts.clock_jumps, counts.taken[0], counts.sequences), (1, 300, 1));
    }

    #[test]
    fn a_late_or_broken_message_is_counted_and_left_out() {
        let mut buffer = buffer();
        second(&mut buffer, 10_000);
        for (stamp_ns, v_x_mps) in [(10_500_000_000, 1.0), (11_000_000_000, f64::NAN)] {
            buffer.push(Measurement::Odometry(OdometrySample { stamp_ns, v_x_mps, ..Default::default() }));
        }
        assert_eq!(second(&mut buffer, 11_000).len(), 1);
        assert_eq!((buffer.counts().rejected, buffer.counts().clock_jumps), (2, 0));
        assert!(buffer.last_problem.unwrap().contains("v_x_mps is NaN"));
    }
}
