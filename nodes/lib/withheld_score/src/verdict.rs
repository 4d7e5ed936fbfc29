//! What a diagnosis said of a case: the parts of gap.json that are scored.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// A parameter with its 90 % interval; an end that is not there is `null`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SaidParameter {
    /// Best value.
    pub value: Option<f64>,
    /// Lower end.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
}

/// An effect in the ranking.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SaidEffect {
    /// Canonical name.
    pub name: String,
    /// Whether the verdict names it.
    pub accepted: bool,
    /// Sizes by name.
    pub parameters: BTreeMap<String, SaidParameter>,
    /// Stated chance that it is the cause.
    pub confidence: Option<f64>,
    /// What the data cannot tell from it.
    pub confused_with: Vec<String>,
}

/// A change between two drives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SaidChange {
    /// Canonical name of its site.
    pub site: String,
    /// Canonical name of the effect; `tires`; `other`.
    pub name: String,
    /// Which parameter of the effect.
    #[serde(default)]
    pub parameter: Option<String>,
    /// By how much.
    pub difference: SaidParameter,
    /// Chance that it has changed.
    pub probability: Option<f64>,
}

/// A site in the graded answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SaidSite {
    /// Canonical name.
    pub name: String,
    /// Chance that something is the matter there.
    pub probability: Option<f64>,
}

/// A figure of the budget.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Figure {
    /// Best value.
    pub value: Option<f64>,
}

/// The gap on the held-out bag, step by step.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct SaidGap {
    /// The model as handed over.
    pub nominal: Figure,
    /// With other tires.
    pub retuned: Figure,
    /// With the effects.
    pub after: Figure,
    /// With flexible terms.
    pub unstructured_ceiling: Figure,
    /// With a residual network in place of effects.
    #[serde(default)]
    pub s4_residual: Figure,
    /// What noise leaves.
    pub noise_floor: Figure,
}

/// Errors over the noise on a drive that no fit has seen: of a simulator as it came, and with what was named.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OtherDrive {
    /// As it came.
    pub before: Option<f64>,
    /// With what was named.
    pub after: Option<f64>,
}

/// What became of a simulator's parameter file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SaidPatch {
    /// Whether a patch was given.
    pub written: bool,
}

/// A verdict.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Said {
    /// `effects`, `tire_retune_only`, `no_gap`, `none_of_these`, `not_identifiable`; or `failed`.
    pub verdict: String,
    /// Effects, best first.
    #[serde(default)]
    pub effects: Vec<SaidEffect>,
    /// What has changed since an earlier drive.
    #[serde(default)]
    pub changes: Vec<SaidChange>,
    /// The sites.
    #[serde(default)]
    pub sites: Vec<SaidSite>,
    /// The gap.
    #[serde(default)]
    pub gap: SaidGap,
    /// Only of pairs of simulator and car.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_drive: Option<OtherDrive>,
    /// Only of pairs of simulator and car.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub patch: Option<SaidPatch>,
}

impl Said {
    /// Names that the verdict gives, in its order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.accepted().map(|e| e.name.as_str())
    }

    /// Effects that the verdict names; beside structure that a simulator lacks some may be.
    pub fn accepted(&self) -> impl Iterator<Item = &SaidEffect> {
        let naming = ["effects", "missing_structure"].contains(&self.verdict.as_str());
        self.effects.iter().filter(move |e| naming && e.accepted)
    }

    /// The first name, or the verdict where it gives none.
    #[must_use]
    pub fn first(&self) -> &str {
        self.names().next().unwrap_or(&self.verdict)
    }

    /// Share of the gap above the noise that is gone on the held-out bag, tires and effects together.
    #[must_use]
    pub fn shrinkage(&self) -> Option<f64> {
        self.shrunk_to(self.gap.after)
    }

    /// The same with other tires and a residual network that names nothing.
    #[must_use]
    pub fn residual_shrinkage(&self) -> Option<f64> {
        self.shrunk_to(self.gap.s4_residual)
    }

    fn shrunk_to(&self, after: Figure) -> Option<f64> {
        let (nominal, after, floor) = (self.gap.nominal.value?, after.value?, self.gap.noise_floor.value?);
        (nominal > floor).then(|| (nominal - after) / (nominal - floor))
    }
}
