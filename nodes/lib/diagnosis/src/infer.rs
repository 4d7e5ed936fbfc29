//! The inference: which effects, at which sites, how large; and what no effect of the library does.
//!
//! 1. Everything is linearised at once around the present model ([`Joint`]): tires, all effects, and flexible terms of each site that can do
//!    roughly what any cause there does.
//! 2. The noise is fixed: what even all terms together leave of a channel counts as noise, and errors that are alike over a block count as
//!    often as they repeat (the dispersion: composite likelihood, Pauli, Racugno and Ventura 2011).
//! 3. Every effect has a narrow prior (as little as any car has, or as well as its figure is known) and a wide one; every site's flexible
//!    terms likewise. All configurations are compared ([`selection`](gripsight_estimation::selection)): an effect that is the cause makes its site's
//!    flexible terms needless; a stand-in does not.
//! 4. The most probable model is fitted by rollouts, and everything linearised anew around it, until the configuration stays.

use gripsight_estimation::shooting::{self, Parameter, Prior};
use gripsight_vehicle::PacejkaParameters;
use nalgebra::DVector;
use rayon::prelude::*;

use crate::decisions;
use crate::engine::Engine;
use crate::joint::{Columns, Joint, Weighed};
use crate::priors::TIRE_BOUNDS;
use crate::state::State;
use gripsight_estimation::Windows;
use gripsight_estimation::selection::{
    ColumnPrior, Configuration, Quadratic, Selection, Term, configuration, select,
};
use gripsight_model::EffectId;
use gripsight_model::{BASE, HOLD, TIRES, tires_to_parameters};
use gripsight_model::{Flexible, Site};

/// What the inference comes to.
#[derive(Debug, Clone)]
pub(crate) struct Inferred {
    pub(crate) columns: Columns,
    /// The tires that the priors are around.
    pub(crate) tires: PacejkaParameters,
    /// Where everything was linearised last.
    pub(crate) values: Vec<f64>,
    pub(crate) selection: Selection,
    /// Probability that each term matters, confirmed by rollouts.
    pub(crate) confirmed: Vec<f64>,
    pub(crate) terms: Vec<Term>,
    pub(crate) weighed: Weighed,
    /// How many times the errors' information is smaller than if they were independent.
    pub(crate) dispersion: f64,
    pub(crate) rounds: usize,
}

/// Place of the first effect among the terms: after tires and hold.
pub(crate) const FIRST: usize = 2;
/// Linearisations at most.
const ROUNDS: usize = 7;
/// Rounds at most in which effects alone are compared: beside free terms a linearisation far from the cause would blame them.
const CLOSED_ROUNDS: usize = 4;
/// Rounds after which the noise stays.
const NOISE_ROUNDS: usize = 2;
/// Iterations of the fit between two linearisations.
const ITERATIONS: usize = 4;
/// Loss of the linear evidence up to which rollouts are asked whether an effect is needed.
const CLEAR: f64 = 40.0;

/// Infers. `null`: the fitted model without effects; the engine's channel weights become those of the noise found.
pub(crate) fn infer(
    engine: &mut Engine<'_>,
    null: &State,
    library: &[EffectId],
    flexible: Flexible,
    windows: &Windows,
    progress: &mut dyn FnMut(&str),
) -> Option<Inferred> {
    let mut effects: Vec<EffectId> = EffectId::background().collect();
    effects.extend(library.iter().filter(|e| e.spec().usual.is_none()));
    let columns = Columns::new(effects, flexible);
    let mut values = columns.blank(engine);
    values[..BASE].copy_from_slice(&null.parameters[..BASE]);
    for effect in &columns.effects {
        if let (Some(own), Some(range)) = (null.of(*effect), columns.of_effect(*effect)) {
            values[range].copy_from_slice(own);
        }
    }
    let mut starts = null.starts.clone();
    let base = engine.sigma.clone();
    let mut chosen: Option<Vec<usize>> = None;
    let mut dispersion = 1.0;
    let mut rounds = 0;
    let mut open_flexible = false;
    loop {
        rounds += 1;
        progress(&format!("comparing all models, round {rounds}"));
        let mut joint = Joint::around(engine, &columns, &values, &starts, windows)?;
        differences(engine, &columns, &mut values, &starts, windows, &mut joint);
        let terms = terms(engine, &columns, &values, library);
        let open: Vec<usize> = terms.iter().map(|t| t.log_weights.len() - 1).collect();
        let still = rounds > NOISE_ROUNDS;
        let scale =
            if still { vec![1.0; base.len()] } else { noise_scale(engine, &joint, &base, &terms, &open)? };
        let weighed = joint.weighed(&scale);
        if !still {
            dispersion = repeated(&weighed, &terms, &open)?;
        }
        open_flexible |= rounds > CLOSED_ROUNDS;
        let start = chosen.clone().unwrap_or_else(|| vec![0; terms.len()]);
        let first_flexible = FIRST + columns.effects.len();
        let offered: Vec<Term> = terms
            .iter()
            .enumerate()
            .map(|(i, t)| if open_flexible || i < first_flexible { t.clone() } else { t.only(0) })
            .collect();
        let selection = select(&weighed.total, dispersion, &offered, &start, 17)?;
        let around = Around {
            engine,
            columns: &columns,
            terms: &terms,
            values: &values,
            starts: &starts,
            windows,
            dispersion,
        };
        let last = rounds == ROUNDS;
        if chosen.as_ref() != Some(&selection.best) && !last {
            let (_, fitted) = around.by_rollouts(&weighed.total, &selection.best)?;
            (values, starts) = (fitted.values, fitted.starts);
            chosen = Some(selection.best);
            continue;
        }
        let Pruned { chosen: best, fitted, losses } = around.pruned(&weighed.total, &selection.best)?;
        let same = chosen.as_ref() == Some(&best);
        if (same && open_flexible && rounds > NOISE_ROUNDS) || last {
            let confirmed = around.confirmed(&weighed.total, &selection, &losses)?;
            return Some(Inferred {
                columns,
                tires: engine.nominal,
                values,
                confirmed,
                selection,
                terms,
                weighed,
                dispersion,
                rounds,
            });
        }
        open_flexible |= same;
        (values, starts) = (fitted.values, fitted.starts);
        chosen = Some(best);
    }
}

/// Linearises another drive in the same columns, around its own best model of the same configuration. The engine's channel weights become those
/// of the noise found.
pub(crate) fn linearised(
    engine: &mut Engine<'_>,
    null: &State,
    like: &Inferred,
    windows: &Windows,
) -> Option<Inferred> {
    let columns = like.columns.clone();
    let mut values = like.values.clone();
    let mut starts = engine.starts_of(null, windows);
    let base = engine.sigma.clone();
    let library: Vec<EffectId> = columns.effects.iter().copied().filter(|e| like.is_open(*e)).collect();
    for round in 1.. {
        let mut joint = Joint::around(engine, &columns, &values, &starts, windows)?;
        differences(engine, &columns, &mut values, &starts, windows, &mut joint);
        let terms = terms(engine, &columns, &values, &library);
        let open: Vec<usize> = terms.iter().map(|t| t.log_weights.len() - 1).collect();
        let scale = noise_scale(engine, &joint, &base, &terms, &open)?;
        let weighed = joint.weighed(&scale);
        let dispersion = repeated(&weighed, &terms, &open)?;
        if round == NOISE_ROUNDS {
            let selection = select(&weighed.total, dispersion, &terms, &like.selection.best, 17)?;
            let confirmed = selection
                .probability
                .iter()
                .map(|p| if p.len() > 1 { p[p.len() - 1] } else { 1.0 })
                .collect();
            return Some(Inferred {
                columns,
                tires: engine.nominal,
                values,
                confirmed,
                selection,
                terms,
                weighed,
                dispersion,
                rounds: round,
            });
        }
        let around = Around {
            engine,
            columns: &columns,
            terms: &terms,
            values: &values,
            starts: &starts,
            windows,
            dispersion,
        };
        let (_, fitted) = around.by_rollouts(&weighed.total, &like.selection.best)?;
        (values, starts) = (fitted.values, fitted.starts);
    }
    None
}

/// What even all terms together leave of each channel counts as noise: by how much more than the weights have it, which are raised.
fn noise_scale(
    engine: &mut Engine<'_>,
    joint: &Joint,
    base: &[f64],
    terms: &[Term],
    open: &[usize],
) -> Option<Vec<f64>> {
    let mut scale = vec![1.0; base.len()];
    let step = configuration(&joint.weighed(&scale).total, 1.0, terms, open)?.step;
    for (c, left) in joint.left_by_channel(&step).into_iter().enumerate() {
        let sigma = base[c].max(engine.sigma[c] * left.sqrt());
        scale[c] = sigma / engine.sigma[c];
        engine.sigma[c] = sigma;
    }
    Some(scale)
}

impl Inferred {
    /// Place of an effect among the terms.
    pub(crate) fn term_of(&self, effect: EffectId) -> Option<usize> {
        self.columns.effects.iter().position(|e| *e == effect).map(|i| FIRST + i)
    }

    /// Places of a site's flexible terms among the terms.
    pub(crate) fn terms_of_site(&self, site: Site) -> std::ops::Range<usize> {
        let range = self.columns.of_site(site);
        self.columns.term_of_flexible(range.start)..self.columns.term_of_flexible(range.end)
    }

    /// Probability that something is the matter at a site that no effect of the library does.
    pub(crate) fn other(&self, site: Site) -> f64 {
        let terms = self.terms_of_site(site);
        self.selection.probability_that(|c| c[terms.clone()].iter().any(|&a| a > 0))
    }

    /// Whether the data were asked for an effect.
    pub(crate) fn is_open(&self, effect: EffectId) -> bool {
        self.term_of(effect).is_some_and(|t| self.terms[t].log_weights.len() > 1)
    }

    /// Probability that an effect matters.
    pub(crate) fn probability(&self, effect: EffectId) -> f64 {
        self.term_of(effect).filter(|_| self.is_open(effect)).map_or(0.0, |t| self.confirmed[t])
    }

    /// The terms with each effect that does not matter gone for good, but for what every car has: the narrow prior alone lets large evidence keep
    /// it.
    pub(crate) fn absent_terms(&self) -> Vec<Term> {
        const GONE: f64 = 0.01;
        let mut out = self.terms.clone();
        for (effect, term) in self.columns.effects.iter().zip(&mut out[FIRST..]) {
            if effect.spec().usual.is_none() {
                term.priors.iter_mut().take(effect.sizing()).for_each(|p| p.sigma[0] *= GONE);
            }
        }
        out
    }

    /// Parameters of an effect where it matters, and their standard deviations.
    pub(crate) fn size(&self, effect: EffectId) -> (Vec<f64>, Vec<f64>) {
        let Some(t) = self.term_of(effect) else { return (Vec::new(), Vec::new()) };
        let wide = self.selection.mean[t].len() - 1;
        let from = self.terms[t].from;
        let mean = self.selection.mean[t][wide].iter().enumerate();
        (mean.map(|(i, step)| self.values[from + i] + step).collect(), self.selection.sigma[t][wide].clone())
    }
}

/// The terms with their priors around the present values.
fn terms(engine: &Engine<'_>, columns: &Columns, values: &[f64], library: &[EffectId]) -> Vec<Term> {
    let mean = tires_to_parameters(&engine.nominal);
    let trust = &engine.trust;
    let tires = (0..TIRES)
        .map(|j| {
            let sigma = match j % 4 {
                0 => trust.stiffness * mean[j],
                1 => trust.shape,
                2 => trust.peak * mean[j],
                _ => trust.curvature,
            };
            let [low, high] = TIRE_BOUNDS[j % 4];
            ColumnPrior {
                offset: mean[j] - values[j],
                sigma: vec![sigma],
                bounds: [low - values[j], high - values[j]],
            }
        })
        .collect();
    let dt_s = engine.recording.dt_s();
    let hold = ColumnPrior {
        offset: 0.25 * dt_s - values[HOLD],
        sigma: vec![0.25 * dt_s],
        bounds: [-values[HOLD], 0.5 * dt_s - values[HOLD]],
    };
    let mut out = vec![
        Term { from: 0, priors: tires, log_weights: vec![0.0] },
        Term { from: HOLD, priors: vec![hold], log_weights: vec![0.0] },
    ];
    for &effect in &columns.effects {
        let range = columns.of_effect(effect).unwrap_or(0..0);
        let selectable = library.contains(&effect);
        let absent = engine.absent(effect);
        let priors = effect
            .spec()
            .parameters
            .iter()
            .enumerate()
            .map(|(i, spec)| {
                let (size, value) = (engine.size(spec), values[range.start + i]);
                let wide = decisions::WIDE * size;
                let narrow = if i >= effect.sizing() {
                    wide
                } else {
                    let usual = engine.usual(effect).unwrap_or(decisions::USUAL_SHARE * size);
                    // What no fit can know of a size is nobody's fault either.
                    let recording = engine.recording;
                    usual.hypot(effect.spec().unknown.sigma(
                        0.0,
                        recording.dt_s(),
                        recording.typical_speed_mps(),
                    ))
                };
                ColumnPrior {
                    offset: absent[i] - value,
                    sigma: if selectable { vec![narrow, wide.max(narrow)] } else { vec![narrow] },
                    bounds: [
                        spec.null + spec.range[0] * size - value,
                        spec.null + spec.range[1] * size - value,
                    ],
                }
            })
            .collect();
        let log_weights =
            if selectable { vec![(1.0 - decisions::PRIOR).ln(), decisions::PRIOR.ln()] } else { vec![0.0] };
        out.push(Term { from: range.start, priors, log_weights });
    }
    for site in Site::ALL {
        let range = columns.of_site(site);
        let prior = decisions::PRIOR / range.len() as f64;
        for column in range.clone() {
            let prior_of = ColumnPrior {
                offset: -values[column],
                sigma: vec![decisions::usual_flexible(site, column - range.start), decisions::FLEXIBLE_WIDE],
                bounds: [f64::NEG_INFINITY, f64::INFINITY],
            };
            let log_weights = vec![(1.0 - prior).ln(), prior.ln()];
            out.push(Term { from: column, priors: vec![prior_of], log_weights });
        }
    }
    out
}

/// How much larger the scatter of the blocks' gradients is than that of independent errors, at the best model with all terms open.
fn repeated(weighed: &Weighed, terms: &[Term], open: &[usize]) -> Option<f64> {
    let Configuration { step, covariance, .. } = configuration(&weighed.total, 1.0, terms, open)?;
    // Directions that the data know: H C is the share of the data in each.
    let known: f64 = (&weighed.total.information * &covariance).trace();
    let scatter: f64 = weighed
        .blocks
        .iter()
        .map(|b: &Quadratic| {
            let g: DVector<f64> = &b.gradient + &b.information * &step;
            (g.transpose() * &covariance * &g)[(0, 0)]
        })
        .sum();
    let blocks = weighed.blocks.len() as f64;
    let dispersion = scatter / known.max(1.0) * blocks / (blocks - 1.0).max(1.0);
    dispersion.is_finite().then_some(dispersion.max(1.0))
}

/// The most probable model, fitted by rollouts: all values and start states. Terms that it has only as little of as any car are absent there, but
/// for those that every car has.
fn refined(around: &Around<'_, '_>, chosen: &[usize], step: &DVector<f64>) -> Refined {
    let Around { engine, columns, terms, values, starts, windows, dispersion } = *around;
    let effect_is_in = |e: EffectId| {
        let place = columns.effects.iter().position(|x| *x == e);
        e.spec().usual.is_some() || place.is_some_and(|i| chosen[FIRST + i] > 0)
    };
    let mut in_use = vec![false; columns.len()];
    in_use[..BASE].fill(true);
    for &e in columns.effects.iter().filter(|e| effect_is_in(**e)) {
        in_use[columns.of_effect(e).unwrap_or(0..0)].fill(true);
    }
    let first_flexible = columns.first_flexible();
    for (column, used) in in_use.iter_mut().enumerate().skip(first_flexible) {
        *used = chosen[columns.term_of_flexible(column)] > 0;
    }
    let sites: Vec<Site> = Site::ALL.into_iter().filter(|s| columns.of_site(*s).any(|c| in_use[c])).collect();
    let mut target = columns.blank(engine);
    let mut parameters = Vec::new();
    let term_of =
        |column: usize| terms.iter().position(|t| (t.from..t.from + t.priors.len()).contains(&column));
    let (model, _, map) = columns.model(engine, values, effect_is_in, &sites);
    for &column in &map {
        let value = values[column];
        let Some(i) = term_of(column).filter(|_| in_use[column]) else {
            parameters.push(Parameter { start: 0.0, low: 0.0, high: 0.0, free: false, prior: None });
            continue;
        };
        let prior = &terms[i].priors[column - terms[i].from];
        let [low, high] = prior.bounds.map(|b| value + b);
        parameters.push(Parameter {
            start: (value + step[column]).clamp(low, high),
            low,
            high,
            // Flexible terms are linear: their step is as good as a fit.
            free: column < first_flexible,
            prior: Some(Prior {
                mean: value + prior.offset,
                sigma: prior.sigma[chosen[i]] / dispersion.sqrt(),
            }),
        });
    }
    let problem = engine.problem(&model, &windows.windows, &parameters, ITERATIONS);
    let from_step = shooting::descend(&problem, Some(starts.to_vec()));
    let best = if from_step.at.cost.is_finite() {
        from_step
    } else {
        // The step went too far: from where it began.
        let mut held = parameters.clone();
        held.iter_mut()
            .zip(&map)
            .filter(|(p, _)| p.free)
            .for_each(|(p, &c)| p.start = values[c].clamp(p.low, p.high));
        let problem = engine.problem(&model, &windows.windows, &held, ITERATIONS);
        shooting::descend(&problem, Some(starts.to_vec()))
    };
    for (&column, &v) in map.iter().zip(&best.parameters) {
        target[column] = v;
    }
    Refined { values: target, starts: best.starts, cost: best.at.cost }
}

/// A linearised problem and where it was linearised.
#[derive(Clone, Copy)]
struct Around<'p, 'a> {
    engine: &'p Engine<'a>,
    columns: &'p Columns,
    terms: &'p [Term],
    values: &'p [f64],
    starts: &'p [[f64; 2]],
    windows: &'p Windows,
    dispersion: f64,
}

/// A configuration of which nothing is needless.
struct Pruned {
    chosen: Vec<usize>,
    fitted: Refined,
    /// What the evidence loses without each effect, by term.
    losses: Vec<(usize, f64)>,
}

/// A configuration fitted by rollouts.
struct Refined {
    values: Vec<f64>,
    starts: Vec<[f64; 2]>,
    /// Weighted sum of squares with the priors' share.
    cost: f64,
}

impl Around<'_, '_> {
    /// Logarithm of a configuration's evidence by rollouts instead of the linearisation; its prior weight counted.
    fn by_rollouts(&self, problem: &Quadratic, chosen: &[usize]) -> Option<(f64, Refined)> {
        let linear = configuration(problem, self.dispersion, self.terms, chosen)?;
        let refined = refined(self, chosen, &linear.step);
        let log = linear.log_occam - 0.5 * refined.cost / self.dispersion;
        log.is_finite().then_some((log, refined))
    }

    /// How much the evidence falls without each effect that is in a configuration: by rollouts, where the linearisation does not make it clear.
    fn needed(&self, problem: &Quadratic, chosen: &[usize], with: f64) -> Vec<(usize, f64)> {
        let effects = FIRST..FIRST + self.columns.effects.len();
        let wide: Vec<usize> = effects.filter(|&i| chosen[i] > 0).collect();
        let linear = |chosen: &[usize]| {
            configuration(problem, self.dispersion, self.terms, chosen).map(|c| c.log_evidence)
        };
        let best = linear(chosen);
        wide.into_par_iter()
            .filter_map(|i| {
                let mut without = chosen.to_vec();
                without[i] = 0;
                let weight = self.terms[i].log_weights[1] - self.terms[i].log_weights[0];
                let promised = best? - linear(&without)? + weight;
                // A difference quotient promises what it likes.
                let flat = self.columns.effects[i - FIRST].spec().flat_at_null;
                if promised > CLEAR && !flat {
                    return Some((i, promised));
                }
                self.by_rollouts(problem, &without).map(|(log, _)| (i, with - log))
            })
            .collect()
    }

    /// Probability of each term's mattering, with the odds of the effects in the most probable configuration corrected by what the evidence
    /// loses without them by rollouts.
    fn confirmed(
        &self,
        problem: &Quadratic,
        selection: &Selection,
        losses: &[(usize, f64)],
    ) -> Option<Vec<f64>> {
        let mut out: Vec<f64> =
            selection.probability.iter().map(|p| if p.len() > 1 { p[p.len() - 1] } else { 1.0 }).collect();
        let log = |chosen: &[usize]| {
            let found = configuration(problem, self.dispersion, self.terms, chosen);
            found.map(|c| c.log_evidence)
        };
        let best = log(&selection.best)?;
        for &(i, loss) in losses {
            let mut without = selection.best.clone();
            without[i] = 0;
            let weight = self.terms[i].log_weights[1] - self.terms[i].log_weights[0];
            let promised = best - log(&without)? + weight;
            let odds = (out[i].clamp(1e-6, 1.0 - 1e-6) / (1.0 - out[i]).max(1e-6)).ln() + loss - promised;
            out[i] = 1.0 / (1.0 + (-odds).exp());
        }
        Some(out)
    }

    /// Drops what rollouts find needless, the most needless first.
    fn pruned(&self, problem: &Quadratic, chosen: &[usize]) -> Option<Pruned> {
        let mut chosen = chosen.to_vec();
        loop {
            let (with, fitted) = self.by_rollouts(problem, &chosen)?;
            let losses = self.needed(problem, &chosen, with);
            let least = losses.iter().min_by(|a, b| a.1.total_cmp(&b.1)).copied();
            match least.filter(|(_, loss)| *loss < 0.0) {
                Some((i, _)) => chosen[i] = 0,
                None => return Some(Pruned { chosen, fitted, losses }),
            }
        }
    }
}

/// For effects whose derivative vanishes where they are absent: the difference quotient to one of their starts, the one that promises most.
fn differences(
    engine: &Engine<'_>,
    columns: &Columns,
    values: &mut [f64],
    starts: &[[f64; 2]],
    windows: &Windows,
    joint: &mut Joint,
) {
    for &effect in columns.effects.iter().filter(|e| e.spec().flat_at_null) {
        let Some(range) = columns.of_effect(effect) else { continue };
        let null = effect.spec().parameters[0].null;
        if (values[range.start] - null).abs() > 1e-12 {
            continue;
        }
        if effect.is_of_a_place() {
            if let Some(([start, length], slopes)) =
                crate::patch::likeliest(effect, engine, columns, values, starts, windows, joint)
            {
                values[range.start + 1] = start;
                values[range.start + 2] = length;
                joint.with_column(engine, range.start, &slopes);
            }
            continue;
        }
        let size = engine.size(&effect.spec().parameters[0]);
        let slopes = effect
            .spec()
            .starts
            .iter()
            .map(|m| crate::patch::quotient(engine, columns, values, starts, windows, range.start, m * size))
            .map(|slopes| (joint.promise(engine, &slopes), slopes))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, slopes)) = slopes {
            joint.with_column(engine, range.start, &slopes);
        }
    }
}

#[cfg(test)]
mod tests {
    use gripsight_estimation::split;
    use gripsight_vehicle::VehicleParameters;

    use super::*;
    use crate::testing::{drive, tires};
    use crate::trust::TireTrust;

    fn inferred(lag_s: f64, without: &[EffectId]) -> Inferred {
        const LARGE_SLIP_RAD: f64 = 0.1;
        let vehicle = VehicleParameters::f1tenth();
        let recording = drive(&vehicle, lag_s);
        let windows = split(&recording, false).training;
        let mut engine = Engine::new(&recording, &vehicle, tires(), TireTrust::file());
        let null = engine.look(&[], &engine.blank(), None, &windows, 15);
        let library = [EffectId::SteeringLag, EffectId::SteeringDelay, EffectId::VyBias, EffectId::GyroScale];
        let library: Vec<EffectId> = library.into_iter().filter(|e| !without.contains(e)).collect();
        let flexible = Flexible::by_site(&recording, LARGE_SLIP_RAD, vehicle.wheelbase_m(), &Site::ALL);
        infer(&mut engine, &null, &library, flexible, &windows, &mut |_| {}).unwrap()
    }

    #[test]
    fn where_nothing_is_the_matter_nothing_is_found() {
        let found = inferred(0.0, &[]);
        assert!(found.columns.effects.iter().all(|e| found.probability(*e) < 0.5), "{:?}", found.confirmed);
        assert!(
            Site::ALL.iter().all(|s| found.other(*s) < 0.5),
            "{:?}",
            found.confirmed
        );
    }

    #[test]
    fn a_lag_is_found_with_its_size_and_left_out_its_site_is() {
        let found = inferred(0.06, &[]);
        assert!(found.probability(EffectId::SteeringLag) > 0.9, "{:?}", found.confirmed);
        let (size, sigma) = found.size(EffectId::SteeringLag);
        assert!((size[0] - 0.06).abs() < 0.01 && sigma[0] < 0.01, "{size:?} {sigma:?}");
        let without = inferred(0.06, &[EffectId::SteeringLag, EffectId::SteeringDelay]);
        let steering = without.other(Site::Steering);
        assert!(steering > 0.9, "{:?}", without.confirmed);
        assert!([EffectId::VyBias, EffectId::GyroScale].iter().all(|e| without.probability(*e) < 0.5));
    }
}
