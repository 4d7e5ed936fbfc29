//! From figures to words: verdict, ranking, confidence, what to drive next.

use std::collections::BTreeMap;

use crate::budget::Budget;
use crate::effects::EffectId;
use crate::engine::{Engine, State};
use crate::evaluate::mean;
use crate::outcome::{Comparison, EffectParameter, Look, RankedEffect, Verdict};
use crate::rooms::Left;
use crate::select::{Round, thresholds};
use crate::sizes::{is_told, sizes};

// Fixed on development cases, 2026-11-21: see tests/results/gap.

/// Held-out error of the retuned over that of the nominal model from which it is worth a word.
const WORSE: f64 = 1.2;
/// Confidence from which an effect is named: below even odds it is a candidate.
const LEAST_CONFIDENCE: f64 = 0.5;
/// Share of what could be explained at all on held-out data that the named effects must explain; where the noise is not known, other causes
/// stay beside them.
const LEAST_OF_POSSIBLE: f64 = 0.7;
const LEAST_OF_POSSIBLE_IN_UNKNOWN_NOISE: f64 = 0.5;
/// Held-out excess that is no gap to speak of.
const SMALL_EXCESS: f64 = 0.2;
/// Where the noise is not known: share of what is left that flexible terms explain from which something is missing in the model, mean squared
/// held-out error and weighted cost per residual that are too much for scatter.
const EXPLAINABLE: f64 = 0.2;
const LARGE_ERROR: f64 = 4.0;
const HUGE_COST: f64 = 4.0;
/// Excess of the nominal over the retuned model that makes it a retune.
const RETUNE_EXCESS: f64 = 0.1;

/// An effect that the search found.
#[derive(Debug, Clone)]
pub(crate) struct Claim {
    pub(crate) effect: EffectId,
    /// Chance that it is the cause.
    confidence: f64,
    /// What the data cannot tell from it.
    confused: Vec<EffectId>,
    parameters: BTreeMap<&'static str, EffectParameter>,
    /// Whether it is sure enough, and its size told well enough, to be named.
    pub(crate) named: bool,
}

/// What models leave where the channels count by their noise: with retuned tires, and with the effects found. Nothing where the noise
/// is not known.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Remains<'r> {
    pub(crate) before: &'r Left,
    pub(crate) after: &'r Left,
    /// For each effect found, how much the cost is lower for it, beside the others.
    pub(crate) explained: &'r [f64],
    pub(crate) noise_is_known: bool,
}

impl Remains<'_> {
    /// How much of the trust in an effect found is left, when free terms explain more than it does: an effect that is the cause leaves nothing
    /// to the rooms, a stand-in does.
    fn trust(&self, number: usize, left: f64) -> f64 {
        /// Share of what the effect explains that free terms explain on top, at which the odds are even.
        const EVEN: f64 = 0.033;
        /// Where the noise is not known.
        const UNCERTAIN: f64 = 0.6;
        if !self.noise_is_known {
            return if left < thresholds::SMALL_COST { 1.0 } else { UNCERTAIN };
        }
        let explained = self.explained.get(number).map_or(1e-3, |e| e.max(1e-3));
        (1.0 + (self.after.beyond_usual() / explained / EVEN).powi(2)).recip()
    }
}

/// The effects found, with their confidence. `left` is the cost per residual that the search ended with.
pub(crate) fn claims(
    engine: &Engine<'_>,
    evidence: &[Round],
    state: &State,
    remains: &Remains<'_>,
    blocks: &[usize],
    left: f64,
) -> Vec<Claim> {
    let claim = |(number, (&effect, round)): (usize, (&EffectId, &Round))| {
        let confused = confused(round, effect);
        let confidence = confidence(round, effect, &confused) * remains.trust(number, left);
        let named = confidence >= LEAST_CONFIDENCE && is_told(state, effect, &engine.absent(effect), blocks);
        Claim { effect, confidence, confused, parameters: sizes(state, effect, blocks), named }
    };
    state.named.iter().zip(evidence).enumerate().map(claim).collect()
}

/// The verdict, with its reasons; claims lose their names where the verdict is another one.
pub(crate) fn decide(
    budget: &Budget,
    claims: &mut [Claim],
    remains: &Remains<'_>,
    costs: &[f64],
) -> (Verdict, Vec<String>) {
    let (nominal, retuned, after) = (mean(&budget.nominal), budget.retuned(), budget.after());
    let ceiling = mean(&budget.ceiling).min(after);
    let mut reasons = vec![format!(
        "mean squared rollout error over noise: {nominal:.2} nominal, {retuned:.2} with retuned tires, {after:.2} with the effects, {ceiling:.2} with flexible terms, 1 is noise"
    )];
    if retuned > WORSE * nominal {
        reasons.push("the tires fitted to the training blocks do worse on the held-out ones than the nominal tires: the drive is not alike throughout".to_owned());
    }
    if claims.iter().any(|c| c.named) {
        let possible = retuned - ceiling;
        let reached = (retuned - after) / possible.max(1e-9);
        let least =
            if remains.noise_is_known { LEAST_OF_POSSIBLE } else { LEAST_OF_POSSIBLE_IN_UNKNOWN_NOISE };
        reasons.push(format!(
            "the named effects explain {:.0} % of what could be explained on held-out data",
            100.0 * reached.min(1.0)
        ));
        if possible < SMALL_EXCESS || reached > least {
            return (Verdict::Effects, reasons);
        }
        reasons.push("that is too little: the cause is not, or not only, in the library".to_owned());
        claims.iter_mut().for_each(|c| c.named = false);
    }
    if let Some(best) = claims.first() {
        reasons.push(format!(
            "the best effect, {}, is a candidate with confidence {:.2}: not sure enough, or not well enough told, to be named",
            best.effect.name(),
            best.confidence
        ));
    }
    let something = if remains.noise_is_known {
        if let Some((room, gain)) = remains.before.telling() {
            reasons.push(format!(
                "free terms of {} would take {gain:.2} off the cost per residual of {:.2}: more than where nothing is the matter",
                room.name(),
                remains.before.cost
            ));
        }
        remains.before.tells()
    } else {
        let cost = costs.first().copied().unwrap_or(f64::NAN);
        let explainable = (retuned - ceiling) / (retuned - 1.0).max(1e-9);
        let small = cost < thresholds::SMALL_COST && retuned < LARGE_ERROR;
        !(small || cost < HUGE_COST && explainable < EXPLAINABLE)
    };
    if something {
        reasons.push("no effect of the library explains enough of what the retuned tires leave".to_owned());
        return (Verdict::NoneOfThese, reasons);
    }
    reasons.push(
        "what is left after retuning the tires is within noise and the usual imperfection of the model"
            .to_owned(),
    );
    let retune = nominal - retuned > RETUNE_EXCESS;
    (if retune { Verdict::TireRetuneOnly } else { Verdict::NoGap }, reasons)
}

/// The effects named, then the other candidates.
pub(crate) fn rank(claims: &[Claim], last: &Round, budget: &Budget) -> Vec<RankedEffect> {
    let mut step = 0;
    let mut out: Vec<RankedEffect> = Vec::new();
    let order = claims.iter().filter(|c| c.named).chain(claims.iter().filter(|c| !c.named));
    for claim in order {
        step += usize::from(claim.named);
        out.push(RankedEffect {
            name: claim.effect.name(),
            accepted: claim.named,
            parameters: claim.parameters.clone(),
            gap_closed_fraction: if claim.named {
                budget.closed_by_step(step)
            } else {
                budget.closed_by_candidate(claim.effect)
            },
            confidence: claim.confidence,
            confused_with: claim.confused.iter().map(|e| e.name()).collect(),
        });
    }
    for r in last.refits.iter().filter(|r| claims.iter().all(|c| c.effect != r.effect)) {
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
            cost: round.before.cost / round.before.residuals,
            compared: round
                .refits
                .iter()
                .zip(&round.lead_z)
                .map(|(r, &behind_z)| Comparison {
                    name: r.effect.name(),
                    gain: r.gain / round.before.residuals,
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
fn confidence(round: &Round, effect: EffectId, confused: &[EffectId]) -> f64 {
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
    let gain = best.gain / round.before.residuals;
    let clear = (gain / (gain + FAINT)).max(0.5);
    let believable = if best.relative_size > LARGE && !effect.is_of_a_place() { 0.5 } else { 1.0 };
    (sure(best.z.max(2.0 * DOUBT))
        * if rival.is_finite() { sure(rival) } else { 1.0 }
        * alone
        * clear
        * believable)
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
