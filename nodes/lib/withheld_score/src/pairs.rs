//! Pairs of simulator and car: what was named of what was changed, what structure was missed, and what the patched simulator leaves.

use gripsight_withheld_make::{Kind, SealedEffect};
use serde::{Deserialize, Serialize};

use crate::lines::{at_least, at_most, figure};
use crate::verdict::SaidEffect;
use crate::{Answer, Line, Rate, median};

/// Targets, fixed before the first sealed batch.
const NAMED: f64 = 0.95;
const COVERAGE: [f64; 2] = [0.85, 0.95];
const STRUCTURE: f64 = 0.9;
const FALSE_ALARMS: f64 = 0.02;
/// Error over the noise that the simulator with what was named leaves on another drive: the middle one, and what 95 % are under.
const LEFT: [f64; 2] = [1.5, 3.0];

/// A pair as a row of the published table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PairRow {
    /// Its folder.
    pub case: String,
    /// The simulator that was given.
    pub simulator: String,
    /// The kind of simulator that drove.
    pub car: String,
    /// What it tests.
    pub kind: String,
    /// What was changed.
    pub truth: String,
    /// The smallest change over its detection limit.
    pub severity: Option<f64>,
    /// What was said.
    pub verdict: String,
    /// What was named, with 90 % intervals.
    pub named: String,
    /// What that is not told from.
    pub not_told_from: String,
    /// Whether the answer is right.
    pub right: bool,
    /// Error over the noise of the simulator as it came, on another drive.
    pub before: Option<f64>,
    /// The same with what was named.
    pub after: Option<f64>,
    /// Whether a patch was written.
    pub patch: bool,
    /// Time of the diagnosis.
    pub time_s: f64,
}

/// The score of all pairs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PairScores {
    /// Pairs.
    pub pairs: usize,
    /// Targets beside what was reached.
    pub lines: Vec<Line>,
    /// Right answers by simulator.
    pub by_simulator: std::collections::BTreeMap<String, Rate>,
    /// Every pair.
    pub rows: Vec<PairRow>,
}

impl PairScores {
    /// Scores the pairs.
    #[must_use]
    pub fn of(answers: &[Answer]) -> Self {
        let of = |kind: Kind| answers.iter().filter(move |a| a.label.kind == kind);
        let changes = |kind: Kind| {
            of(kind).flat_map(|a| a.label.effects.iter().map(move |e| (a, e))).collect::<Vec<_>>()
        };
        let (single, two) = (changes(Kind::Single), changes(Kind::Pair));
        let all: Vec<(&Answer, &SealedEffect)> = single.iter().chain(&two).copied().collect();
        let found = |(a, e): &(&Answer, &SealedEffect)| found(a, e).is_some();
        let covered: Vec<bool> = all.iter().filter_map(|(a, e)| covered(a, e)).collect();
        let errors: Vec<f64> = all.iter().filter_map(|(a, e)| relative_error(a, e)).collect();
        // Where the structure is right and something differs.
        let left: Vec<f64> = of(Kind::Single)
            .chain(of(Kind::Pair))
            .filter_map(|a| a.said.other_drive?.after)
            .filter(|v| v.is_finite())
            .collect();
        let patched = answers.iter().filter(|a| a.said.patch.is_some_and(|p| p.written));
        let middle = median(left.clone());
        let extra = of(Kind::Single).chain(of(Kind::Pair));
        let lines = vec![
            at_least(
                "one change: first name right, or in its group",
                Rate::count(of(Kind::Single), first_right),
                NAMED,
            ),
            at_least("changes named, or in a group that is named", Rate::count(&all, found), NAMED),
            at_least("  of pairs of changes", Rate::count(&two, found), NAMED),
            at_most(
                "something named beside what was changed",
                Rate::count(extra, |a| extra_names(a) > 0),
                0.05,
            ),
            within("90 % intervals that hold the change", Rate::count(&covered, |c| *c)),
            Line {
                met: None,
                ..figure("relative error of the size, median", "no target".to_owned(), median(errors), true)
            },
            at_least("missing structure recognised", Rate::count(of(Kind::OutOfLibrary), right), STRUCTURE),
            at_most(
                "false alarms in unchanged pairs",
                Rate::count(of(Kind::None), |a| !right(a)),
                FALSE_ALARMS,
            ),
            figure(
                "error left on another drive, median",
                format!("<= {}", LEFT[0]),
                middle,
                middle <= LEFT[0],
            ),
            at_least("  under 3 times the noise", Rate::count(&left, |v| *v < LEFT[1]), 0.95),
            at_least("patches that help on another drive", Rate::count(patched, helps), 1.0),
        ];
        let mut by_simulator = std::collections::BTreeMap::new();
        for answer in answers {
            let own = answers.iter().filter(|a| fact(a, "simulator") == fact(answer, "simulator"));
            by_simulator.entry(fact(answer, "simulator")).or_insert_with(|| Rate::count(own, right));
        }
        Self { pairs: answers.len(), lines, by_simulator, rows: answers.iter().map(row).collect() }
    }
}

fn within(what: &str, rate: Rate) -> Line {
    let line = at_least(what, rate, COVERAGE[0]);
    let met = line.met.map(|met| met && rate.value() <= COVERAGE[1]);
    Line { wanted: format!("{:.0} to {:.0} %", 100.0 * COVERAGE[0], 100.0 * COVERAGE[1]), met, ..line }
}

/// The named effect that is a change, or whose group holds it.
fn found<'a>(answer: &'a Answer, truth: &SealedEffect) -> Option<&'a SaidEffect> {
    answer.said.accepted().find(|e| e.name == truth.name || e.confused_with.contains(&truth.name))
}

fn first_right(answer: &Answer) -> bool {
    let first = answer.said.accepted().next();
    let is = |e: &SaidEffect, t: &SealedEffect| e.name == t.name || e.confused_with.contains(&t.name);
    first.is_some_and(|e| answer.label.effects.iter().any(|t| is(e, t)))
}

fn extra_names(answer: &Answer) -> usize {
    answer.said.accepted().count().saturating_sub(answer.label.effects.len())
}

/// Whether the interval of a change that is named as what it is holds it.
fn covered(answer: &Answer, truth: &SealedEffect) -> Option<bool> {
    let said = answer.said.accepted().find(|e| e.name == truth.name)?.parameters.values().next()?;
    let value = truth.parameters.values().next()?;
    Some((said.low?..=said.high?).contains(value))
}

fn relative_error(answer: &Answer, truth: &SealedEffect) -> Option<f64> {
    let said = answer.said.accepted().find(|e| e.name == truth.name)?.parameters.values().next()?.value?;
    let value = truth.parameters.values().next()?;
    Some(((said - value) / value).abs())
}

/// Whether the answer is right in the sense of its kind.
fn right(answer: &Answer) -> bool {
    match answer.label.kind {
        Kind::None => answer.said.verdict == "no_gap" && answer.said.accepted().next().is_none(),
        Kind::OutOfLibrary => answer.said.verdict == "missing_structure",
        _ => answer.label.effects.iter().all(|e| found(answer, e).is_some()) && extra_names(answer) == 0,
    }
}

fn helps(answer: &Answer) -> bool {
    answer.said.other_drive.is_some_and(|d| d.after < d.before)
}

fn fact(answer: &Answer, name: &str) -> String {
    answer.label.circumstances.get(name).and_then(|v| v.as_str()).unwrap_or_default().to_owned()
}

fn row(answer: &Answer) -> PairRow {
    let truth = |e: &SealedEffect| {
        let values: Vec<String> = e.parameters.values().map(|v| format!("{v:.4}")).collect();
        format!("{} {}", e.name, values.join(" "))
    };
    let number = |v: Option<f64>| v.map_or_else(|| "?".to_owned(), |v| format!("{v:.4}"));
    let said = |e: &SaidEffect| {
        let sizes = e.parameters.values();
        let sizes = sizes.map(|p| format!("{} ({} .. {})", number(p.value), number(p.low), number(p.high)));
        format!("{} {}", e.name, sizes.collect::<Vec<_>>().join(" "))
    };
    let named: Vec<&SaidEffect> = answer.said.accepted().collect();
    let alike: Vec<&str> = named.iter().flat_map(|e| e.confused_with.iter().map(String::as_str)).collect();
    let other = answer.said.other_drive;
    PairRow {
        case: answer.label.case.clone(),
        simulator: fact(answer, "simulator"),
        car: fact(answer, "car"),
        kind: answer.label.kind.name().to_owned(),
        truth: answer.label.effects.iter().map(truth).collect::<Vec<_>>().join("; "),
        severity: answer.severity(),
        verdict: answer.said.verdict.clone(),
        named: named.iter().map(|e| said(e)).collect::<Vec<_>>().join("; "),
        not_told_from: alike.join("; "),
        right: right(answer),
        before: other.and_then(|d| d.before),
        after: other.and_then(|d| d.after),
        patch: answer.said.patch.is_some_and(|p| p.written),
        time_s: answer.time_s,
    }
}
