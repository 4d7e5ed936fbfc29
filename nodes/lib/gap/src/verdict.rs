//! From figures to words: verdict, ranking, confidence, what to drive next.

use crate::budget::Budget;
use crate::effects::EffectId;
use crate::engine::{Engine, State};
use crate::evaluate::mean;
use crate::outcome::{Comparison, Look, RankedEffect, Verdict};
use crate::select::{Round, thresholds};
use crate::sizes::sizes;

/// Held-out error of the retuned over that of the nominal model from which it is worth a word.
const WORSE: f64 = 1.2;
/// Share of what the retuned tires leave that the named effects must explain, where they leave more than is usual.
const LEAST_EXPLAINED: f64 = 0.65;
/// The same of what could be explained at all, where the noise is not known.
const LEAST_OF_POSSIBLE: f64 = 0.5;
/// Share of what is left that flexible terms explain from which something is missing in the model; less is scatter.
const EXPLAINABLE: f64 = 0.2;
/// Mean squared held-out error over noise that is more than the usual imperfection of the model.
const LARGE_ERROR: f64 = 4.0;
/// Weighted cost per residual that is too much for scatter.
const HUGE_COST: f64 = 4.0;
/// Excess of the nominal over the retuned model that makes it a retune.
const RETUNE_EXCESS: f64 = 0.1;

/// The verdict, with its reasons.
pub(crate) fn decide(
    budget: &Budget,
    last: &Round,
    state: &State,
    costs: &[f64],
    noise_is_known: bool,
) -> (Verdict, Vec<String>) {
    let (nominal, retuned, after) = (mean(&budget.nominal), budget.retuned(), budget.after());
    let ceiling = mean(&budget.ceiling).min(after);
    let mut reasons = vec![format!(
        "mean squared rollout error over noise: {nominal:.2} nominal, {retuned:.2} with retuned tires, {after:.2} with the effects, {ceiling:.2} with flexible terms, 1 is noise"
    )];
    if retuned > WORSE * nominal {
        reasons.push("the tires fitted to the training blocks do worse on the held-out ones than the nominal tires: the drive is not alike throughout".to_owned());
    }
    let left = costs.last().copied().unwrap_or(f64::NAN);
    let small = left < thresholds::SMALL_COST;
    let explainable = (after - ceiling) / (after - 1.0).max(1e-9);
    if state.named.is_empty() {
        if (small && after < LARGE_ERROR) || (left < HUGE_COST && explainable < EXPLAINABLE) {
            let retune = nominal - retuned > RETUNE_EXCESS;
            reasons.push("what is left after retuning the tires is within noise and the usual imperfection of the model".to_owned());
            return (if retune { Verdict::TireRetuneOnly } else { Verdict::NoGap }, reasons);
        }
        reasons.push(format!("flexible terms would explain {:.0} % of what is left", 100.0 * explainable));
        if let Some(best) = last.winner() {
            reasons.push(format!(
                "the best effect, {}, does not explain enough of it to be named",
                best.effect.name()
            ));
        }
        return (Verdict::NoneOfThese, reasons);
    }
    let closed = (retuned - after) / (retuned - 1.0).max(1e-9);
    reasons.push(format!(
        "the named effects explain {:.0} % of what the retuned tires leave; flexible terms would explain {:.0} % of the rest",
        100.0 * closed,
        100.0 * explainable
    ));
    // Where the noise cannot be told, only what flexible terms reach says what is possible at all.
    let enough = if noise_is_known {
        closed > LEAST_EXPLAINED || explainable < EXPLAINABLE
    } else {
        retuned - after > LEAST_OF_POSSIBLE * (retuned - ceiling)
    };
    if (!small || after > LARGE_ERROR) && !enough {
        reasons.push("that is too little: the cause is not, or not only, in the library".to_owned());
        return (Verdict::NoneOfThese, reasons);
    }
    (Verdict::Effects, reasons)
}

/// The effects named, then the rest of the last look.
pub(crate) fn rank(
    evidence: &[Round],
    last: &Round,
    state: &State,
    budget: &Budget,
    blocks: &[usize],
    left: f64,
) -> Vec<RankedEffect> {
    let mut out: Vec<RankedEffect> = Vec::new();
    for (step, (&effect, round)) in state.named.iter().zip(evidence).enumerate() {
        let confused = confused(round, effect);
        out.push(RankedEffect {
            name: effect.name(),
            accepted: true,
            parameters: sizes(state, effect, blocks),
            gap_closed_fraction: budget.closed_by_step(step + 1),
            confidence: confidence(round, effect, &confused, left),
            confused_with: confused.iter().map(|e| e.name()).collect(),
        });
    }
    for r in last.refits.iter().filter(|r| !state.named.contains(&r.effect)) {
        out.push(RankedEffect {
            name: r.effect.name(),
            accepted: false,
            parameters: sizes(&r.state, r.effect, &last.blocks),
            gap_closed_fraction: budget.closed_by_candidate(r.effect),
            confidence: 0.0,
            confused_with: Vec::new(),
        });
    }
    out
}

/// How the effects compared, for the record.
pub(crate) fn looks(engine: &Engine<'_>, evidence: &[Round], last: &Round, state: &State) -> Vec<Look> {
    let abouts = state.named.iter().map(|e| Some(*e)).chain([None]);
    abouts
        .zip(evidence.iter().chain([last]))
        .map(|(about, round)| Look {
            about: about.map(EffectId::name),
            cost: round.before.cost / round.before.residuals(),
            compared: round
                .refits
                .iter()
                .zip(&round.lead_z)
                .map(|(r, &behind_z)| Comparison {
                    name: r.effect.name(),
                    gain: r.gain / round.before.residuals(),
                    z: r.z,
                    behind_z,
                    alike: round.winner().map_or(0.0, |w| round.screening.cosine(w.effect, r.effect)),
                    relative_size: r.relative_size,
                    tire_shift: engine.tire_shift(&r.state),
                })
                .collect(),
        })
        .collect()
}

/// What a round cannot tell from an effect.
fn confused(round: &Round, effect: EffectId) -> Vec<EffectId> {
    let Some(place) = round.refits.iter().position(|r| r.effect == effect) else { return Vec::new() };
    let best = &round.refits[place];
    round
        .refits
        .iter()
        .zip(&round.lead_z)
        .filter(|(r, _)| r.effect != effect)
        .filter(|(r, z)| {
            let near = best.gain - r.gain < thresholds::NEAR_SHARE * best.gain;
            let alike = round.screening.cosine(effect, r.effect) > thresholds::CONFUSED_COSINE;
            let rival = r.gain > thresholds::RIVAL_SHARE * best.gain;
            (rival && **z < thresholds::CONFUSED_Z) || (near && alike)
        })
        .map(|(r, _)| r.effect)
        .collect()
}

/// Chance that the winner of a round is the cause: that it beats the model without it, and every rival outside its group.
fn confidence(round: &Round, effect: EffectId, confused: &[EffectId], left: f64) -> f64 {
    /// Leads are less sure than their standard deviation says: models are wrong in ways that blocks share.
    const DOUBT: f64 = 2.5;
    const MOST: f64 = 0.97;
    /// A drop of the cost per residual that is as likely as not something else.
    const FAINT: f64 = 0.015;
    /// Sizes beyond this, over the size that matters, are seldom true.
    const LARGE: f64 = 3.2;
    let Some(best) = round.refits.iter().find(|r| r.effect == effect) else { return 0.0 };
    let rival = round
        .refits
        .iter()
        .zip(&round.lead_z)
        .filter(|(r, _)| r.effect != effect && !confused.contains(&r.effect))
        .map(|(_, z)| *z)
        .fold(f64::INFINITY, f64::min);
    let sure = |z: f64| normal(z / DOUBT);
    let alone = 1.0 / (1.0 + confused.len() as f64 * 0.5);
    let gain = best.gain / round.before.residuals();
    let clear = (gain / (gain + FAINT)).max(0.5);
    let believable = if best.relative_size > LARGE { 0.5 } else { 1.0 };
    let explained = if left < thresholds::SMALL_COST { 1.0 } else { 0.6 };
    (sure(best.z.max(2.0 * DOUBT))
        * if rival.is_finite() { sure(rival) } else { 1.0 }
        * alone
        * clear
        * believable
        * explained)
        .min(MOST)
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
