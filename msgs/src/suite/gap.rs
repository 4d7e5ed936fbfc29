//! The diagnosis of the gap between model and car.

use serde::{Deserialize, Serialize};

use crate::standard::std_msgs::Header;
use crate::{Handshake, Interval, MagicFormula, Message};

/// One parameter of an effect.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GapParameter {
    /// As in the table of effects.
    pub name: String,
    /// Its size (unit).
    pub estimate: Interval,
    /// Its SI unit.
    pub unit: String,
}

impl Message for GapParameter {
    const TYPE: &'static str = "gripsight_msgs/msg/GapParameter";
}

/// One physical effect that may explain the gap between model and car.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GapEffect {
    /// As in the table of effects.
    pub name: String,
    /// True when the verdict names it.
    pub accepted: bool,
    /// Its size.
    pub parameters: Vec<GapParameter>,
    /// Share of the explainable gap that it closes on held-out data.
    pub gap_closed_fraction: Interval,
    /// Probability that it is the cause, 0 to 1.
    pub confidence: f64,
    /// Effects that these data cannot tell from it.
    pub confused_with: Vec<String>,
}

impl Message for GapEffect {
    const TYPE: &'static str = "gripsight_msgs/msg/GapEffect";
}

/// What differs between a drive and one from before of the same car.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GapChange {
    /// As in the table of sites.
    pub site: String,
    /// The effect; `tires`; or `other` for what no effect of the library does.
    pub name: String,
    /// What of it differs; empty of `other`.
    pub parameter: String,
    /// Slip angle at which tires' forces are compared (rad); NaN of anything else.
    pub at_slip_rad: f64,
    /// The later drive less the earlier one (unit).
    pub difference: Interval,
    /// Its SI unit.
    pub unit: String,
    /// Probability that it has changed, 0 to 1.
    pub probability: f64,
}

impl Message for GapChange {
    const TYPE: &'static str = "gripsight_msgs/msg/GapChange";
}

/// One bin of an axis along which the gap was looked at.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GapRegion {
    /// Channel, axle, speed, lateral_acceleration, slip, steering_rate, .
    pub axis: String,
    /// Lower end of the bin (unit).
    pub low: f64,
    /// Upper end of the bin (unit).
    pub high: f64,
    /// Unit of the axis.
    pub unit: String,
    /// Channel in which the gap was measured.
    pub channel: String,
    /// Squared error over noise variance; 1 is noise alone.
    pub chi2_per_dof: f64,
    /// Share of the whole gap that lies in this bin.
    pub share: f64,
}

impl Message for GapRegion {
    const TYPE: &'static str = "gripsight_msgs/msg/GapRegion";
}

/// Where, which and how much: the diagnosis of the gap between model and car, in short.
/// The whole of it is in the report's files.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GapReport {
    /// Stamp of the last sample diagnosed.
    pub header: Header,
    /// The sequence that this is about.
    pub handshake: Handshake,
    /// One of effects, tire_retune_only, no_gap, none_of_these or not_identifiable.
    pub verdict: String,
    /// Ranked, the most likely first.
    pub effects: Vec<GapEffect>,
    /// Since the first sequence, the likeliest first; empty unless asked for.
    pub changes: Vec<GapChange>,
    /// Effects that these signals cannot show.
    pub invisible: Vec<String>,
    /// The bins with the largest share, largest first.
    pub regions: Vec<GapRegion>,
    /// Mean squared rollout error over noise variance, as handed over.
    pub gap_nominal: Interval,
    /// The same with tires fitted anew.
    pub gap_retuned: Interval,
    /// The same with the accepted effects.
    pub gap_after: Interval,
    /// The same with a flexible model in place of effects.
    pub gap_ceiling: Interval,
    /// The same for noise alone.
    pub gap_noise_floor: Interval,
    /// (retuned - after) / (retuned - noise floor).
    pub gap_closed_fraction: Interval,
    /// Length of the rollouts (s).
    pub horizon_s: f64,
    /// Front tires (Phi_p, over the slips driven) fitted without an effect.
    pub front_without_effect: MagicFormula,
    /// Rear tires likewise.
    pub rear_without_effect: MagicFormula,
    /// Front tires (Phi_p) fitted together with the accepted effects.
    pub front_with_effect: MagicFormula,
    /// Rear tires likewise.
    pub rear_with_effect: MagicFormula,
    /// What is wrong with the data.
    pub data_health: Vec<String>,
    /// What to drive next, the most telling first.
    pub drive_next: Vec<String>,
    /// Where the report's files are.
    pub report_directory: String,
}

impl Message for GapReport {
    const TYPE: &'static str = "gripsight_msgs/msg/GapReport";
}

/// The effects that a diagnosis names, for a controller: what its model lacks, and how much. After every verdict; without effects where it names none.
/// Check a model on the last lap before you drive with it: a name may be wrong.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExtendedModel {
    /// Stamp of the last sample diagnosed.
    pub header: Header,
    /// The sequence that this is about.
    pub handshake: Handshake,
    /// As in [`GapReport`].
    pub verdict: String,
    /// Those that the verdict names, with size, interval and probability.
    pub effects: Vec<GapEffect>,
    /// Front tires fitted together with the effects: the car's own, not Phi_p.
    pub front: MagicFormula,
    /// Rear tires likewise.
    pub rear: MagicFormula,
}

impl Message for ExtendedModel {
    const TYPE: &'static str = "gripsight_msgs/msg/ExtendedModel";
}
