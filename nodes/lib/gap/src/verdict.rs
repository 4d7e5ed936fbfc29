//! From figures to words: verdict, ranking, confidence, what to drive next.

use std::collections::BTreeMap;

use crate::budget::Budget;
use crate::effects::EffectId;
use crate::engine::State;
use crate::evaluate::mean;
use crate::model::BASE;
use crate::outcome::{EffectParameter, RankedEffect, Verdict};
use crate::select::{Round, thresholds};

/// Excess of the retuned model over the noise below which there is no gap to explain: slow sensor noise and the background that any real car
/// has against a single-track model.
const SMALL_EXCESS: f64 = 0.3;
/// Held-out error of the retuned over that of the nominal model from which it is worth a word.
const WORSE: f64 = 1.2;
/// Share of what could be explained at all that the named effects must explain.
const LEAST_EXPLAINED: f64 = 0.5;
/// Excess of the nominal over the retuned model that makes it a retune.
const RETUNE_EXCESS: f64 = 0.1;

/// The verdict, with its reasons.
pub(crate) fn decide(
    budget: &Budget,
    rounds: &[Round],
    state: &State,
    instead: bool,
) -> (Verdict, Vec<String>) {
    let (nominal, retuned, after) = (mean(&budget.nominal), budget.retuned(), budget.after());
    let ceiling = mean(&budget.ceiling).min(after);
    let mut reasons = vec![format!(
        "mean squared rollout error over noise: {nominal:.2} nominal, {retuned:.2} with retuned tires, {after:.2} with the effects, {ceiling:.2} with flexible terms, 1 is noise"
    )];
    if retuned > WORSE * nominal {
        reasons.push("the tires fitted to the training blocks do worse on the held-out ones than the nominal tires: the drive is not alike throughout".to_owned());
    }
    let weighted = rounds.last().map_or(f64::INFINITY, |r| r.before.cost / r.before.residuals());
    let small = weighted < thresholds::SMALL_COST;
    let excess = retuned - 1.0;
    if state.effects.is_empty() {
        let best = rounds.first().and_then(|r| r.refits.first());
        if small || excess < SMALL_EXCESS {
            let retune = nominal - retuned > RETUNE_EXCESS;
            reasons.push("what is left after retuning the tires is within noise and the usual imperfection of the model".to_owned());
            return (if retune { Verdict::TireRetuneOnly } else { Verdict::NoGap }, reasons);
        }
        if nominal - retuned > LEAST_EXPLAINED * (nominal - ceiling) {
            reasons.push("other tires explain most of what could be explained".to_owned());
            return (Verdict::TireRetuneOnly, reasons);
        }
        let explainable = (retuned - ceiling) / excess;
        reasons.push(format!("flexible terms would explain {:.0} % of the gap", 100.0 * explainable));
        if let Some(best) = best {
            reasons.push(format!(
                "the best effect, {}, does not explain enough of it to be named",
                best.effect.name()
            ));
        }
        return (Verdict::NoneOfThese, reasons);
    }
    if instead {
        let explained = (nominal - after) / (nominal - ceiling).max(1e-9);
        reasons.push(format!(
            "with the tires as they were handed over the effect explains {:.0} % of the gap; other tires would explain as much",
            100.0 * explained
        ));
        let verdict = if explained > LEAST_EXPLAINED { Verdict::Effects } else { Verdict::TireRetuneOnly };
        return (verdict, reasons);
    }
    let possible = (retuned - ceiling).max(1e-9);
    let explained = (retuned - after) / possible;
    reasons.push(format!("the named effects explain {:.0} % of what could be explained", 100.0 * explained));
    if explained < LEAST_EXPLAINED && !small && after - 1.0 > SMALL_EXCESS {
        reasons.push("that is too little: the cause is not, or not only, in the library".to_owned());
        return (Verdict::NoneOfThese, reasons);
    }
    (Verdict::Effects, reasons)
}

/// All effects that were refitted: those taken in their order, then the rest of the first round.
pub(crate) fn rank(rounds: &[Round], state: &State, budget: &Budget) -> Vec<RankedEffect> {
    let mut out: Vec<RankedEffect> = Vec::new();
    let mut step = 0;
    for round in rounds {
        let Some(best) = round.taken.and_then(|i| round.refits.get(i)) else { continue };
        if !state.effects.contains(&best.effect) {
            continue;
        }
        step += 1;
        let fraction = budget.closed_by_step(step);
        let confused = confused(round);
        out.push(RankedEffect {
            name: best.effect.name(),
            accepted: true,
            parameters: parameters(state, best.effect),
            gap_closed_fraction: fraction,
            confidence: confidence(round, &confused),
            confused_with: confused.iter().map(|e| e.name()).collect(),
        });
    }
    let Some(last) = last_look(rounds) else { return out };
    for r in &last.refits {
        if out.iter().any(|e| e.name == r.effect.name()) {
            continue;
        }
        out.push(RankedEffect {
            name: r.effect.name(),
            accepted: false,
            parameters: parameters(&r.state, r.effect),
            gap_closed_fraction: budget.closed_by_candidate(r.effect),
            confidence: 0.0,
            confused_with: Vec::new(),
        });
    }
    out
}

/// The round whose candidates were not taken; else the first.
pub(crate) fn last_look(rounds: &[Round]) -> Option<&Round> {
    rounds.iter().rev().find(|r| r.taken.is_none()).or(rounds.first())
}

/// What a round cannot tell from its winner.
fn confused(round: &Round) -> Vec<EffectId> {
    let Some(best) = round.refits.first() else { return Vec::new() };
    let place = |e: EffectId| round.screening.candidates.iter().position(|c| c.effect == e);
    round
        .refits
        .iter()
        .zip(&round.lead_z)
        .skip(1)
        .filter(|(r, z)| {
            let near = best.gain - r.gain < thresholds::NEAR_SHARE * best.gain;
            let alike = match (place(best.effect), place(r.effect)) {
                (Some(a), Some(b)) => round.screening.cosine[(a, b)] > thresholds::CONFUSED_COSINE,
                _ => false,
            };
            **z < thresholds::CONFUSED_Z || (near && alike)
        })
        .map(|(r, _)| r.effect)
        .collect()
}

/// Chance that the winner of a round is the cause: that it beats the model without it, and every rival outside its group.
fn confidence(round: &Round, confused: &[EffectId]) -> f64 {
    /// Leads are less sure than their standard deviation says: models are wrong in ways that blocks share.
    const DOUBT: f64 = 2.5;
    const MOST: f64 = 0.98;
    let Some(best) = round.refits.first() else { return 0.0 };
    let rival = round
        .refits
        .iter()
        .zip(&round.lead_z)
        .skip(1)
        .filter(|(r, _)| !confused.contains(&r.effect))
        .map(|(_, z)| *z)
        .fold(f64::INFINITY, f64::min);
    let sure = |z: f64| normal(z / DOUBT);
    let alone = 1.0 / (1.0 + confused.len() as f64 * 0.5);
    (sure(best.z) * if rival.is_finite() { sure(rival) } else { 1.0 } * alone).min(MOST)
}

/// Standard normal distribution function (Abramowitz and Stegun 26.2.17, error below 1e-7).
fn normal(z: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * z.abs());
    let poly = t
        * (0.319_381_530
            + t * (-0.356_563_782 + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    let tail = (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt() * poly;
    if z > 0.0 { 1.0 - tail } else { tail }
}

/// Parameters of an effect as reported, with 90 % intervals from the fit's covariance, robust to errors that windows share.
fn parameters(state: &State, effect: EffectId) -> BTreeMap<&'static str, EffectParameter> {
    let spec = effect.spec();
    let Some(own) = state.of(effect) else { return BTreeMap::new() };
    let mut from = BASE;
    for e in state.effects.iter().take_while(|e| **e != effect) {
        from += e.spec().parameters.len();
    }
    let errors: Vec<f64> = (0..own.len())
        .map(|i| state.fit.as_ref().and_then(|f| f.standard_error(from + i)).unwrap_or(f64::NAN))
        .collect();
    if spec.reported.is_empty() {
        return spec
            .parameters
            .iter()
            .enumerate()
            .map(|(i, r)| {
                let half = 1.645 * errors[i];
                let p =
                    EffectParameter { value: own[i], low: own[i] - half, high: own[i] + half, unit: r.unit };
                (r.name, p)
            })
            .collect();
    }
    spec.reported
        .iter()
        .map(|r| {
            let value = (r.value)(own);
            // Ends from moving each fitted parameter by its own interval.
            let (mut low, mut high) = (value, value);
            for i in 0..own.len() {
                for sign in [-1.645, 1.645] {
                    let mut moved = own.to_vec();
                    moved[i] += sign * if errors[i].is_finite() { errors[i] } else { 0.0 };
                    let v = (r.value)(&moved);
                    low = low.min(v);
                    high = high.max(v);
                }
            }
            (r.name, EffectParameter { value, low, high, unit: r.unit })
        })
        .collect()
}

/// What would split the groups and sharpen what was not seen.
pub(crate) fn drive_next(effects: &[RankedEffect]) -> Vec<String> {
    let mut out = Vec::new();
    for e in effects.iter().filter(|e| e.accepted && !e.confused_with.is_empty()) {
        let manoeuvres: Vec<String> = std::iter::once(e.name)
            .chain(e.confused_with.iter().copied())
            .filter_map(EffectId::by_name)
            .map(|id| format!("{} ({})", id.spec().excitation, id.name()))
            .collect();
        out.push(format!(
            "to tell {} from {}: {}",
            e.name,
            e.confused_with.join(", "),
            manoeuvres.join("; ")
        ));
    }
    out
}
