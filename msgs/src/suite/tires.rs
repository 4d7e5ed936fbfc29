//! Tire parameter sets.

use serde::{Deserialize, Serialize};

use crate::standard::std_msgs::Header;
use crate::{Handshake, Interval, Longitudinal, Message, Range};

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

/// A tire parameter set, Phi_p. The MPC's topic carries ACCEPTED and ACCEPTED_WITHIN sets (PROVISIONAL ones where a parameter says so), and WITHDRAWN.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PacejkaParams {
    /// Stamp of the last sample of the sequence.
    pub header: Header,
    /// Run, sequence and iteration of the set.
    pub handshake: Handshake,
    /// One of the constants.
    pub status: u8,
    /// Why REJECTED or WITHDRAWN, or what the set must be read with.
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
    /// The set is valid up to this front slip angle (rad); NaN: not stated.
    pub front_valid_slip_rad: f64,
    /// And up to this rear slip angle (rad).
    pub rear_valid_slip_rad: f64,
    /// Largest front force that it promises, at the static load (N).
    pub front_valid_force_n: f64,
    /// Largest rear force that it promises (N).
    pub rear_valid_force_n: f64,
    /// What was corrected before the fit.
    pub signals: SignalCorrections,
    /// Mean forward speed of the sequence (m/s).
    pub v_x_mean_mps: f64,
    /// What the same drive tells of the drive train.
    pub longitudinal: Longitudinal,
}

impl PacejkaParams {
    /// A candidate of the running iteration.
    pub const PROPOSED: u8 = 1;
    /// The result of a run: use it, the peak is known.
    pub const ACCEPTED: u8 = 2;
    /// The result of a run that must not be used; reason says why.
    pub const REJECTED: u8 = 3;
    /// The result of a run: use it, it promises no force beyond what was shown; see the limits.
    pub const ACCEPTED_WITHIN: u8 = 4;
    /// The peak rests on a friction prior.
    pub const PROVISIONAL: u8 = 5;
    /// Grip has fallen below what this set promises: do not go on with it.
    pub const WITHDRAWN: u8 = 6;
}

impl Message for PacejkaParams {
    const TYPE: &'static str = "gripsight_msgs/msg/PacejkaParams";
}

/// The tires of the car with its load transfer, combined slip and relaxation (not those of a bare single-track model: these are in [`PacejkaParams`]),
/// fitted together with these, and how well a drive knows them. After every run with finite numbers, whatever its status.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TirePosterior {
    /// Stamp of the last sample of the sequence.
    pub header: Header,
    /// Run and sequence of the identification that it was made beside.
    pub handshake: Handshake,
    /// accepted, accepted_within, provisional or rejected: that of the run's set; what these tires are worth says their covariance.
    pub status: String,
    /// front.stiffness (B C D, over load), front.c, .d, .e of the Magic Formula, rear likewise; effect.parameter of what every car has a little of.
    pub names: Vec<String>,
    /// Unit of each.
    pub units: Vec<String>,
    /// Mean of each (unit).
    pub mean: Vec<f64>,
    /// Their covariance, row by row (product of the units).
    pub covariance: Vec<f64>,
    /// Hashes of the seconds of driving that it was fitted on: on these it is a place to start from, never a prior.
    pub data: Vec<String>,
}

impl Message for TirePosterior {
    const TYPE: &'static str = "gripsight_msgs/msg/TirePosterior";
}

/// Whether the car still grips as the set in use promises: published as it is watched, at once where it does not.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Grip {
    /// Stamp of the last sample looked at.
    pub header: Header,
    /// Run and sequence of the set in use.
    pub handshake: Handshake,
    /// True where grip has fallen below what the set promises.
    pub fallen: bool,
    /// Share of the promised lateral force that the car gave over the last moments; NaN while too little of it is asked for.
    pub share: f64,
    /// Lateral acceleration that the set promises at the slips driven (m/s^2).
    pub promised_mps2: f64,
    /// The same in words.
    pub text: String,
}

impl Message for Grip {
    const TYPE: &'static str = "gripsight_msgs/msg/Grip";
}
