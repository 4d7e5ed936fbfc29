//! From figures to words: verdict, ranking, confidence, what to drive next.

use crate::budget::Budget;
use crate::confidence::{LEAST_CHANCE, Signs};
use crate::engine::Engine;
use crate::outcome::{Comparison, Invisible, Look, RankedEffect, Verdict};
use crate::rooms::Left;
use crate::select::{Round, thresholds};
use crate::sizes::{is_told, sizes};
use crate::state::State;
use crate::transfer::UNTRIED;
use crate::trust::TireTrust;
use gripsight_estimation::{Windows, mean};
use gripsight_model::{EffectId, Need};

// Fixed on development cases, 2026-11-21: see tests/results/gap.

/// Held-out error of the retuned over that of the nominal model from which it is worth a word.
const WORSE: f64 = 1.2;
/// Size over the size that matters below which a candidate is at its null: it is not listed.
const LEAST_LISTED: f64 = 0.01;
/// Where the noise is not known: share of what is left that flexible terms explain from which something is missing in the model, mean squared
/// held-out error and weighted cost per residual that are too much for scatter.
const EXPLAINABLE: f64 = 0.2;
const LARGE_ERROR: f64 = 4.0;
const HUGE_COST: f64 = 4.0;
/// Confidence from which a drive to make sure of a candidate is worth it.
const WORTH_A_DRIVE: f64 = 0.05;
/// Iterations of a fit with what every car has beside an effect.
const COMPANY: usize = 6;
/// Candidates at most that a drive to make sure is proposed for, where nothing is named.
const MOST_TO_MAKE_SURE: usize = 2;
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
    /// What does nearly the same and was not among the candidates.
    untried: Vec<EffectId>,
    /// What speaks against naming it.
    doubts: Vec<String>,
    /// How far its size drifts between data, and with what every car has beside it.
    drift: f64,
    /// Whether it is sure enough, and its size told well enough, to be named.
    pub(crate) named: bool,
}

/// What models leave where the channels count by their noise: with retuned tires, and with the effects found. Nothing where the noise
/// is not known.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Remains<'r> {
    /// Of a drive from before; nothing where there is none.
    pub(crate) norm: &'r Left,
    pub(crate) before: &'r Left,
    pub(crate) after: &'r Left,
    /// For each effect found, how much the cost is lower for it, beside the others.
    pub(crate) explained: &'r [f64],
    /// For each effect found, how far its size drifts.
    pub(crate) drifts: &'r [f64],
    pub(crate) noise_is_known: bool,
}

/// The effects found, with their confidence.
pub(crate) fn claims(
    engine: &Engine<'_>,
    evidence: &[Round],
    state: &State,
    remains: &Remains<'_>,
    library: &[EffectId],
    blocks: &[usize],
) -> Vec<Claim> {
    // The chance was fitted on tires from a file. Those of a drive are trusted more, and shift by more of it; where none were handed over, a
    // shift says nothing.
    let by_file = Engine { trust: engine.trust.at_most(TireTrust::file()), ..engine.clone() };
    let tire_shift =
        |of: &State| if engine.trust == TireTrust::free() { 0.0 } else { by_file.tire_shift(of) };
    let signs = |(number, (&effect, round)): (usize, (&EffectId, &Round))| {
        let found = round.refits.iter().find(|r| r.effect == effect);
        Signs {
            left: remains.after.most(),
            left_in_its_room: remains.after.of(effect.room()),
            is_along: effect.is_along(),
            explained: remains.explained.get(number).copied().unwrap_or_default(),
            drift: remains.drifts.get(number).copied().unwrap_or(f64::INFINITY),
            confused: confused(round, effect).len(),
            untried: untried(effect, library).count(),
            tire_shift: found.map_or(f64::INFINITY, |r| tire_shift(&r.state)),
            doubtful_beside: 0.0,
        }
    };
    let alone: Vec<Signs> = state.named.iter().zip(evidence).enumerate().map(signs).collect();
    let claim = |((&effect, round), signs): ((&EffectId, &Round), Signs)| {
        let named = signs.chance() >= LEAST_CHANCE && is_told(engine, state, effect, signs.drift, blocks);
        let untried: Vec<EffectId> = untried(effect, library).collect();
        let mut confused = confused(round, effect);
        confused.extend(&untried);
        let doubts = if named { Vec::new() } else { signs.heavy_doubts() };
        Claim { effect, confidence: signs.confidence(), confused, untried, doubts, drift: signs.drift, named }
    };
    state.named.iter().zip(evidence).zip(Signs::together(&alone)).map(claim).collect()
}

/// Confidence from which an effect is the cause though it does not help where it was not fitted.
const NEARLY_CERTAIN: f64 = 0.9;
/// Held-out error with an effect over that without it from which it harms.
const HARM: f64 = 1.01;

impl Claim {
    /// Whether it is named, but not so sure that it could be spared a look at held-out data.
    pub(crate) fn is_unsure(&self) -> bool {
        self.named && self.confidence < NEARLY_CERTAIN
    }

    /// Takes the name from it if the held-out error with it is larger than that without; whether it did. What keeps its name is scored on the
    /// same data: its share is a little too good, as a harmful one is not there to be stated.
    pub(crate) fn doubt_if_harmful(&mut self, with: f64, without: f64) -> bool {
        let harms = with > HARM * without;
        if harms {
            self.named = false;
            self.doubts.push("it makes held-out errors larger".to_owned());
        }
        harms
    }

    /// Counts in how far the size in a `model` changes where what every car has besides it is fitted, too. Steady push along the car is shared
    /// between drag and rolling resistance, and where one of them is named the other is there as well.
    pub(crate) fn with_company(&mut self, engine: &Engine<'_>, model: &State, windows: &Windows) {
        let Some(beside) = self.effect.spec().company else { return };
        if !self.named || model.named.contains(&beside) || engine.holds(beside) {
            return;
        }
        let named = [&model.named[..], &[beside]].concat();
        let both =
            engine.look(&named, &engine.carry(model, &named), Some(model.starts.clone()), windows, COMPANY);
        let size = |of: &State| of.of(self.effect).and_then(|own| own.first().copied()).unwrap_or(f64::NAN);
        let change = (size(&both) / size(model) - 1.0).abs();
        if both.finite && change.is_finite() {
            self.drift = self.drift.hypot(change);
        }
    }
}

/// What does nearly the same as an effect and is not in the library.
fn untried(effect: EffectId, library: &[EffectId]) -> impl Iterator<Item = EffectId> {
    effect.spec().alike.iter().copied().filter(|e| !library.contains(e))
}

/// The verdict, with its reasons.
pub(crate) fn decide(
    budget: &Budget,
    claims: &[Claim],
    remains: &Remains<'_>,
    costs: &[f64],
) -> (Verdict, Vec<String>) {
    let (nominal, retuned, after) = (mean(&budget.nominal), budget.retuned(), budget.after());
    let ceiling = mean(&budget.ceiling).min(after);
    let named = claims.iter().any(|c| c.named);
    let with_effects = if named { format!(", {after:.2} with the effects") } else { String::new() };
    let mut reasons = vec![format!(
        "mean squared rollout error over noise: {nominal:.2} nominal, {retuned:.2} with retuned tires{with_effects}, {ceiling:.2} with flexible terms, 1 is noise"
    )];
    if retuned > WORSE * nominal {
        reasons.push("the tires fitted to the training blocks do worse on the held-out ones than the nominal tires: the drive is not alike throughout".to_owned());
    }
    if named {
        let reached = (retuned - after) / (retuned - ceiling).max(1e-9);
        reasons.push(format!(
            "the named effects explain {:.0} % of what could be explained on held-out data",
            100.0 * reached.clamp(0.0, 1.0)
        ));
        for claim in claims.iter().filter(|c| c.named && !c.untried.is_empty()) {
            let others: Vec<&str> = claim.untried.iter().map(|e| e.name()).collect();
            reasons.push(format!(
                "{} shares its name with {}, which does nearly the same and was not among the candidates",
                claim.effect.name(),
                others.join(" and ")
            ));
        }
        return (Verdict::Effects, reasons);
    }
    if let Some(best) = claims.iter().max_by(|a, b| a.confidence.total_cmp(&b.confidence)) {
        let why = match best.doubts.as_slice() {
            [] => "its size is not told well enough by these data".to_owned(),
            doubts => doubts.join("; "),
        };
        reasons.push(format!(
            "the best effect, {}, is a candidate with confidence {:.2} and not named: {why}",
            best.effect.name(),
            best.confidence
        ));
    }
    let something = if remains.noise_is_known {
        if let Some((room, gain)) = remains.before.telling(remains.norm) {
            reasons.push(format!(
                "free terms of {} would take {gain:.2} off the cost per residual of {:.2}: more than where nothing is the matter",
                room.name(),
                remains.before.cost
            ));
        }
        remains.before.tells(remains.norm)
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
        format!(
            "what is left after retuning the tires, {retuned:.1} times the noise, is what this model leaves of any such drive"
        ),
    );
    let retune = nominal - retuned > RETUNE_EXCESS;
    (if retune { Verdict::TireRetuneOnly } else { Verdict::NoGap }, reasons)
}

/// The effects named, with their sizes in the `model` that holds no others, then the other candidates by what each would close beside them,
/// with theirs in the search's last `state`, or where `others` were compared.
pub(crate) fn rank(
    engine: &Engine<'_>,
    claims: &[Claim],
    [model, state]: [&State; 2],
    blocks: &[usize],
    others: &Round,
    budget: &Budget,
) -> Vec<RankedEffect> {
    let mut step = 0;
    let mut out: Vec<RankedEffect> = Vec::new();
    let order = claims.iter().filter(|c| c.named).chain(claims.iter().filter(|c| !c.named));
    for claim in order {
        step += usize::from(claim.named);
        out.push(RankedEffect {
            name: claim.effect.name(),
            accepted: claim.named,
            parameters: sizes(
                engine,
                if claim.named { model } else { state },
                claim.effect,
                claim.drift,
                blocks,
            ),
            gap_closed_fraction: if claim.named {
                budget.closed_by_step(step)
            } else {
                budget.closed_by_candidate(claim.effect)
            },
            confidence: claim.confidence,
            confused_with: claim.confused.iter().map(|e| e.name()).collect(),
        });
    }
    let rest = others.refits.iter().filter(|r| r.gain > 0.0 && r.relative_size > LEAST_LISTED);
    for r in rest.filter(|r| claims.iter().all(|c| c.effect != r.effect)) {
        out.push(RankedEffect {
            name: r.effect.name(),
            accepted: false,
            parameters: sizes(engine, &r.state, r.effect, UNTRIED, &others.blocks),
            gap_closed_fraction: budget.closed_by_candidate(r.effect),
            confidence: 0.0,
            confused_with: Vec::new(),
        });
    }
    // Candidates by what they would close; those of which nothing is known last.
    let named = out.iter().take_while(|e| e.accepted).count();
    let closes = |e: &RankedEffect| {
        let share = e.gap_closed_fraction.value;
        if share.is_nan() { f64::NEG_INFINITY } else { share }
    };
    out[named..].sort_by(|a, b| closes(b).total_cmp(&closes(a)));
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
        .filter(|(r, _)| r.effect != effect && r.relative_size < thresholds::MOST_SIZE)
        .filter(|(r, z)| {
            let near = best.gain - r.gain < thresholds::NEAR_SHARE * best.gain;
            let alike = round.screening.cosine(effect, r.effect) > thresholds::CONFUSED_COSINE;
            let rival = r.gain > thresholds::RIVAL_SHARE * best.gain;
            (rival && **z < thresholds::CONFUSED_Z) || (near && alike)
        })
        .map(|(r, _)| r.effect)
        .collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_harms_where_it_was_not_fitted_keeps_its_name_only_where_it_is_nearly_certain() {
        let claim = |confidence| Claim {
            effect: EffectId::CogShift,
            confidence,
            confused: Vec::new(),
            untried: Vec::new(),
            doubts: Vec::new(),
            drift: 0.1,
            named: true,
        };
        assert!(!claim(0.95).is_unsure());
        let mut helps = claim(0.6);
        assert!(helps.is_unsure() && !helps.doubt_if_harmful(1.2, 1.4) && helps.named);
        let mut harms = claim(0.6);
        assert!(harms.doubt_if_harmful(1.4, 1.2) && !harms.named && harms.doubts.len() == 1);
    }
}
