//! The result of a diagnosis with a user's simulator: its gap.json.

use std::collections::BTreeMap;

use gripsight_signals::DataHealth;
use serde::Serialize;

/// What a diagnosis comes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Parameters of the simulator or effects around it explain the gap; they are named.
    Effects,
    /// Simulator and car agree within the noise.
    NoGap,
    /// The simulator has no term for a part of the gap.
    MissingStructure,
    /// A few stretches of the drive hold a gap that neither parameters nor free terms explain.
    NoneOfThese,
}

/// A value with its 90 % interval; ends that are not known are infinite, `null` in JSON.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// Best value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// A size with its unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Sized {
    /// Best value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Unit; `1` for none.
    pub unit: String,
    /// What the simulator has now; nothing for an effect around it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub before: Option<f64>,
}

/// An effect in the ranking.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RankedEffect {
    /// `simulator.<parameter>`, or the canonical name of an effect around it.
    pub name: String,
    /// Whether the verdict names it.
    pub accepted: bool,
    /// Sizes by name.
    pub parameters: BTreeMap<String, Sized>,
    /// Share of the gap between the simulator as it came and the noise that it closes on held-out data, after those above it.
    pub gap_closed_fraction: Estimate,
    /// Stated chance that it is the cause, among those that it is confused with.
    pub confidence: f64,
    /// What this recording cannot tell from it.
    pub confused_with: Vec<String>,
    /// Where it acts, where that is known.
    pub site: Option<String>,
    /// The unit error that its size is, where the interval holds a known ratio.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit_error: Option<UnitError>,
}

/// A ratio of units that a gain may be mistaken by.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UnitError {
    /// What it is.
    pub name: String,
    /// The ratio, or its inverse.
    pub ratio: f64,
}

/// A site of the graded answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Site {
    /// Its name.
    pub name: String,
    /// Chance that something differs there.
    pub probability: f64,
    /// Share of the gap that the effects there close.
    pub closed_fraction: Estimate,
    /// What it may be.
    pub mechanisms: Vec<Mechanism>,
}

/// A mechanism with its chance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mechanism {
    /// Its name.
    pub name: String,
    /// Its chance.
    pub probability: f64,
}

/// What the simulator may have no term for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MissingTerm {
    /// The mechanism that the free terms work like.
    pub name: String,
    /// Share of the whole gap that they would close on held-out data, on top of the effects named.
    pub closed_fraction: f64,
}

/// A part of the data with its errors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Place {
    /// Lower end of the bin.
    pub low: f64,
    /// Upper end.
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
    /// By forward speed.
    pub speed: Vec<Place>,
    /// By absolute lateral acceleration.
    pub lateral_acceleration: Vec<Place>,
    /// By time.
    pub time: Vec<Place>,
}

/// The gap with one more of the named effects in place.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GapStep {
    /// The effect that is new.
    pub effect: String,
    /// The error.
    pub error: Estimate,
}

/// The gap: mean squared error of open-loop rollouts on held-out data over the noise variance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GapBudget {
    /// The simulator as it came.
    pub nominal: Estimate,
    /// The same: a simulator has no tires to retune.
    pub retuned: Estimate,
    /// With one named effect after the other.
    pub steps: Vec<GapStep>,
    /// With all of them.
    pub after: Estimate,
    /// With free terms on top.
    pub unstructured_ceiling: Estimate,
    /// What the noise alone leaves.
    pub noise_floor: Estimate,
    /// Length of the rollouts.
    pub horizon_s: f64,
    /// Noise of every channel.
    pub channel_noise: BTreeMap<&'static str, f64>,
    /// What was scored on.
    pub scored_on: &'static str,
}

/// Why, with the figures.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Reason {
    /// The error as it came and what is left.
    Gap {
        /// As it came, over the noise.
        nominal: f64,
        /// With the effects named.
        after: f64,
    },
    /// An effect was taken.
    Taken {
        /// Its name.
        name: String,
        /// Square of its size over its standard error.
        wald: f64,
        /// What that had to exceed.
        needed: f64,
    },
    /// What cannot be told from what was taken.
    Confused {
        /// What was taken.
        name: String,
        /// What is alike.
        with: Vec<String>,
    },
    /// Free terms explain what parameters do not.
    Missing {
        /// Share of the gap that they close beyond the effects named.
        closed_fraction: f64,
        /// How sure, in standard deviations over held-out blocks.
        z: f64,
    },
    /// The forward speed was imposed: nothing is said of the simulator's longitudinal side.
    SpeedImposed,
    /// The forward speed is the simulator's own.
    SpeedSimulated,
}

/// What these data cannot show.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Invisible {
    /// Its name.
    pub name: String,
    /// Why.
    pub reason: &'static str,
}

/// The simulator's own share.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SimulatorUse {
    /// Its name.
    pub name: String,
    /// Passes of the whole recording.
    pub rollouts: f64,
    /// Candidates considered.
    pub candidates: usize,
    /// What it says that it has no term for.
    pub lacks: Vec<String>,
    /// Time that the inference took, s; and what of it was spent in the simulator.
    #[serde(skip)]
    pub took_s: [f64; 2],
}

/// A diagnosis with a user's simulator.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SimulatorDiagnosis {
    /// What it comes to.
    pub verdict: Verdict,
    /// Why.
    pub reasons: Vec<Reason>,
    /// Effects: those named in their order, then others by what each alone would leave.
    pub effects: Vec<RankedEffect>,
    /// What these data cannot show.
    pub invisible: Vec<Invisible>,
    /// The graded answer.
    pub sites: Vec<Site>,
    /// What the simulator may have no term for; empty where nothing is missing.
    pub missing: Vec<MissingTerm>,
    /// Where the gap lies.
    #[serde(rename = "where")]
    pub places: Where,
    /// How large it is.
    pub gap: GapBudget,
    /// Share of it that the effects named close.
    pub gap_closed_fraction: Estimate,
    /// A simulator has no Phi_p.
    pub tires: Option<()>,
    /// State of the data.
    pub data_health: DataHealth,
    /// The simulator's own share.
    pub simulator: SimulatorUse,
    /// The simulator's parameters that are named, with their new values: what a patch would write.
    #[serde(skip)]
    pub changes: Vec<(String, f64)>,
    /// Residuals of the simulator as it came, over the noise and less what other starts explain, for a verification.
    #[serde(skip)]
    pub residuals: Vec<f64>,
    /// Values of all candidates and starts with the sensors' effects, for a verification.
    #[serde(skip)]
    pub fitted: Vec<(String, f64)>,
    /// Time, measured, as it came, with the effects: of each compared channel, over held-out windows.
    #[serde(skip)]
    pub series: Vec<(&'static str, Vec<[f64; 4]>)>,
}
