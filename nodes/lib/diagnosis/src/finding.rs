//! From probabilities to statements: how likely each effect is, what the data cannot tell apart, how large each is, and the answer by site.

use std::collections::BTreeMap;
use std::ops::Range;

use gripsight_estimation::selection::{Term, configuration};
use gripsight_estimation::{Estimate, bootstrap};
use gripsight_model::{EffectId, Recording, Site};
use gripsight_vehicle::VehicleParameters;
use nalgebra::DVector;

use crate::decisions;
use crate::engine::Engine;
use crate::graded::{MechanismAnswer, SiteAnswer, SizedEffect};
use crate::infer::Inferred;
use crate::outcome::EffectParameter;
use crate::trust::TireTrust;

/// Half width of a 90 % interval in standard deviations.
const NINETY: f64 = 1.645;
/// Probability of one effect, where another one is absent, from which it may stand in its place.
const IN_ITS_PLACE: f64 = 0.2;
/// Probability that an effect is absent, below which nothing stands in its place.
const ABSENT: f64 = 0.02;

/// All effects that are worth a word, the likeliest first.
pub(crate) fn mechanisms(
    recording: &Recording,
    vehicle: &VehicleParameters,
    inferred: &Inferred,
) -> Vec<SizedEffect> {
    let engine = Engine::new(recording, vehicle, inferred.tires, TireTrust::free());
    let open = inferred.columns.effects.iter().filter(|e| inferred.is_open(**e));
    let mut out: Vec<SizedEffect> = open
        .map(|&effect| SizedEffect {
            name: effect.name(),
            probability: inferred.probability(effect),
            accepted: inferred.is_accepted(effect),
            needed_fraction: inferred.statement(effect).map_or(f64::NAN, |s| s.closes),
            parameters: sizes(&engine, effect, inferred.size(effect)),
            confused_with: confused(inferred, effect).iter().map(|e| e.name()).collect(),
        })
        .filter(|f| f.probability >= decisions::LISTED)
        .collect();
    out.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    out
}

/// What is there where an effect is not.
fn confused(inferred: &Inferred, effect: EffectId) -> Vec<EffectId> {
    let visited = &inferred.selection.visited;
    let Some(own) = inferred.term_of(effect) else { return Vec::new() };
    let without: Vec<&Vec<u8>> = visited.iter().filter(|c| c[own] == 0).collect();
    if without.is_empty() || (without.len() as f64) < ABSENT * visited.len() as f64 {
        return Vec::new();
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
    inferred.columns.effects.iter().copied().filter(|e| *e != effect && instead(e)).collect()
}

/// Parameters as reported, with 90 % intervals.
fn sizes(
    engine: &Engine<'_>,
    effect: EffectId,
    (own, sigma): (Vec<f64>, Vec<f64>),
) -> BTreeMap<&'static str, EffectParameter> {
    let spec = effect.spec();
    let recording = engine.recording;
    let halves: Vec<f64> = own
        .iter()
        .zip(&sigma)
        .zip(spec.parameters)
        .map(|((v, s), p)| {
            NINETY * s.hypot(spec.unknown.sigma(v - p.null, recording.dt_s(), recording.typical_speed_mps()))
        })
        .collect();
    let given = engine.given(effect);
    if spec.reported.is_empty() {
        return spec
            .parameters
            .iter()
            .enumerate()
            .map(|(i, p)| {
                let (value, half) = (own[i], halves[i]);
                let before = given.map(|given| given[i]);
                (
                    p.name,
                    EffectParameter { value, low: value - half, high: value + half, unit: p.unit, before },
                )
            })
            .collect();
    }
    spec.reported
        .iter()
        .map(|r| {
            let value = (r.value)(&own);
            // Ends from moving each fitted parameter by its own interval.
            let (mut low, mut high) = (value, value);
            for i in 0..own.len() {
                for sign in [-1.0, 1.0] {
                    let mut moved = own.clone();
                    moved[i] += sign * if halves[i].is_finite() { halves[i] } else { 0.0 };
                    let v = (r.value)(&moved);
                    (low, high) = (low.min(v), high.max(v));
                }
            }
            (r.name, EffectParameter { value, low, high, unit: r.unit, before: given.map(r.value) })
        })
        .collect()
}

/// The graded answer: how likely each site is at fault, what it closes, and which mechanisms there.
pub(crate) fn sites(inferred: &Inferred) -> Vec<SiteAnswer> {
    let shares = Shares::of(inferred);
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
            let counted = inferred
                .selection
                .probability_that(|c| terms.iter().copied().chain(other.clone()).any(|t| c[t] > 0));
            let likeliest = here.iter().map(|e| inferred.probability(*e)).fold(0.0, f64::max);
            let probability = counted.max(likeliest);
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
            let unexplained = (1.0 - by_mechanisms.value / closed.value).clamp(0.0, 1.0);
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
            terms.for_each(|t| chosen[t] = inferred.selection.best[t]);
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
