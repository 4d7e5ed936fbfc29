//! Errors of this crate.

/// What can be wrong with telemetry.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SignalError {
    /// A value is NaN or infinite.
    #[error("{topic}: {field} is {value} at stamp {stamp_s:.6} s (message {index})")]
    NotFinite {
        /// Which stream.
        topic: &'static str,
        /// Which field of it, with its unit.
        field: &'static str,
        /// The value found.
        value: f64,
        /// Its stamp.
        stamp_s: f64,
        /// Its place in the stream, from 0.
        index: usize,
    },
    /// A stamp lies before the stamp of the message before it.
    #[error("{topic}: the stamp goes back by {back_s:.6} s at message {index} (stamp {stamp_s:.6} s)")]
    StampWentBack {
        /// Which stream.
        topic: &'static str,
        /// Place in the stream, from 0.
        index: usize,
        /// The offending stamp.
        stamp_s: f64,
        /// How far back it goes.
        back_s: f64,
    },
    /// There is too little to work on.
    #[error("{what}: {got} samples, at least {needed} needed")]
    TooShort {
        /// What is too short.
        what: &'static str,
        /// Samples there.
        got: usize,
        /// Samples needed.
        needed: usize,
    },
    /// The channels of a sequence differ in length.
    #[error("sequence channel {channel} holds {got} samples where time_s holds {expected}")]
    ChannelLength {
        /// Which channel.
        channel: &'static str,
        /// Samples there.
        got: usize,
        /// Samples of `time_s`.
        expected: usize,
    },
    /// A configured value makes no sense.
    #[error("{name} must be {must}, got {got}")]
    Config {
        /// The setting, with its unit.
        name: &'static str,
        /// What it must be.
        must: &'static str,
        /// What it is.
        got: f64,
    },
}
