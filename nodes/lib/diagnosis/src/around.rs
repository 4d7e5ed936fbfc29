//! Configurations fitted by rollouts: to the end, or roughly for a look.

use gripsight_estimation::Windows;
use gripsight_estimation::selection::{Quadratic, Term, configuration};
use gripsight_estimation::shooting::{self, Fit, Parameter, Prior, Problem};
use gripsight_model::{BASE, EffectId, ExtendedModel, Site};
use nalgebra::{DMatrix, DVector};

use crate::columns::Columns;
use crate::engine::Engine;
use crate::infer::FIRST;
use crate::joint::Joint;

/// Iterations of the fit between two linearisations.
const ITERATIONS: usize = 4;
/// Iterations at most of a fit that is compared with others.
const ITERATIONS_TO_THE_END: usize = 20;
/// Parameters that a fit can move; what is beyond stays at the linear answer.
const MOST_FREE: usize = 78;
/// Chord steps at most.
const STEPS: usize = 4;
/// Gain in twice the log evidence below which no more steps are made.
const SETTLED: f64 = 0.2;

/// A linearised problem and where it was linearised.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Around<'p, 'a> {
    pub(crate) engine: &'p Engine<'a>,
    pub(crate) columns: &'p Columns,
    pub(crate) terms: &'p [Term],
    pub(crate) values: &'p [f64],
    pub(crate) starts: &'p [[f64; 2]],
    pub(crate) windows: &'p Windows,
    pub(crate) dispersion: f64,
    pub(crate) joint: &'p Joint,
    /// Noise of each channel over that of the linearisation.
    pub(crate) scale: &'p [f64],
}

/// A configuration fitted by rollouts.
#[derive(Debug, Clone)]
pub(crate) struct Refined {
    pub(crate) values: Vec<f64>,
    pub(crate) starts: Vec<[f64; 2]>,
}

/// How a fit of a configuration ended.
pub(crate) struct Ended {
    pub(crate) fitted: Refined,
    /// In the order of the model's own parameters.
    pub(crate) fit: Fit,
}

/// A column that a configuration's model has, with its prior there.
struct Free {
    column: usize,
    mean: f64,
    precision: f64,
    bounds: [f64; 2],
}

impl Around<'_, '_> {
    /// The columns that a configuration's model has.
    pub(crate) fn in_use(&self, chosen: &[usize]) -> Vec<bool> {
        let columns = self.columns;
        let mut out = vec![false; columns.len()];
        out[..BASE].fill(true);
        for (i, effect) in columns.effects.iter().enumerate() {
            if effect.spec().usual.is_some() || self.engine.holds(*effect) || chosen[FIRST + i] > 0 {
                out[columns.of_effect(*effect).unwrap_or(0..0)].fill(true);
            }
        }
        for (column, used) in out.iter_mut().enumerate().skip(columns.first_flexible()) {
            *used = chosen[columns.term_of_flexible(column)] > 0;
        }
        out
    }

    /// A configuration's model on an engine's recording, its own values, and their columns.
    pub(crate) fn model<'e>(
        &self,
        engine: &Engine<'e>,
        chosen: &[usize],
        values: &[f64],
    ) -> (ExtendedModel<'e>, Vec<f64>, Vec<usize>) {
        let used = self.in_use(chosen);
        let has = |e: EffectId| self.columns.of_effect(e).is_some_and(|r| used[r.start]);
        let sites: Vec<Site> =
            Site::ALL.into_iter().filter(|s| self.columns.of_site(*s).any(|c| used[c])).collect();
        self.columns.model(engine, values, has, &sites)
    }

    /// A configuration fitted by rollouts, between two linearisations.
    pub(crate) fn by_rollouts(&self, problem: &Quadratic, chosen: &[usize]) -> Option<Refined> {
        let linear = configuration(problem, self.dispersion, self.terms, chosen)?;
        self.refined(ITERATIONS, chosen, &linear.step, self.places(&linear.step)).map(|ended| ended.fitted)
    }

    /// The same, as far as it goes; an effect that would stay as it is begins at its starts.
    pub(crate) fn by_rollouts_to_the_end(&self, problem: &Quadratic, chosen: &[usize]) -> Option<Ended> {
        let step = configuration(problem, self.dispersion, self.terms, chosen)?.step;
        let begins = self.places(&step).into_iter().chain(self.started(chosen)).collect();
        let ended = self.refined(ITERATIONS_TO_THE_END, chosen, &step, begins)?;
        let alone = self.without_alike(chosen, &ended.fitted);
        let alone = alone.and_then(|begin| self.refined(ITERATIONS_TO_THE_END, chosen, &step, vec![begin]));
        let cost = |of: &Ended| of.fit.linearization.cost;
        Some(alone.filter(|alone| cost(alone) < cost(&ended)).unwrap_or(ended))
    }

    /// Where a linearisation leads, and where it was made.
    fn places(&self, step: &DVector<f64>) -> Vec<Refined> {
        let linear = self.values.iter().zip(step.iter()).map(|(v, s)| v + s).collect();
        [linear, self.values.to_vec()].map(|values| Refined { values, starts: self.starts.to_vec() }).into()
    }

    /// A fit without the little of what does nearly the same as an effect that the model has: between the two it may have ended where neither is right,
    /// for what tells them apart (a jump of the command, seen at once or not) shows only close to either.
    fn without_alike(&self, chosen: &[usize], fitted: &Refined) -> Option<Refined> {
        let mut values = fitted.values.clone();
        let terms = || self.columns.effects.iter().zip(&chosen[FIRST..]);
        for alike in terms().filter(|(_, c)| **c > 0).flat_map(|(e, _)| e.spec().alike) {
            let is_little = terms().any(|(e, c)| e == alike && *c == 0) && alike.spec().usual.is_some();
            if let Some(range) = self.columns.of_effect(*alike).filter(|_| is_little) {
                values[range].copy_from_slice(&self.engine.absent(*alike));
            }
        }
        (values != fitted.values).then(|| Refined { values, starts: fitted.starts.clone() })
    }

    /// The effect of a configuration that is absent in a model, and whose derivative vanishes there: no fit leads away from where it is absent.
    fn stuck(&self, chosen: &[usize], values: &[f64]) -> Option<EffectId> {
        let mut effects = self.columns.effects.iter().zip(&chosen[FIRST..]);
        let absent = |e: EffectId| {
            let column = self.columns.of_effect(e).map_or(0, |r| r.start);
            (values[column] - e.spec().parameters[0].null).abs() < 1e-12
        };
        effects.find(|(e, c)| **c > 0 && e.spec().flat_at_null && absent(**e)).map(|(e, _)| *e)
    }

    /// Where the linearisation is, with the effect that would stay as it is at its starts.
    fn started(&self, chosen: &[usize]) -> Vec<Refined> {
        let stuck = self.stuck(chosen, self.values);
        let Some((effect, range)) = stuck.and_then(|e| Some((e, self.columns.of_effect(e)?))) else {
            return Vec::new();
        };
        let size = &effect.spec().parameters[0];
        let started = |multiple: &f64| {
            let mut values = self.values.to_vec();
            values[range.start] = size.null + multiple * self.engine.size(size);
            Refined { values, starts: self.starts.to_vec() }
        };
        effect.spec().starts.iter().map(started).collect()
    }

    /// The model of a configuration fitted by rollouts, from where the linear step leads, where the linearisation is, or one of `near`, whichever is best. Terms
    /// that it has only as little of as any car are absent there, but for those that every car has.
    fn refined(
        &self,
        iterations: usize,
        chosen: &[usize],
        step: &DVector<f64>,
        begins: Vec<Refined>,
    ) -> Option<Ended> {
        let Self { engine, columns, terms, values, windows, dispersion, .. } = *self;
        let in_use = self.in_use(chosen);
        let mut target = columns.blank(engine);
        let mut parameters = Vec::new();
        let term_of =
            |column: usize| terms.iter().position(|t| (t.from..t.from + t.priors.len()).contains(&column));
        let (model, _, map) = self.model(engine, chosen, values);
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
                free: parameters.len() < MOST_FREE,
                prior: Some(Prior {
                    mean: value + prior.offset,
                    sigma: prior.sigma[chosen[i]] / dispersion.sqrt(),
                }),
            });
        }
        let ((_, cost), begin) = begins
            .into_iter()
            .map(|begin| {
                let stuck = self.stuck(chosen, &begin.values).is_some();
                let at: Vec<f64> = parameters
                    .iter()
                    .zip(&map)
                    .map(|(p, &c)| if p.free { begin.values[c].clamp(p.low, p.high) } else { p.start })
                    .collect();
                let problem = engine.problem(&model, &windows.windows, &parameters, 0);
                let cost = shooting::cost(&problem, &at, &begin.starts);
                ((stuck, cost), (at, begin.starts))
            })
            .min_by(|a, b| a.0.0.cmp(&b.0.0).then(a.0.1.total_cmp(&b.0.1)))?;
        let (at, begin) = begin;
        parameters.iter_mut().zip(at).for_each(|(p, at)| p.start = at);
        let problem = Problem {
            tolerance: SETTLED * dispersion / cost,
            ..engine.problem(&model, &windows.windows, &parameters, iterations)
        };
        let fit = shooting::fit(&problem, Some(begin));
        for (&column, &v) in map.iter().zip(&fit.parameters) {
            target[column] = v;
        }
        let fitted = Refined { values: target, starts: fit.starts.clone() };
        fit.linearization.cost.is_finite().then_some(Ended { fitted, fit })
    }

    /// A configuration fitted roughly, for a look, from the linear answer, with the logarithm of its evidence by rollouts, its prior weight counted.
    pub(crate) fn nearby(&self, problem: &Quadratic, chosen: &[usize]) -> Option<(f64, Refined)> {
        let step = configuration(problem, self.dispersion, self.terms, chosen)?.step;
        let answer = self.values.iter().zip(step.iter()).map(|(v, s)| v + s).collect();
        let here = |values| Refined { values, starts: self.starts.to_vec() };
        // Where the linear answer leads nowhere: from where it began.
        self.by_chord_steps(problem, chosen, &[here(answer), here(self.values.to_vec())])
    }

    /// A configuration fitted roughly from the best of some places, by steps whose derivatives stay those of the linearisation (chord steps), so that each
    /// costs one plain rollout.
    fn by_chord_steps(
        &self,
        problem: &Quadratic,
        chosen: &[usize],
        begins: &[Refined],
    ) -> Option<(f64, Refined)> {
        let log_occam = configuration(problem, self.dispersion, self.terms, chosen)?.log_occam;
        let columns = self.columns;
        let in_use = self.in_use(chosen);
        let free: Vec<Free> = self
            .terms
            .iter()
            .zip(chosen)
            .flat_map(|(term, &alternative)| {
                term.priors.iter().enumerate().map(move |(k, p)| (term.from + k, p, alternative))
            })
            .filter(|(column, ..)| in_use[*column])
            .map(|(column, prior, alternative)| Free {
                column,
                mean: self.values[column] + prior.offset,
                precision: prior.sigma[alternative].powi(-2),
                bounds: prior.bounds.map(|b| self.values[column] + b),
            })
            .collect();
        let prior = |values: &[f64]| -> f64 {
            free.iter().map(|f| f.precision * (values[f.column] - f.mean).powi(2)).sum()
        };
        let matrix = DMatrix::from_fn(free.len(), free.len(), |r, c| {
            let data = problem.information[(free[r].column, free[c].column)] / self.dispersion;
            data + if r == c { free[r].precision } else { 0.0 }
        });
        let solver = matrix.cholesky()?;
        let by: Vec<usize> = free.iter().map(|f| f.column).collect();
        let at = |values: &[f64], starts: &[[f64; 2]]| {
            let (model, own, _) = self.model(self.engine, chosen, values);
            let trial =
                self.joint.trial(self.engine, (&model, &own), starts, self.windows, self.scale, &by)?;
            let cost = trial.cost / self.dispersion + prior(values);
            cost.is_finite().then_some((cost, trial))
        };
        let moved = |from: &[f64], by: &DVector<f64>, share: f64| -> Vec<f64> {
            let mut out = from.to_vec();
            for (f, d) in free.iter().zip(by.iter()) {
                out[f.column] = (out[f.column] + share * d).clamp(f.bounds[0], f.bounds[1]);
            }
            out
        };
        let shifted = |starts: &[[f64; 2]], by: &[[f64; 2]]| -> Vec<[f64; 2]> {
            starts.iter().zip(by).map(|(x, d)| [x[0] + d[0], x[1] + d[1]]).collect()
        };
        let within = |from: &[f64]| -> Vec<f64> {
            let mut out = columns.blank(self.engine);
            (0..out.len()).filter(|&c| in_use[c]).for_each(|c| out[c] = self.values[c]);
            free.iter().for_each(|f| out[f.column] = from[f.column].clamp(f.bounds[0], f.bounds[1]));
            out
        };
        let tried = begins.iter().filter_map(|begin| {
            let values = within(&begin.values);
            at(&values, &begin.starts).map(|(cost, trial)| (cost, trial, values, begin.starts.clone()))
        });
        let (mut cost, mut trial, mut values, mut starts) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
        for _ in 0..STEPS {
            starts = shifted(&starts, &trial.shifts);
            let pull = DVector::from_fn(free.len(), |i, _| {
                let f = &free[i];
                -trial.gradient[i] / self.dispersion - f.precision * (values[f.column] - f.mean)
            });
            let by = solver.solve(&pull);
            let next = [1.0, 0.3].into_iter().find_map(|share| {
                let there = moved(&values, &by, share);
                at(&there, &starts).filter(|(c, _)| *c < cost).map(|(c, t)| (there, c, t))
            });
            let Some((there, lower, next)) = next else { break };
            let gain = cost - lower;
            (values, cost, trial) = (there, lower, next);
            if gain < SETTLED {
                break;
            }
        }
        let log = log_occam - 0.5 * cost;
        log.is_finite().then(|| (log, Refined { values, starts: shifted(&starts, &trial.shifts) }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{configured, with_around};

    #[test]
    fn a_fit_leads_away_from_where_an_effect_is_absent_and_its_derivative_vanishes() {
        with_around(0.06, |around, weighed| {
            let with_limit = configured(around, &[EffectId::SteeringRateLimit]);
            assert_eq!(around.stuck(&with_limit, around.values), Some(EffectId::SteeringRateLimit));
            let limited = around.by_rollouts_to_the_end(&weighed.total, &with_limit).unwrap().fitted;
            assert_eq!(around.stuck(&with_limit, &limited.values), None);
        });
    }

    #[test]
    fn a_fit_begins_anew_without_the_little_of_what_does_nearly_the_same() {
        with_around(0.06, |around, weighed| {
            let [nothing, with_lag] = [&[][..], &[EffectId::SteeringLag]].map(|e| configured(around, e));
            let mut fit = around.by_rollouts_to_the_end(&weighed.total, &with_lag).unwrap().fitted;
            let relaxation = around.columns.of_effect(EffectId::TireRelaxation).unwrap();
            fit.values[relaxation.start] = 0.02;
            let begin = around.without_alike(&with_lag, &fit).unwrap();
            let absent = around.engine.absent(EffectId::TireRelaxation);
            assert_eq!(begin.values[relaxation.clone()], absent);
            let others = |c: &usize| !relaxation.contains(c);
            assert!((0..begin.values.len()).filter(others).all(|c| begin.values[c] == fit.values[c]));
            // Nothing of it, or no effect that it stands beside: nothing to begin anew from.
            assert!(around.without_alike(&with_lag, &begin).is_none());
            assert!(around.without_alike(&nothing, &fit).is_none());
        });
    }
}
