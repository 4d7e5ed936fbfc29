//! From probabilities to statements: how likely each effect is, what the data cannot tell apart, and the answer by site.

use std::ops::Range;

use gripsight_estimation::selection::{Term, configuration};
use gripsight_estimation::{Estimate, bootstrap};
use gripsight_model::{EffectId, Site};
use nalgebra::DVector;

use crate::answer::{MechanismAnswer, SiteAnswer};
use crate::budget::Budget;
use crate::decisions;
use crate::engine::Engine;
use crate::infer::FIRST;
use crate::inferred::Inferred;
use crate::outcome::{DetectionLimit, RankedEffect};
use crate::sizes::{reported, with_half_widths};

/// Probability of one effect, where another one is absent, from which it may stand in its place.
const IN_ITS_PLACE: f64 = 0.2;
/// Probability that an effect is absent, below which nothing stands in its place.
const ABSENT: f64 = 0.02;

impl Inferred {
    /// The effects stated as causes, what closes most first.
    pub(crate) fn accepted(&self) -> Vec<EffectId> {
        self.by_what_they_close(|e| self.is_accepted(e))
    }

    /// The effects of the model that errors are told of: those stated as causes, and beside them what stands in for others. What closes most first.
    pub(crate) fn modelled(&self) -> Vec<EffectId> {
        let any = self.columns.effects.iter().any(|e| self.is_accepted(*e));
        self.by_what_they_close(|e| self.is_accepted(e) || any && self.stands_in(e))
    }

    fn by_what_they_close(&self, belongs: impl Fn(EffectId) -> bool) -> Vec<EffectId> {
        let closes = |e: &EffectId| self.statement(*e).map_or(0.0, |s| s.closes);
        let mut out: Vec<EffectId> = self.columns.effects.iter().copied().filter(|e| belongs(*e)).collect();
        out.sort_by(|a, b| closes(b).total_cmp(&closes(a)));
        out
    }

    /// The other effects that are worth a word, the likeliest first.
    pub(crate) fn candidates(&self) -> Vec<EffectId> {
        let listed = |e: &EffectId| {
            self.is_open(*e) && self.probability(*e) >= decisions::LISTED && !self.is_accepted(*e)
        };
        let mut out: Vec<EffectId> = self.columns.effects.iter().copied().filter(listed).collect();
        out.sort_by(|a, b| self.probability(*b).total_cmp(&self.probability(*a)));
        out
    }
}

/// The ranking: the effects stated, then the other candidates.
pub(crate) fn ranked(
    engine: &Engine<'_>,
    inferred: &Inferred,
    library: &[EffectId],
    budget: &Budget,
) -> Vec<RankedEffect> {
    let of = |effect: EffectId, accepted: bool| RankedEffect {
        name: effect.name(),
        accepted,
        parameters: reported(engine, effect, &inferred.size(effect)),
        gap_closed_fraction: budget.closed_by(effect),
        needed_fraction: inferred.statement(effect).map_or(f64::NAN, |s| s.closes),
        held_out_log_ratio: inferred.statement(effect).map_or(f64::NAN, |s| s.held_out_log_ratio),
        over_unexplained: inferred.statement(effect).map_or(f64::NAN, |s| s.over_unexplained),
        size_over_half_width: inferred.statement(effect).map_or(f64::NAN, |s| s.size_over_half_width),
        confidence: inferred.probability(effect),
        confused_with: confused(inferred, library, effect).iter().map(|e| e.name()).collect(),
    };
    let accepted = inferred.accepted().into_iter().map(|e| of(e, true));
    accepted.chain(inferred.candidates().into_iter().map(|e| of(e, false))).collect()
}

/// Sizes from which effects would show beside the most probable model: five standard deviations.
pub(crate) fn detection_limits(engine: &Engine<'_>, inferred: &Inferred) -> Vec<DetectionLimit> {
    const STANDARD_DEVIATIONS: f64 = 5.0;
    let problem = &inferred.weighed.total;
    let of = |&effect: &EffectId| {
        let term = inferred.term_of(effect)?;
        let mut chosen = inferred.selection.best.clone();
        chosen[term] = inferred.terms[term].log_weights.len() - 1;
        let covariance = configuration(problem, inferred.dispersion, &inferred.terms, &chosen)?.covariance();
        let from = inferred.terms[term].from;
        let parameters = effect.spec().parameters.iter().take(effect.sizing()).enumerate();
        let sized = inferred.sizes.effect(&inferred.columns, effect);
        let found = sized.as_ref().map(|sized| with_half_widths(engine, effect, sized));
        let limit = |(i, p): (usize, &gripsight_model::ParameterSpec)| {
            let (value, half) = found.as_ref().map_or((f64::NAN, f64::NAN), |f| f[i]);
            DetectionLimit {
                name: effect.name(),
                parameter: p.name,
                size: STANDARD_DEVIATIONS * covariance[(from + i, from + i)].max(0.0).sqrt(),
                matters: engine.size(p),
                value,
                low: value - half,
                high: value + half,
                standard_error: sized.as_ref().map_or(f64::NAN, |(_, sigma)| sigma[i]),
            }
        };
        Some(parameters.map(limit).collect::<Vec<_>>())
    };
    let open = inferred.columns.effects.iter().filter(|e| inferred.is_open(**e));
    open.filter_map(of).flatten().filter(|l| l.size.is_finite()).collect()
}

/// What is there where an effect is not.
fn confused(inferred: &Inferred, library: &[EffectId], effect: EffectId) -> Vec<EffectId> {
    let mut out: Vec<EffectId> = untried(effect, library).collect();
    let rivals: Vec<(EffectId, f64)> = inferred.statement(effect).map_or_else(Vec::new, |s| {
        s.rivals.iter().map(|(t, _)| (inferred.columns.effects[t - FIRST], s.chance_instead(*t))).collect()
    });
    out.extend(rivals.iter().filter(|(_, chance)| *chance >= decisions::LISTED).map(|(e, _)| *e));
    let visited = &inferred.selection.visited;
    let Some(own) = inferred.term_of(effect) else { return out };
    let without: Vec<&Vec<u8>> = visited.iter().filter(|c| c[own] == 0).collect();
    if without.is_empty() || (without.len() as f64) < ABSENT * visited.len() as f64 {
        return out;
    }
    let with: Vec<&Vec<u8>> = visited.iter().filter(|c| c[own] > 0).collect();
    let share = |of: &[&Vec<u8>], term: usize| {
        of.iter().filter(|c| c[term] > 0).count() as f64 / of.len().max(1) as f64
    };
    let instead = |e: &EffectId| {
        inferred
            .term_of(*e)
            .is_some_and(|t| share(&without, t) >= IN_ITS_PLACE && share(&with, t) < 0.5 * share(&without, t))
    };
    let near = |e: &EffectId| e.spec().sites.iter().any(|s| effect.spec().sites.contains(s));
    // Those that were put in its place need no guess.
    let asked = |e: &EffectId| *e == effect || rivals.iter().any(|(r, _)| r == e);
    let others = inferred.columns.effects.iter().copied().filter(|e| !asked(e) && near(e) && instead(e));
    out.extend(others);
    out
}

/// What does nearly the same as an effect and is not among the candidates: a name is shared with it.
pub(crate) fn untried(effect: EffectId, library: &[EffectId]) -> impl Iterator<Item = EffectId> {
    effect.spec().alike.iter().copied().filter(|e| !library.contains(e))
}

/// The graded answer: how likely each site is at fault, what it closes, and which mechanisms there.
pub(crate) fn sites(inferred: &Inferred, effects: &[RankedEffect]) -> Vec<SiteAnswer> {
    let (shares, modelled) = (Shares::of(inferred), inferred.modelled());
    let mut out: Vec<SiteAnswer> = Site::ALL
        .into_iter()
        .map(|site| {
            let here: Vec<EffectId> = inferred
                .columns
                .effects
                .iter()
                .copied()
                .filter(|e| e.spec().sites.contains(&site) && inferred.is_open(*e))
                .collect();
            let terms: Vec<usize> = here.iter().filter_map(|e| inferred.term_of(*e)).collect();
            let other = inferred.terms_of_site(site);
            // Nothing is the matter if nothing of all this is.
            let nothing = here.iter().map(|e| 1.0 - inferred.probability_of_alike(*e)).product::<f64>();
            let probability = 1.0 - nothing * (1.0 - inferred.other(site));
            let mut mechanisms: Vec<MechanismAnswer> = here
                .iter()
                .map(|e| MechanismAnswer { name: e.name(), probability: inferred.probability(*e) })
                .filter(|m| m.probability >= decisions::LISTED)
                .collect();
            mechanisms.sort_by(|a, b| b.probability.total_cmp(&a.probability));
            let [closed, by_mechanisms] = if probability >= decisions::LISTED {
                shares.as_ref().map_or([Estimate::UNKNOWN; 2], |s| s.closed(inferred, &terms, other.clone()))
            } else {
                [Estimate::UNKNOWN; 2]
            };
            let unexplained = if inferred.other(site) >= decisions::LIKELY {
                (1.0 - by_mechanisms.value / closed.value).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let modelled = modelled.iter().filter(|e| here.contains(e));
            let named = modelled.filter_map(|e| effects.iter().find(|r| r.name == e.name()));
            let shares: Vec<Estimate> =
                named.map(|e| e.gap_closed_fraction).filter(|c| c.value.is_finite()).collect();
            let sum = |of: fn(&Estimate) -> f64| shares.iter().map(of).sum();
            let closed = if shares.is_empty() {
                closed
            } else {
                Estimate { value: sum(|c| c.value), low: sum(|c| c.low), high: sum(|c| c.high) }
            };
            SiteAnswer {
                name: site.name(),
                probability,
                closed_fraction: closed,
                mechanisms,
                other_probability: inferred.other(site),
                unexplained_fraction: unexplained,
            }
        })
        .collect();
    out.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    out
}

/// What configurations close, block by block.
struct Shares {
    /// The terms with what is absent gone.
    terms: Vec<Term>,
    /// Step with nothing but what any car has.
    null: DVector<f64>,
    /// Drop of every block's cost with everything open.
    whole: Vec<f64>,
}

impl Shares {
    fn of(inferred: &Inferred) -> Option<Self> {
        let terms = inferred.absent_terms();
        let step = |chosen: &[usize]| {
            let found = configuration(&inferred.weighed.total, inferred.dispersion, &terms, chosen);
            found.map(|c| c.step)
        };
        let null = step(&vec![0; inferred.terms.len()])?;
        let open: Vec<usize> = terms.iter().map(|t| t.log_weights.len() - 1).collect();
        let ceiling = step(&open)?;
        let whole = drops(inferred, &null, &ceiling);
        Some(Self { terms, null, whole })
    }

    /// What a site closes of what everything together does; and its mechanisms alone.
    fn closed(&self, inferred: &Inferred, mechanisms: &[usize], other: Range<usize>) -> [Estimate; 2] {
        let with = |terms: &mut dyn Iterator<Item = usize>| {
            let mut chosen = vec![0; inferred.terms.len()];
            let is_in = |t: usize| inferred.chosen[t] > 0 || inferred.beside.contains(&t);
            terms.for_each(|t| chosen[t] = usize::from(is_in(t)));
            let found = configuration(&inferred.weighed.total, inferred.dispersion, &self.terms, &chosen);
            let drops = found.map(|c| drops(inferred, &self.null, &c.step));
            drops.map_or(Estimate::UNKNOWN, |drops| {
                bootstrap(drops.len(), |picked| {
                    let sum = |of: &[f64]| picked.iter().map(|&i| of[i]).sum::<f64>();
                    sum(&drops) / sum(&self.whole).max(1e-9)
                })
            })
        };
        [with(&mut mechanisms.iter().copied().chain(other)), with(&mut mechanisms.iter().copied())]
    }
}

/// How much lower each block's cost is after one step than after another.
fn drops(inferred: &Inferred, from: &DVector<f64>, to: &DVector<f64>) -> Vec<f64> {
    let cost = |b: &gripsight_estimation::selection::Quadratic, step: &DVector<f64>| {
        2.0 * b.gradient.dot(step) + (&b.information * step).dot(step)
    };
    inferred.weighed.blocks.iter().map(|b| cost(b, from) - cost(b, to)).collect()
}
