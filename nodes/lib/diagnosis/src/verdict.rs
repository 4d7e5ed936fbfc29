//! The verdict with its reasons, and what to drive or record next.

use gripsight_estimation::{interval, mean};
use gripsight_model::{EffectId, Need, Site};

use crate::budget::Budget;
use crate::decisions;
use crate::finding::untried;
use crate::inferred::Inferred;
use crate::outcome::{Invisible, RankedEffect, Verdict};

/// Held-out error of the retuned over that of the nominal model from which it is worth a word.
const WORSE: f64 = 1.2;
/// Probability from which a drive to make sure of a candidate is worth it.
const WORTH_A_DRIVE: f64 = 0.05;
/// Candidates at most that a drive to make sure is proposed for, where nothing is named.
const MOST_TO_MAKE_SURE: usize = 2;
/// Excess of the nominal over the retuned model that makes it a retune.
const RETUNE_EXCESS: f64 = 0.1;

/// The verdict of a drive by itself, with its reasons.
pub(crate) fn decide(budget: &Budget, inferred: &Inferred, library: &[EffectId]) -> (Verdict, Vec<String>) {
    let mut reasons = errors(budget, inferred.accepted().is_empty());
    let named = inferred.accepted();
    let lacking = lacking(inferred);
    for effect in inferred.modelled() {
        let others: Vec<&str> = untried(effect, library).map(EffectId::name).collect();
        let how = if named.contains(&effect) {
            "shares its name with"
        } else {
            "stands in the model for itself or"
        };
        if !others.is_empty() {
            reasons.push(format!(
                "{} {how} {}, which does nearly the same and was not among the candidates",
                effect.name(),
                others.join(" and ")
            ));
        }
    }
    reasons.extend(lacking.iter().map(|(site, p)| {
        format!(
            "something is the matter at the site {} that no effect of the library does (probability {p:.2})",
            site.name()
        )
    }));
    if !named.is_empty() {
        return (Verdict::Effects, reasons);
    }
    for effect in inferred.candidates() {
        let Some(statement) = inferred.statement(effect) else { continue };
        if statement.refuted {
            reasons.push(format!(
                "{} makes the errors of rollouts on held-out data larger: it is no cause",
                effect.name()
            ));
            continue;
        }
        reasons.push(format!(
            "{} is a candidate (chance {:.2}): it closes {:.1} % of the held-out error that is left without it, its size is {:.1} half widths of its interval, and it explains {:.1} times what of the unexplained looks like it",
            effect.name(),
            statement.chance(),
            100.0 * statement.closes,
            statement.size_over_half_width,
            statement.over_unexplained.min(99.0)
        ));
    }
    // Something is there that has no name: what does nearly the same is not among the candidates.
    let unnamed = |e: &EffectId| {
        inferred.statement(*e).is_some() && inferred.probability_of_alike(*e) >= decisions::NAMED
    };
    let left = interval(budget.steps.last());
    let missing = left.low > decisions::SOUND_ERROR;
    if missing {
        reasons.push(format!(
            "{:.1} times the noise is left, at least {:.1}, where drives without any effect leave {} at most: something is missing that no effect of the library does",
            left.value,
            left.low,
            decisions::SOUND_ERROR
        ));
    }
    let verdict = if missing || !lacking.is_empty() || inferred.candidates().iter().any(unnamed) {
        Verdict::NoneOfThese
    } else if mean(&budget.nominal) - budget.retuned() > RETUNE_EXCESS {
        Verdict::TireRetuneOnly
    } else {
        Verdict::NoGap
    };
    (verdict, reasons)
}

/// Errors of the models, in a sentence, and what they say of the drive.
pub(crate) fn errors(budget: &Budget, nothing_named: bool) -> Vec<String> {
    let (nominal, retuned, after) = (mean(&budget.nominal), budget.retuned(), budget.after());
    let ceiling = mean(&budget.ceiling).min(after);
    let with_effects = if nothing_named { String::new() } else { format!(", {after:.2} with the effects") };
    let mut reasons = vec![format!(
        "mean squared rollout error over noise: {nominal:.2} nominal, {retuned:.2} with retuned tires{with_effects}, {ceiling:.2} with flexible terms, 1 is noise"
    )];
    if retuned > WORSE * nominal {
        reasons.push("the tires fitted to the training blocks do worse on the held-out ones than the nominal tires: the drive is not alike throughout".to_owned());
    }
    reasons
}

/// The sites at which flexible terms are likelier needed than not, the likeliest first.
fn lacking(inferred: &Inferred) -> Vec<(Site, f64)> {
    let mut out: Vec<(Site, f64)> = Site::ALL
        .into_iter()
        .map(|site| (site, inferred.other(site)))
        .filter(|(_, p)| *p >= decisions::LIKELY)
        .collect();
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    out
}

/// What would have to be recorded to see what these signals cannot show, where something is to be explained.
pub(crate) fn record_next(verdict: Verdict, invisible: &[Invisible]) -> Vec<String> {
    let mut needs: Vec<Need> = invisible.iter().map(|i| i.need).collect();
    needs.sort_unstable();
    needs.dedup();
    // Other tires are what a change of grip looks like; all else is of no use where nothing is left.
    needs.retain(|need| match verdict {
        Verdict::NoGap => false,
        Verdict::TireRetuneOnly => *need == Need::ReferenceTires,
        _ => true,
    });
    let line = |need: Need| {
        let names: Vec<&str> = invisible.iter().filter(|i| i.need == need).map(|i| i.name).collect();
        format!("to see {}: {}", names.join(", "), need.remedy())
    };
    needs.into_iter().map(line).collect()
}

/// What would split the groups and sharpen what was not seen.
pub(crate) fn drive_next(effects: &[RankedEffect]) -> Vec<String> {
    let mut out = Vec::new();
    for e in effects.iter().filter(|e| e.accepted && !e.confused_with.is_empty()) {
        let mut manoeuvres: Vec<&str> = std::iter::once(e.name)
            .chain(e.confused_with.iter().copied())
            .filter_map(EffectId::by_name)
            .map(|id| id.spec().excitation)
            .collect();
        // Some of a group ask for the same driving, not always next to each other.
        manoeuvres.sort_unstable();
        manoeuvres.dedup();
        out.push(format!(
            "to tell {} from {}: {}",
            e.name,
            e.confused_with.join(", "),
            manoeuvres.join("; ")
        ));
    }
    if !effects.iter().any(|e| e.accepted) {
        let candidates = effects.iter().filter(|e| e.confidence > WORTH_A_DRIVE).take(MOST_TO_MAKE_SURE);
        for id in candidates.filter_map(|e| EffectId::by_name(e.name)) {
            out.push(format!("to make sure of {}: {}", id.name(), id.spec().excitation));
        }
    }
    out
}
