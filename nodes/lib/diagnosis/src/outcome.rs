//! The result of a diagnosis: gap.json, and the series that pictures are drawn from.

use gripsight_estimation::Estimate;
use gripsight_model::{Identity, Need};
use std::collections::BTreeMap;

use gripsight_signals::DataHealth;
use gripsight_vehicle::PacejkaParameters;
use serde::Serialize;

use crate::ExtendedModelFile;
use crate::answer::{Change, SiteAnswer};
use crate::drives::DriveAnswer;
use crate::figures::FigureAnswer;

/// What a diagnosis comes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Effects of the library explain the gap; they are named.
    Effects,
    /// Other tires close what gap there is.
    TireRetuneOnly,
    /// Model and car agree within the noise and the usual imperfection of the model.
    NoGap,
    /// There is a gap that no effect of the library explains.
    NoneOfThese,
    /// The data cannot tell.
    NotIdentifiable,
}

impl Verdict {
    /// As in gap.json.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Effects => "effects",
            Self::TireRetuneOnly => "tire_retune_only",
            Self::NoGap => "no_gap",
            Self::NoneOfThese => "none_of_these",
            Self::NotIdentifiable => "not_identifiable",
        }
    }
}

/// A parameter of an effect with its 90 % interval. A limit that is not there is infinite, `null` in JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectParameter {
    /// Best value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Unit; `1` for none.
    pub unit: &'static str,
    /// What the model handed over, or that of the drive before, has of it: the effect is what is new. `None`: nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub before: Option<f64>,
}

/// An effect in the ranking.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RankedEffect {
    /// Canonical name.
    pub name: &'static str,
    /// Whether the verdict names it.
    pub accepted: bool,
    /// Sizes by name.
    pub parameters: BTreeMap<&'static str, EffectParameter>,
    /// Share of the gap between retuned tires and noise floor that it closes on held-out data, after the accepted ones above it; negative:
    /// it makes held-out errors larger. Unknown (`null`) where that gap's interval reaches down to the noise, where the share's own is
    /// wider than twice the gap, where the effect stands in place of a retune, and beyond the three best that were not accepted.
    pub gap_closed_fraction: Estimate,
    /// Share of the error on held-out data, noise included, that is left without it and that it closes, in the model of the inference, whose free
    /// terms stay; unknown (`null`) where that model does not have it.
    pub needed_fraction: f64,
    /// Logarithm of how much likelier held-out data are with it than without it; unknown (`null`) where the model does not have it.
    pub held_out_log_ratio: f64,
    /// What it explains over what of the unexplained looks like it; infinite (`null`) where nothing unexplained is needed.
    pub over_unexplained: f64,
    /// Half widths of its interval that its size is away from nothing.
    pub size_over_half_width: f64,
    /// Probability that it matters.
    pub confidence: f64,
    /// Effects that this recording cannot tell from it.
    pub confused_with: Vec<&'static str>,
}

/// An effect that these signals cannot show.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Invisible {
    /// What is missing.
    #[serde(skip)]
    pub need: Need,
    /// Canonical name.
    pub name: &'static str,
    /// Why.
    pub reason: String,
}

/// Size from which an effect would show.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DetectionLimit {
    /// Canonical name of the effect.
    pub name: &'static str,
    /// Parameter as it is fitted.
    pub parameter: &'static str,
    /// Five standard errors.
    pub size: f64,
    /// A size that matters on this car.
    pub matters: f64,
    /// What the data say of it beside the model that is stated, with its 90 % interval; unknown (`null`) where its derivative vanishes there.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Standard error of the value: the data's alone.
    pub standard_error: f64,
}

/// A part of the data with its errors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Place {
    /// Lower end of the bin.
    pub low: f64,
    /// Upper end of the bin.
    pub high: f64,
    /// Unit of the ends.
    pub unit: &'static str,
    /// Channel, or `all`.
    pub channel: &'static str,
    /// Squared error over the noise variance per degree of freedom.
    pub chi2_per_dof: f64,
    /// Share of the whole squared error.
    pub share: f64,
}

/// Where the gap lies.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Where {
    /// By channel.
    pub channel: Vec<Place>,
    /// By axle: errors of the lateral velocity of each axle.
    pub axle: Vec<Place>,
    /// By forward speed.
    pub speed: Vec<Place>,
    /// By absolute lateral acceleration.
    pub lateral_acceleration: Vec<Place>,
    /// By the larger absolute slip angle.
    pub slip: Vec<Place>,
    /// By absolute steering rate.
    pub steering_rate: Vec<Place>,
    /// By longitudinal acceleration.
    pub longitudinal_acceleration: Vec<Place>,
    /// By frequency of the error.
    pub frequency: Vec<Place>,
    /// By distance along the lap, in m; empty without laps.
    pub track_position: Vec<Place>,
    /// By time.
    pub time: Vec<Place>,
}

/// The error with one more of the named effects in the model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GapStep {
    /// Canonical name of the effect that is new.
    pub effect: &'static str,
    /// Mean squared error over the noise variance, as in [`GapBudget`].
    pub error: Estimate,
}

/// The gap step by step: mean squared error of open-loop rollouts on held-out data over the noise variance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GapBudget {
    /// The model as it came.
    pub nominal: Estimate,
    /// With the tires retuned.
    pub retuned: Estimate,
    /// With the tires retuned and one named effect after the other, in the order of the ranking; empty where none is named.
    pub steps: Vec<GapStep>,
    /// With all the named effects: the last of the steps, or the same as `retuned`.
    pub after: Estimate,
    /// With flexible terms on top.
    pub unstructured_ceiling: Estimate,
    /// With the residual network of `gripsight_s4` on top of the retuned tires, in place of effects: what a black box closes without a name.
    /// Unknown (`null`) where it could not be trained.
    pub s4_residual: Estimate,
    /// What the noise alone leaves.
    pub noise_floor: Estimate,
    /// Length of the rollouts.
    pub horizon_s: f64,
    /// Weight of every channel: one over its noise.
    pub channel_noise: BTreeMap<&'static str, f64>,
    /// Whether the figures are from held-out blocks, from another bag, or (too little data) from the training blocks.
    pub scored_on: &'static str,
}

/// Phi_p with and without the named effects: the car's own tires projected on those of a bare single-track model (`effective_tires` of
/// `gripsight_model`) over the slips driven. The own tires are in [`ExtendedModelFile`](crate::ExtendedModelFile).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TirePair {
    /// Fitted without any effect.
    pub without_effect: PacejkaParameters,
    /// Fitted together with the named effects.
    pub with_effect: PacejkaParameters,
}

/// An instant as measured and as predicted by open-loop rollouts of half a second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// Time since the recording's first sample.
    pub time_s: f64,
    /// Whether a rollout begins here, from the best state.
    pub begins: bool,
    /// Forward speed, which is the model's input.
    pub v_x_mps: f64,
    /// Lateral velocity: measured, of the nominal model, of the model with the effects.
    pub v_y_mps: [f64; 3],
    /// Yaw rate: measured, of the nominal model, of the model with the effects.
    pub yaw_rate_radps: [f64; 3],
}

/// Points of the pictures.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// F_y/F_z over slip angle: (slip in rad, without effect, with effect), front then rear.
    pub tire_curves: [Vec<[f64; 3]>; 2],
    /// Largest slip angle driven, front and rear, rad.
    pub slip_driven_rad: [f64; 2],
    /// The five seconds with the largest errors.
    pub worst: Vec<Prediction>,
    /// The whole recording, where it could be used.
    pub predictions: Vec<Prediction>,
    /// Squared error per degree of freedom over speed (m/s) and lateral acceleration (m/s2): (speed, a_y, chi2).
    pub heat: Vec<[f64; 3]>,
    /// Longitudinal and lateral acceleration (m/s2) of the recording.
    pub g_g: Vec<[f64; 2]>,
    /// Rollout errors over the horizon: (horizon in s, nominal, retuned, after).
    pub horizon: Vec<[f64; 4]>,
}

/// How the inference went.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Inference {
    /// How often everything was linearised.
    pub rounds: usize,
    /// How many times less the errors tell than if they were independent.
    pub dispersion: f64,
    /// Where two drives are compared: squared error that one model, fitted to either, leaves of the later one over that of the earlier one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_over_earlier: Option<f64>,
}

/// A diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// What it comes to.
    pub verdict: Verdict,
    /// Why, in sentences.
    pub reasons: Vec<String>,
    /// Effects: those accepted, in the order of what they gain, then candidates in the order of what each would close.
    pub effects: Vec<RankedEffect>,
    /// Site by site, how likely something is the matter there, the likeliest first: stands whatever the verdict.
    pub sites: Vec<SiteAnswer>,
    /// What differs from the earlier drive, the likeliest first; empty without one.
    pub changes: Vec<Change>,
    /// Of several drives that were explained together: what each says of that; else empty.
    pub drives: Vec<DriveAnswer>,
    /// Effects that these signals cannot show.
    pub invisible: Vec<Invisible>,
    /// Sizes from which effects would show.
    pub detection_limits: Vec<DetectionLimit>,
    /// The figures that are stated of the car, with what the data say of them.
    pub figures: Vec<FigureAnswer>,
    /// Where the gap lies.
    #[serde(rename = "where")]
    pub places: Where,
    /// The kinematic identities.
    pub identities: Vec<Identity>,
    /// How large it is, step by step.
    pub gap: GapBudget,
    /// (retuned - after)/(retuned - noise floor); unknown (`null`) where the share of an effect is.
    pub gap_closed_fraction: Estimate,
    /// The model that the verdict names: what a later diagnosis or identification can start from.
    pub extended_model: ExtendedModelFile,
    /// Tires with and without the effects; unknown (`null`) where the data cannot tell and none were given.
    pub tires: TirePair,
    /// Rates, gaps, jitter, frozen channels.
    pub data_health: DataHealth,
    /// What to drive or record next.
    pub drive_next: Vec<String>,
    /// How often everything was linearised, and how many times less the errors tell than if they were independent; nothing where the data cannot
    /// tell.
    pub inference: Option<Inference>,
    /// Points of the pictures.
    #[serde(skip)]
    pub series: Series,
}
