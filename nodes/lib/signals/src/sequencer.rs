//! From messages to sequences: the one rule that the telemetry node and the offline command follow.

use crate::{
    AlignConfig, Aligner, Layout, Measurement, NS_PER_S, Pushed, SignalError, StateSequence, WindowConfig,
    WindowCutter,
};

/// What became of the messages.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct Taken {
    /// Messages left out because their stamp lay before the one before, or far ahead of the one after; and by how much at most.
    pub out_of_order: usize,
    /// The largest step back of one of those.
    pub most_back_s: f64,
    /// Messages left out because a value was NaN or infinite.
    pub not_finite: usize,
    /// Messages left out because their stamp stood there already.
    pub duplicates: usize,
    /// Samples left out because no drive command was in force.
    pub without_drive: usize,
    /// Times that the clock was set back; what was open then was given up.
    pub clock_jumps: usize,
    /// What was wrong with the first message left out, in words.
    pub first_problem: Option<String>,
}

/// Aligns the streams and cuts windows.
#[derive(Debug, Clone)]
pub struct Sequencer {
    window: WindowConfig,
    aligner: Aligner,
    cutter: WindowCutter,
    taken: Taken,
}

impl Sequencer {
    /// # Errors
    /// As [`WindowCutter::new`].
    pub fn new(window: WindowConfig, layout: Layout) -> Result<Self, SignalError> {
        let aligner = Aligner::with_layout(AlignConfig::default(), layout).keeping();
        Ok(Self { window, aligner, cutter: WindowCutter::new(window)?, taken: Taken::default() })
    }

    /// Gives the first window out from a length on, while it grows: see [`WindowCutter::growing_from`].
    ///
    /// # Errors
    /// As [`WindowCutter::growing_from`].
    pub fn growing_from(self, first_s: f64) -> Result<Self, SignalError> {
        Ok(Self { cutter: self.cutter.growing_from(first_s)?, ..self })
    }

    /// Takes a message; gives the windows that it closes, and what is wrong with it where it was left out.
    pub fn push(&mut self, message: Measurement) -> (Vec<StateSequence>, Option<SignalError>) {
        let mut closed = Vec::new();
        let problem = match self.aligner.push(message) {
            Ok(Pushed::Taken | Pushed::Duplicate) => None,
            Ok(Pushed::ClockJumped) => {
                self.taken.clock_jumps += 1;
                // A window without an end is all there is of that clock.
                if self.window.length_s.is_infinite() {
                    closed.extend(self.cutter.rest().ok());
                }
                self.cutter.clear();
                None
            }
            Err(error) => {
                match error {
                    SignalError::StampWentBack { back_s, .. } => {
                        self.taken.out_of_order += 1;
                        self.taken.most_back_s = self.taken.most_back_s.max(back_s);
                    }
                    _ => self.taken.not_finite += 1,
                }
                self.taken.first_problem.get_or_insert_with(|| error.to_string());
                Some(error)
            }
        };
        while let Some(sample) = self.aligner.poll() {
            self.note();
            closed.extend(self.cutter.push(sample));
        }
        (closed, problem)
    }

    /// The windows that close at the end of the data, where nothing more is waited for.
    pub fn finish(&mut self) -> Vec<StateSequence> {
        let mut closed = Vec::new();
        while let Some(sample) = self.aligner.drain() {
            self.note();
            closed.extend(self.cutter.push(sample));
        }
        closed
    }

    /// The window still open.
    ///
    /// # Errors
    /// [`SignalError::TooShort`] where it holds fewer than two samples.
    pub fn rest(&self) -> Result<StateSequence, SignalError> {
        self.cutter.rest()
    }

    /// Samples in the window still open.
    #[must_use]
    pub fn buffered(&self) -> usize {
        self.cutter.buffered()
    }

    /// The aligner, for its counts.
    #[must_use]
    pub fn aligner(&self) -> &Aligner {
        &self.aligner
    }

    /// What became of the messages so far.
    #[must_use]
    pub fn taken(&self) -> Taken {
        Taken {
            out_of_order: self.taken.out_of_order + self.aligner.stray(),
            duplicates: self.aligner.duplicates(),
            without_drive: self.aligner.without_drive(),
            ..self.taken.clone()
        }
    }

    /// Hands over what came with stamps of its own.
    fn note(&mut self) {
        let kept = self.aligner.take_kept();
        kept.commands.into_iter().for_each(|command| self.cutter.push_command(command));
        kept.poses.into_iter().for_each(|pose| self.cutter.push_pose(pose));
    }
}

impl Taken {
    /// Messages left out in all.
    #[must_use]
    pub fn left_out(&self) -> usize {
        self.out_of_order + self.not_finite + self.duplicates
    }
}

/// Seconds of a stamp, for people.
#[must_use]
pub fn stamp_s(stamp_ns: i64) -> f64 {
    stamp_ns as f64 / NS_PER_S
}
