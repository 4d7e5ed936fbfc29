//! What may push the car beside its tires and effects: accelerations that somebody else has learned.

use crate::recording::Run;
use crate::rollout::Window;

/// Learned accelerations that follow a rollout.
pub trait Correction: std::fmt::Debug + Sync {
    /// The correction at the start of a window of a run, its memory filled with what was measured before.
    fn stream<'r>(&'r self, run: &'r Run, window: &Window) -> Box<dyn CorrectionStream + 'r>;
}

/// A correction on its way through a window.
pub trait CorrectionStream {
    /// Accelerations of v_y (m/s2) and yaw rate (rad/s2) from sample `k` of the window on, which is predicted to be in `state` (v_y in m/s, yaw
    /// rate in rad/s).
    fn next(&mut self, k: usize, state: [f64; 2]) -> [f64; 2];
}
