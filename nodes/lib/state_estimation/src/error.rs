//! Errors of this crate.

use gripsight_signals::SignalError;

/// Why there is no estimate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StateError {
    /// The sequence is malformed.
    #[error(transparent)]
    Signal(#[from] SignalError),
    /// Nothing tells where the car goes.
    #[error("neither a pose nor v_x with a yaw rate is recorded: the motion is unknown")]
    NothingMeasured,
    /// There is too little to begin with.
    #[error("{got} poses, at least {needed} needed")]
    TooFewPoses {
        /// Poses there.
        got: usize,
        /// Poses needed.
        needed: usize,
    },
    /// Poses and speeds do not belong together, as far as the filter can tell.
    #[error("the poses contradict the speeds: a jump at {jumps} of {poses} of them")]
    Contradicted {
        /// Jumps, of several poses each.
        jumps: usize,
        /// Poses there.
        poses: usize,
    },
    /// The filter lost its way.
    #[error("the covariance is no longer positive definite at {time_s:.3} s")]
    Diverged {
        /// Since the start of the sequence.
        time_s: f64,
    },
}
