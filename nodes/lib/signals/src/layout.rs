//! Which stream carries which signal.

use crate::Signal;
use crate::measurement::TYPED_STREAMS;

/// The stream of every signal, by [`crate::Measurement::stream_index`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    sources: [Option<usize>; Signal::ALL.len()],
}

impl Default for Layout {
    /// Odometry, drive commands, inertial unit and wheels, as their message types carry them.
    fn default() -> Self {
        let mut layout = Self { sources: [None; Signal::ALL.len()] };
        layout.set(0, &[Signal::ForwardSpeed, Signal::LateralSpeed, Signal::YawRate]);
        layout.set(0, &Signal::POSE);
        layout.set(1, &[Signal::Steering, Signal::SpeedCommand, Signal::AccelerationCommand]);
        layout.set(2, &[Signal::ForwardAcceleration, Signal::LateralAcceleration, Signal::Gyro]);
        layout.set(3, &Signal::WHEEL_SPEEDS);
        layout.set(3, &Signal::WHEEL_EFFORTS);
        layout
    }
}

impl Layout {
    /// A layout of mapped topics alone: the signals that each carries.
    #[must_use]
    pub fn mapped(topics: &[Vec<Signal>]) -> Self {
        let mut layout = Self { sources: [None; Signal::ALL.len()] };
        for (topic, signals) in topics.iter().enumerate() {
            layout.map(topic, signals);
        }
        layout
    }

    /// Takes signals from a mapped topic.
    pub fn map(&mut self, topic: usize, signals: &[Signal]) {
        self.set(TYPED_STREAMS + topic, signals);
    }

    /// Takes no signal from a stream.
    pub fn forget(&mut self, stream: usize) {
        self.sources.iter_mut().filter(|source| **source == Some(stream)).for_each(|source| *source = None);
    }

    /// Takes no stream for a signal.
    pub fn forget_signal(&mut self, signal: Signal) {
        self.sources[signal as usize] = None;
    }

    /// The stream that carries a signal.
    #[must_use]
    pub fn source(&self, signal: Signal) -> Option<usize> {
        self.sources[signal as usize]
    }

    /// The stream on whose stamps samples stand: that of the forward speed, else of the yaw rate, else of the pose.
    #[must_use]
    pub fn clock(&self) -> usize {
        [Signal::ForwardSpeed, Signal::YawRate, Signal::X]
            .into_iter()
            .find_map(|signal| self.source(signal))
            .unwrap_or(0)
    }

    /// The stream of a pose that does not come with the clock's messages.
    #[must_use]
    pub fn own_pose(&self) -> Option<usize> {
        self.source(Signal::X).filter(|&place| place != self.clock())
    }

    /// Streams without which there is no sample, apart from the clock: the steering (commanded, else measured), and what of the motion has
    /// a topic of its own.
    pub(crate) fn needed(&self) -> impl Iterator<Item = usize> + '_ {
        let steering = self.source(Signal::Steering).or(self.source(Signal::MeasuredSteering));
        let motion = [Signal::ForwardSpeed, Signal::LateralSpeed, Signal::YawRate];
        let motion = motion.into_iter().filter_map(|signal| self.source(signal));
        steering.into_iter().chain(motion).filter(|&place| place != self.clock())
    }

    fn set(&mut self, stream: usize, signals: &[Signal]) {
        signals.iter().for_each(|&signal| self.sources[signal as usize] = Some(stream));
    }
}
