//! The state of a run.

use serde::{Deserialize, Serialize};

use crate::standard::std_msgs::Header;
use crate::{Handshake, Message};

/// Where a run of the identification stands.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IdentificationProgress {
    /// Stamp of the last sample of the sequence.
    pub header: Header,
    /// The run.
    pub handshake: Handshake,
    /// One of the above.
    pub stage: u8,
    /// Iterations after which the run ends in any case.
    pub max_iterations: u32,
    /// Largest relative change of the tire curves in the last iteration.
    pub change: f64,
    /// Change below which the run has converged.
    pub tolerance: f64,
    /// Cost that Nelder-Mead reached in the last iteration.
    pub cost: f64,
    /// Share of the virtual test outside the slips trained on.
    pub extrapolated_share: f64,
    /// Since the run started (s).
    pub elapsed_s: f64,
    /// What to drive next, the most telling first; empty before the run is over.
    pub drive_next: Vec<DriveNext>,
    /// The same for a person.
    pub text: String,
}

/// What to drive, so that the next identification tells more.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DriveNext {
    /// `turn_ins`, `corner_harder`, `corners_both_ways`, `same_corners_at_two_speeds`, `drive_on`, `each_floor_by_itself` or
    /// `measure_lateral_velocity`.
    pub manoeuvre: String,
    /// Forward speed to do it at (m/s); NaN: any.
    pub v_x_mps: f64,
    /// Lateral acceleration to go to (m/s2); NaN: that of the line.
    pub a_y_mps2: f64,
    /// The same for a person.
    pub why: String,
}

impl Message for DriveNext {
    const TYPE: &'static str = "gripsight_msgs/msg/DriveNext";
}

impl IdentificationProgress {
    /// For a sequence worth an identification.
    pub const WAITING: u8 = 0;
    /// Signal corrections and start values.
    pub const PREPARING: u8 = 1;
    /// Candidate sent, waiting for its residual model.
    pub const TRAINING: u8 = 2;
    /// Virtual steady-state test.
    pub const SWEEPING: u8 = 6;
    /// Nelder-Mead on what it showed.
    pub const FITTING: u8 = 3;
    /// The set is accepted or rejected.
    pub const FINISHED: u8 = 4;
    /// No answer came in time.
    pub const GIVEN_UP: u8 = 5;
}

impl Message for IdentificationProgress {
    const TYPE: &'static str = "gripsight_msgs/msg/IdentificationProgress";
}
