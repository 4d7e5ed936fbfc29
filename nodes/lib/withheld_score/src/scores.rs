//! All cases judged: rates by family of plants, by effect, and against the targets.

use std::collections::BTreeMap;

use gripsight_withheld_make::{Family, Kind};
use serde::{Deserialize, Serialize};

use crate::calibration::{Calibration, calibration};
use crate::judge::{Answer, SizeCheck};
use crate::lines::{Line, finite, lines};
use crate::rate::median;
use crate::{Control, Rate, Targets};

/// How often an effect is named, by severity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectScore {
    /// Canonical name.
    pub name: String,
    /// Named rightly (as one of the names), by the bands of [`SEVERITY_BANDS`].
    pub by_severity: Vec<Rate>,
    /// Severity from which it is named rather than not: the one that errs in the fewest cases.
    pub named_from_severity: Option<f64>,
    /// Median of the detection limits by the generator's own fit, in the unit of the first parameter.
    pub oracle_limit: Option<f64>,
    /// Ratio of stated to true size over rightly named cases, median.
    pub size_ratio: Option<f64>,
    /// Intervals that hold the truth.
    pub coverage: Rate,
}

/// Bounds of the bands of severity: below 1, 1 to 2, 2 to 5, above.
pub const SEVERITY_BANDS: [f64; 5] = [0.0, 1.0, 2.0, 5.0, f64::INFINITY];

/// Scores of one family of plants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FamilyScore {
    /// The family.
    pub family: Family,
    /// Cases.
    pub cases: usize,
    /// Targets and what was reached, on the cases that they speak of.
    pub lines: Vec<Line>,
    /// Right verdicts by kind over all cases, those below the detection limit too.
    pub by_kind: BTreeMap<String, Rate>,
    /// Right first names by method, single effects within the scope of the targets.
    pub baselines: BTreeMap<String, Rate>,
    /// What was said (columns) of what was true (rows).
    pub confusion: BTreeMap<String, BTreeMap<String, usize>>,
    /// Stated confidence.
    pub calibration: Calibration,
}

/// A case that a target speaks of and that was not answered rightly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Miss {
    /// Its name.
    pub case: String,
    /// What it tests.
    pub kind: Kind,
    /// What was true.
    pub truth: String,
    /// What was said.
    pub said: String,
    /// Severity.
    pub severity: Option<f64>,
    /// What the same engine shrinks, told the names, over what it shrank untold.
    pub shrinkage_over_oracle: Option<f64>,
    /// Car, track, pace.
    pub circumstances: String,
}

/// The whole score.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    /// The targets.
    pub targets: Targets,
    /// Families of plants that have cases.
    pub families: Vec<FamilyScore>,
    /// Effects of the reference car.
    pub effects: Vec<EffectScore>,
    /// Sizes of rightly named effects.
    pub sizes: Vec<SizeCheck>,
    /// Shrinkage on held-out bags: (oracle, blind).
    pub shrinkage: Vec<[f64; 2]>,
    /// The control on files alone, by family.
    pub control: BTreeMap<String, Control>,
    /// Misses within the scope of the targets.
    pub misses: Vec<Miss>,
}

impl Scores {
    /// Scores answers. `control` is the score of the classifier on files alone.
    #[must_use]
    pub fn of(answers: &[Answer], control: BTreeMap<String, Control>, targets: Targets) -> Self {
        let families = Family::ALL
            .into_iter()
            .map(|family| (family, answers.iter().filter(|a| a.label.family == family).collect::<Vec<_>>()))
            .filter(|(_, own)| !own.is_empty())
            .map(|(family, own)| family_score(family, &own, &targets))
            .collect();
        let reference: Vec<&Answer> =
            answers.iter().filter(|a| a.label.family == Family::Reference).collect();
        let shrinkage = answers
            .iter()
            .filter_map(|a| Some([a.oracle.as_ref()?.shrinkage()?, a.said.shrinkage()?]))
            .collect();
        let misses = answers.iter().filter(|a| a.in_scope(&targets) && !a.right()).map(miss).collect();
        Self {
            effects: effect_scores(&reference),
            sizes: answers.iter().flat_map(Answer::sizes).collect(),
            families,
            shrinkage,
            control,
            misses,
            targets,
        }
    }
}

pub(crate) fn of_kind<'a>(answers: &[&'a Answer], kind: Kind) -> Vec<&'a Answer> {
    answers.iter().filter(|a| a.label.kind == kind).copied().collect()
}

fn family_score(family: Family, own: &[&Answer], targets: &Targets) -> FamilyScore {
    let scope: Vec<&Answer> = own.iter().filter(|a| a.in_scope(targets)).copied().collect();
    let by_kind = Kind::ALL
        .into_iter()
        .map(|kind| (kind.name().to_owned(), Rate::count(of_kind(own, kind), |a| a.right())))
        .filter(|(_, rate)| rate.of > 0)
        .collect();
    let singles = of_kind(&scope, Kind::Single);
    let mut baselines = BTreeMap::new();
    for method in singles.iter().flat_map(|a| a.baselines.keys()) {
        let right =
            |a: &&Answer| a.baselines.get(method).is_some_and(|name| *name == a.label.effects[0].name);
        baselines.entry(method.clone()).or_insert_with(|| Rate::count(&singles, right));
    }
    let statements: Vec<(f64, bool)> = own
        .iter()
        .filter_map(|a| {
            let first = a.first_named()?;
            let right = a.label.kind != Kind::Deleted && a.label.effects.iter().any(|e| e.name == first.name);
            Some((first.confidence?, right))
        })
        .collect();
    let calibration = calibration(&statements);
    let mut confusion: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    for answer in own.iter().filter(|a| a.label.kind != Kind::Pair) {
        let row = confusion.entry(row_name(answer)).or_default();
        *row.entry(answer.first().to_owned()).or_default() += 1;
    }
    let mut lines = lines(&scope, own, &calibration, targets);
    if family == Family::Recorded && own.iter().any(|a| !a.label.compared) {
        // What a recorded car has of its own nobody knows: nothing named there is known to be false.
        lines.retain(|line| !line.what.starts_with("no effect"));
    }
    FamilyScore { family, cases: own.len(), lines, by_kind, baselines, confusion, calibration }
}

fn row_name(answer: &Answer) -> String {
    let names: Vec<&str> = answer.label.effects.iter().map(|e| e.name.as_str()).collect();
    match answer.label.kind {
        Kind::None => "(no effect)".to_owned(),
        Kind::Deleted => format!("(left out) {}", names.join(" + ")),
        Kind::OutOfLibrary => format!("(not in the library) {}", names.join(" + ")),
        Kind::Single | Kind::Pair => names.join(" + "),
    }
}

fn effect_scores(reference: &[&Answer]) -> Vec<EffectScore> {
    // (severity, named) of every effect that could have been named.
    let mut seen: BTreeMap<&str, Vec<(f64, bool)>> = BTreeMap::new();
    let mut limits: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    let mut sizes: BTreeMap<String, Vec<SizeCheck>> = BTreeMap::new();
    for answer in reference.iter().filter(|a| matches!(a.label.kind, Kind::Single | Kind::Pair)) {
        for effect in &answer.label.effects {
            let Some(oracle) = effect.oracle else { continue };
            let named = answer.names().any(|name| name == effect.name);
            seen.entry(&effect.name).or_default().push((oracle.severity, named));
            if let Some(limit) = limit(effect) {
                limits.entry(&effect.name).or_default().push(limit);
            }
        }
        for size in answer.sizes() {
            sizes.entry(size.effect.clone()).or_default().push(size);
        }
    }
    seen.into_iter()
        .map(|(name, cases)| {
            let band = |b: &[f64]| {
                let inside = cases.iter().filter(|c| (b[0]..b[1]).contains(&c.0));
                Rate::count(inside, |c| c.1)
            };
            let own = sizes.remove(name).unwrap_or_default();
            EffectScore {
                name: name.to_owned(),
                by_severity: SEVERITY_BANDS.windows(2).map(band).collect(),
                named_from_severity: named_from(&cases),
                oracle_limit: finite(median(limits.remove(name).unwrap_or_default())),
                size_ratio: finite(median(own.iter().map(|s| s.value / s.truth).collect())),
                coverage: Rate::count(&own, |s| s.covered),
            }
        })
        .collect()
}

/// The detection limit in the unit of the effect's first parameter that sizes it.
fn limit(effect: &gripsight_withheld_make::SealedEffect) -> Option<f64> {
    let severity = effect.oracle?.severity;
    let (name, value) = gripsight_withheld_make::sizing_parameter(effect)?;
    let null = if name == "ratio" { 1.0 } else { 0.0 };
    Some((value - null).abs() / severity)
}

/// The severity that parts named from unnamed cases with the fewest errors.
fn named_from(cases: &[(f64, bool)]) -> Option<f64> {
    let errors = |limit: f64| cases.iter().filter(|c| (c.0 >= limit) != c.1).count();
    let limits = cases.iter().map(|c| c.0).chain([f64::INFINITY]);
    limits.min_by_key(|l| errors(*l)).filter(|l| l.is_finite())
}

fn miss(answer: &Answer) -> Miss {
    let names: Vec<&str> = answer.label.effects.iter().map(|e| e.name.as_str()).collect();
    let said: Vec<&str> = answer.said.names().collect();
    let fact = |key: &str| {
        answer.label.circumstances.get(key).map_or_else(String::new, |v| match v.as_f64() {
            Some(number) => format!("{key} {number:.2}"),
            None => v.to_string().replace('"', ""),
        })
    };
    Miss {
        case: answer.label.case.clone(),
        kind: answer.label.kind,
        truth: names.join(" + "),
        said: if said.is_empty() { answer.said.verdict.clone() } else { said.join(" + ") },
        severity: answer.severity(),
        shrinkage_over_oracle: answer.shrinkage_over_oracle(),
        circumstances: ["car", "track", "pace", "noise"].map(fact).join(", "),
    }
}
