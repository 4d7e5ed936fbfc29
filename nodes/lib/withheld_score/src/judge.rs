//! One case judged.

use std::collections::BTreeMap;

use gripsight_model::EffectId;
use gripsight_withheld_make::{CaseLabel, Family, Kind, SealedEffect, sizing_parameter};
use serde::{Deserialize, Serialize};

use crate::targets::Targets;
use crate::verdict::{Said, SaidChange, SaidEffect};

/// A case with what was said of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The label.
    pub label: CaseLabel,
    /// The verdict.
    pub said: Said,
    /// What the same engine says when told the names; only where it was asked.
    pub oracle: Option<Said>,
    /// What simpler methods name first, by method.
    #[serde(default)]
    pub baselines: BTreeMap<String, String>,
    /// Time that the diagnosis took.
    pub time_s: f64,
}

/// A parameter of a rightly named effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SizeCheck {
    /// Effect.
    pub effect: String,
    /// Parameter.
    pub parameter: String,
    /// True value in the library's terms.
    pub truth: f64,
    /// The mechanism's constant.
    pub mechanism: f64,
    /// Value stated.
    pub value: f64,
    /// Whether the stated interval holds the truth; an interval without an end does not.
    pub covered: bool,
}

/// Probability from which a site is blamed: likelier than not.
const LIKELY: f64 = 0.5;
/// Verdicts that say that nothing has to be named.
const NOTHING: [&str; 2] = ["no_gap", "tire_retune_only"];
/// Effects that a retune of the tires answers as well.
const RETUNED: [&str; 2] = ["grip_scale", "grip_balance"];

impl Answer {
    /// Smallest severity of its effects; none where the generator does not say.
    #[must_use]
    pub fn severity(&self) -> Option<f64> {
        self.label
            .effects
            .iter()
            .map(|e| e.oracle.map(|o| o.severity))
            .reduce(|a, b| Some(a?.min(b?)))
            .flatten()
    }

    /// Whether the targets speak of this case: race pace, and every effect large enough where its limit is known.
    #[must_use]
    pub fn in_scope(&self, targets: &Targets) -> bool {
        let measured = self.label.family != Family::Reference;
        let large = self.severity().is_none_or(|s| s >= targets.least_severity);
        self.label.race_pace && (self.label.kind == Kind::None || measured || large)
    }

    /// Names given, without those that the drive has of its own.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.named().map(|e| e.name.as_str())
    }

    fn named(&self) -> impl Iterator<Item = &SaidEffect> {
        let true_name = |name: &String| self.label.effects.iter().any(|t| t.name == *name);
        self.said.accepted().filter(move |e| true_name(&e.name) || !self.label.contained.contains(&e.name))
    }

    /// The first name, or the verdict; `effects` where only what the drive has of its own is named.
    #[must_use]
    pub fn first(&self) -> &str {
        self.names().next().unwrap_or(&self.said.verdict)
    }

    /// The first effect named.
    #[must_use]
    pub fn first_named(&self) -> Option<&SaidEffect> {
        self.named().next()
    }

    /// Whether the first name is the effect.
    #[must_use]
    pub fn exact(&self) -> bool {
        matches!(self.label.effects.as_slice(), [e] if self.first() == e.name)
    }

    /// Whether the effect is the first name or in its group, or a retune that answers it as well.
    #[must_use]
    pub fn within_group(&self) -> bool {
        let [truth] = self.label.effects.as_slice() else { return false };
        let retuned = RETUNED.contains(&truth.name.as_str()) && self.said.verdict == "tire_retune_only";
        retuned
            || self
                .first_named()
                .is_some_and(|e| e.name == truth.name || e.confused_with.contains(&truth.name))
    }

    /// Whether something is named where nothing is; where drives are compared, whether anything is said to have changed.
    #[must_use]
    pub fn false_alarm(&self) -> bool {
        let said =
            if self.label.compared { self.said.verdict != "no_gap" } else { self.names().next().is_some() };
        self.label.kind == Kind::None && said
    }

    /// Whether something is likelier than not the matter, or has likelier than not changed, at a site of the first effect.
    #[must_use]
    pub fn site_right(&self) -> bool {
        let Some(effect) = self.label.effects.first().and_then(|e| EffectId::by_name(&e.name)) else {
            return false;
        };
        let at = |site: &str| effect.spec().sites.iter().any(|s| s.name() == site);
        let likely = |probability: Option<f64>| probability.is_some_and(|p| p >= LIKELY);
        if self.label.compared {
            self.said.changes.iter().any(|c| at(&c.site) && likely(c.probability))
        } else {
            self.said.sites.iter().any(|s| at(&s.name) && likely(s.probability))
        }
    }

    /// Whether it says that the library does not have the cause.
    #[must_use]
    pub fn abstained(&self) -> bool {
        self.said.verdict == "none_of_these"
    }

    /// Whether it names an effect, sure of it.
    #[must_use]
    pub fn confident_name(&self, targets: &Targets) -> bool {
        self.first_named().is_some_and(|e| e.confidence.unwrap_or(1.0) >= targets.confident)
    }

    /// Whether an effect is named that was not put in and is not the drive's own.
    #[must_use]
    pub fn names_no_cause(&self) -> bool {
        self.names().any(|name| !self.label.effects.iter().any(|truth| truth.name == name))
    }

    /// How many of the true effects are named.
    #[must_use]
    pub fn found(&self) -> usize {
        self.label.effects.iter().filter(|truth| self.names().any(|name| name == truth.name)).count()
    }

    /// Whether the verdict is right in the sense of its kind.
    #[must_use]
    pub fn right(&self) -> bool {
        match self.label.kind {
            Kind::None if self.label.compared => !self.false_alarm(),
            Kind::None => {
                NOTHING.contains(&self.said.verdict.as_str()) || !self.false_alarm() && !self.abstained()
            }
            Kind::Single => self.exact(),
            Kind::Pair => self.found() == 2,
            Kind::OutOfLibrary | Kind::Deleted => self.abstained(),
        }
    }

    /// Parameters of rightly named effects beside the truth.
    #[must_use]
    pub fn sizes(&self) -> Vec<SizeCheck> {
        if self.label.kind == Kind::Deleted {
            return Vec::new();
        }
        let checked = |truth: &SealedEffect| {
            let said = self.said.accepted().find(|e| e.name == truth.name)?;
            let contained = self.label.contained.contains(&truth.name);
            let change = self.said.changes.iter().find(|c| self.label.compared && c.name == truth.name);
            (!contained).then(|| match change {
                Some(change) => difference(truth, change).into_iter().collect(),
                None => sizes(truth, said),
            })
        };
        self.label.effects.iter().filter_map(checked).flatten().collect()
    }

    /// Shrinkage on the held-out bag over the oracle's; none where either cannot be said or the oracle shrinks nothing.
    #[must_use]
    pub fn shrinkage_over_oracle(&self) -> Option<f64> {
        self.over_oracle(self.said.shrinkage()?)
    }

    /// The same of a residual network that names nothing.
    #[must_use]
    pub fn residual_over_oracle(&self) -> Option<f64> {
        self.over_oracle(self.said.residual_shrinkage()?)
    }

    fn over_oracle(&self, shrinkage: f64) -> Option<f64> {
        let oracle = self.oracle.as_ref()?.shrinkage()?;
        (oracle > 0.05).then_some(shrinkage / oracle)
    }
}

/// A change of the parameter that sizes an effect beside the true one; none where another one is said to have changed.
fn difference(truth: &SealedEffect, change: &SaidChange) -> Option<SizeCheck> {
    let (parameter, mechanism) = sizing_parameter(truth)?;
    if change.parameter.as_ref().is_some_and(|said| said != parameter) {
        return None;
    }
    let null = if parameter == "ratio" { 1.0 } else { 0.0 };
    let size = truth.library_parameters.get(parameter)? - null;
    let (low, high) = change.difference.low.zip(change.difference.high)?;
    Some(SizeCheck {
        effect: truth.name.clone(),
        parameter: parameter.to_owned(),
        truth: size,
        mechanism: mechanism - null,
        value: change.difference.value?,
        covered: (low..=high).contains(&size),
    })
}

/// What is named in a recorded drive without anything put in, is the drive's own: adds it to what every case of the same drive contains.
pub fn excuse_what_drives_have(answers: &mut [Answer]) {
    let drive = |a: &Answer| a.label.circumstances.get("car").cloned();
    let mut own: Vec<(Option<serde_json::Value>, String)> = Vec::new();
    let untouched = |a: &&Answer| a.label.kind == Kind::None && !a.label.compared;
    for a in answers.iter().filter(|a| a.label.family == Family::Recorded).filter(untouched) {
        own.extend(a.said.names().map(|name| (drive(a), name.to_owned())));
    }
    for answer in answers.iter_mut().filter(|a| a.label.family == Family::Recorded) {
        let here = drive(answer);
        let names = own.iter().filter(|(d, _)| *d == here).map(|(_, name)| name);
        answer.label.contained.extend(names.cloned());
        answer.label.contained.sort();
        answer.label.contained.dedup();
    }
}

fn sizes(truth: &SealedEffect, said: &SaidEffect) -> Vec<SizeCheck> {
    let one = |(parameter, value): (&String, &f64)| {
        let stated = said.parameters.get(parameter)?;
        let ends = stated.low.zip(stated.high);
        Some(SizeCheck {
            effect: truth.name.clone(),
            parameter: parameter.clone(),
            truth: *value,
            mechanism: truth.parameters.get(parameter).copied()?,
            value: stated.value?,
            covered: ends.is_some_and(|(low, high)| (low..=high).contains(value)),
        })
    };
    truth.library_parameters.iter().filter_map(one).collect()
}
