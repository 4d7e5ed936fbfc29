//! Tire parameter sets.

use serde::{Deserialize, Serialize};

use crate::standard::std_msgs::Header;
use crate::{Handshake, Interval, Message, Range};

/// Magic Formula of one axle, F_y = F_z D sin(C atan(B alpha - E (B alpha - atan(B alpha)))).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MagicFormula {
    /// Stiffness factor (1/rad).
    pub b: f64,
    /// Shape factor.
    pub c: f64,
    /// Peak lateral force over vertical load.
    pub d: f64,
    /// Curvature factor.
    pub e: f64,
}

impl Message for MagicFormula {
    const TYPE: &'static str = "gripsight_msgs/msg/MagicFormula";
}

/// Peak friction of one axle, and what the value rests on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PeakFriction {
    /// Peak lateral force over vertical load.
    pub friction: Interval,
    /// True when the data reach the peak of the curve.
    pub reached: bool,
    /// True when the value is the prior's, not the data's.
    pub from_prior: bool,
}

impl Message for PeakFriction {
    const TYPE: &'static str = "gripsight_msgs/msg/PeakFriction";
}

/// What identification found about the signals and took out before it fitted the tires.
/// All zero (gain 1) means that the signals were used as recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SignalCorrections {
    /// The wheels follow the recorded steering by this much (s).
    pub steering_delay_s: f64,
    /// Wheel angle over recorded steering.
    pub steering_gain: f64,
    /// Wheel angle at recorded steering 0, left positive (rad).
    pub steering_offset_rad: f64,
    /// Point where v_y is measured, ahead of the centre of gravity positive (m).
    pub v_y_lever_arm_m: f64,
    /// Added to v_y by the sensor, left positive (m/s).
    pub v_y_bias_mps: f64,
    /// Added to the yaw rate by the sensor, left turn positive (rad/s).
    pub yaw_rate_bias_radps: f64,
}

impl Message for SignalCorrections {
    const TYPE: &'static str = "gripsight_msgs/msg/SignalCorrections";
}

/// A tire parameter set, Phi_p. The MPC's topic carries ACCEPTED sets only.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PacejkaParams {
    /// Stamp of the last sample of the sequence.
    pub header: Header,
    /// Run, sequence and iteration of the set.
    pub handshake: Handshake,
    /// PROPOSED, ACCEPTED or REJECTED.
    pub status: u8,
    /// Why REJECTED, or what ACCEPTED must be read with.
    pub reason: String,
    /// Front axle.
    pub front: MagicFormula,
    /// Rear axle.
    pub rear: MagicFormula,
    /// Static load of the front axle, F_zf (N).
    pub front_load_n: f64,
    /// Static load of the rear axle, F_zr (N).
    pub rear_load_n: f64,
    /// B C D F_zf (N/rad).
    pub front_cornering_stiffness_n_per_rad: Interval,
    /// B C D F_zr (N/rad).
    pub rear_cornering_stiffness_n_per_rad: Interval,
    /// Peak friction of the front axle.
    pub front_peak: PeakFriction,
    /// Peak friction of the rear axle.
    pub rear_peak: PeakFriction,
    /// Front slip angles visited (rad).
    pub front_slip_rad: Range,
    /// Rear slip angles visited (rad).
    pub rear_slip_rad: Range,
    /// What was corrected before the fit.
    pub signals: SignalCorrections,
    /// Mean forward speed of the sequence (m/s).
    pub v_x_mean_mps: f64,
}

impl PacejkaParams {
    /// A candidate of the running iteration.
    pub const PROPOSED: u8 = 1;
    /// The result of a run: use it.
    pub const ACCEPTED: u8 = 2;
    /// The result of a run that must not be used; reason says why.
    pub const REJECTED: u8 = 3;
}

impl Message for PacejkaParams {
    const TYPE: &'static str = "gripsight_msgs/msg/PacejkaParams";
}
