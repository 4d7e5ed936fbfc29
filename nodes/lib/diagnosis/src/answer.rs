//! The graded answer: how likely something is the matter at each site and which mechanism it is; and what differs between two drives.

use gripsight_estimation::Estimate;
use serde::Serialize;

use crate::outcome::EffectParameter;

/// A mechanism that may be at work at a site.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MechanismAnswer {
    /// Canonical name of the effect.
    pub name: &'static str,
    /// Probability that it matters.
    pub probability: f64,
}

/// What the data say of one site.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SiteAnswer {
    /// Canonical name of the site.
    pub name: &'static str,
    /// Probability that something is the matter there.
    pub probability: f64,
    /// What the site closes: the share of its effects that the verdict names, on held-out data; where it names none, of what all effects and
    /// flexible terms together close on the windows that were fitted.
    pub closed_fraction: Estimate,
    /// Which of the library's effects, the likeliest first.
    pub mechanisms: Vec<MechanismAnswer>,
    /// Probability that something is the matter there that no effect of the library does.
    pub other_probability: f64,
    /// Share of what is closed on the windows fitted that no effect of the library closes.
    pub unexplained_fraction: f64,
}

/// A difference between two drives of one car.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Change {
    /// Canonical name of the site.
    pub site: &'static str,
    /// Canonical name of the effect; `tires`; or `other` for what no effect of the library does.
    pub name: &'static str,
    /// What of the effect differs: what is reported of it, or of its parameters the one that stands out most; of tires what the axle pushes with
    /// over its load; none of `other`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameter: Option<&'static str>,
    /// Slip angle at which the tires' forces are compared: what both drives exceed in a twentieth of their time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at_slip_rad: Option<f64>,
    /// The later drive less the earlier one, with its 90 % interval; unknown (`null`) of `other`.
    pub difference: EffectParameter,
    /// Probability that it has changed.
    pub probability: f64,
}
