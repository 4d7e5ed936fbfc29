//! Configurations fitted by rollouts, and freed of what rollouts find needless.

use gripsight_estimation::Windows;
use gripsight_estimation::selection::{Configuration, Quadratic, Selection, Term, configuration};
use gripsight_estimation::shooting::{self, Parameter, Prior, Problem};
use gripsight_model::{BASE, EffectId, ExtendedModel, Site};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

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
/// Loss of the linear evidence up to which rollouts are asked whether an effect is needed.
const CLEAR: f64 = 40.0;
/// Loss up to which a part is asked for again once another one has gone.
const DOUBTFUL: f64 = 10.0;

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

/// A configuration of which nothing is needless.
pub(crate) struct Pruned {
    pub(crate) chosen: Vec<usize>,
    pub(crate) fitted: Refined,
    /// What the evidence loses without each effect, by term.
    pub(crate) losses: Vec<(usize, f64)>,
}

/// A configuration fitted by rollouts.
#[derive(Debug, Clone)]
pub(crate) struct Refined {
    pub(crate) values: Vec<f64>,
    pub(crate) starts: Vec<[f64; 2]>,
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
        self.refined(ITERATIONS, chosen, &linear.step, None)
    }

    /// The same, as far as it goes. `near`: another one that is fitted, and which one; what tells them apart is added by the linearisation.
    pub(crate) fn by_rollouts_to_the_end(
        &self,
        problem: &Quadratic,
        chosen: &[usize],
        near: Option<(&[usize], &Refined)>,
    ) -> Option<Refined> {
        let linear = |chosen: &[usize]| {
            configuration(problem, self.dispersion, self.terms, chosen).map(|found| found.step)
        };
        let step = linear(chosen)?;
        let near = near.and_then(|(other, fitted)| {
            let (apart, has) = (&step - linear(other)?, self.in_use(other));
            // Of an effect that is absent here the linearisation tells the size alone: what shapes it stays.
            let shapes = |e: &EffectId| self.columns.of_effect(*e).map(|r| r.start + e.sizing()..r.end);
            let shaping: Vec<usize> = self.columns.effects.iter().filter_map(shapes).flatten().collect();
            let at = |c: usize| match (has[c], shaping.contains(&c)) {
                (true, _) => fitted.values[c] + apart[c],
                (false, true) => self.values[c],
                (false, false) => self.values[c] + step[c],
            };
            let values = (0..self.values.len()).map(at).collect();
            Some(Refined { values, starts: fitted.starts.clone() })
        });
        self.refined(ITERATIONS_TO_THE_END, chosen, &step, near)
    }

    /// The model of a configuration fitted by rollouts, from where the linear step leads, where the linearisation is, or `near`, whichever is best. Terms
    /// that it has only as little of as any car are absent there, but for those that every car has.
    fn refined(
        &self,
        iterations: usize,
        chosen: &[usize],
        step: &DVector<f64>,
        near: Option<Refined>,
    ) -> Option<Refined> {
        let Self { engine, columns, terms, values, starts, windows, dispersion, .. } = *self;
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
        let linear = Refined {
            values: values.iter().zip(step.iter()).map(|(v, s)| v + s).collect(),
            starts: starts.to_vec(),
        };
        let here = Refined { values: values.to_vec(), starts: starts.to_vec() };
        let (cost, begin) = [linear, here]
            .into_iter()
            .chain(near)
            .map(|begin| {
                let at: Vec<f64> = parameters
                    .iter()
                    .zip(&map)
                    .map(|(p, &c)| if p.free { begin.values[c].clamp(p.low, p.high) } else { p.start })
                    .collect();
                let problem = engine.problem(&model, &windows.windows, &parameters, 0);
                let cost = shooting::evaluate(&problem, &at, &begin.starts).cost;
                (cost, (at, begin.starts))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        let (at, begin) = begin;
        parameters.iter_mut().zip(at).for_each(|(p, at)| p.start = at);
        let problem = Problem {
            tolerance: SETTLED * dispersion / cost,
            ..engine.problem(&model, &windows.windows, &parameters, iterations)
        };
        let best = shooting::descend(&problem, Some(begin));
        for (&column, &v) in map.iter().zip(&best.parameters) {
            target[column] = v;
        }
        best.at.cost.is_finite().then_some(Refined { values: target, starts: best.starts })
    }

    /// A configuration fitted near the linearisation, for a look, with the logarithm of its evidence by rollouts, its prior weight counted: by steps whose
    /// derivatives stay those of the linearisation (chord steps), so that each costs one plain rollout.
    pub(crate) fn nearby(&self, problem: &Quadratic, chosen: &[usize]) -> Option<(f64, Refined)> {
        let Configuration { step, log_occam, .. } =
            configuration(problem, self.dispersion, self.terms, chosen)?;
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
        // Where the linear answer leads nowhere: from where it began.
        let mut begin = columns.blank(self.engine);
        (0..begin.len()).filter(|&c| in_use[c]).for_each(|c| begin[c] = self.values[c]);
        let linear = DVector::from_iterator(free.len(), free.iter().map(|f| step[f.column]));
        let mut starts = self.starts.to_vec();
        let mut values = moved(&begin, &linear, 1.0);
        let (mut cost, mut trial) = match at(&values, &starts) {
            Some(found) => found,
            None => {
                values = moved(&begin, &linear, 0.0);
                at(&values, &starts)?
            }
        };
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

    /// What could be taken out of a configuration: each effect, the flexible terms of each site, and both of one site.
    fn moves(&self, chosen: &[usize]) -> Vec<Vec<usize>> {
        let effects = (FIRST..FIRST + self.columns.effects.len()).filter(|&i| chosen[i] > 0);
        let flexible = |site: Site| -> Vec<usize> {
            let terms = self.columns.of_site(site).map(|c| self.columns.term_of_flexible(c));
            terms.filter(|&t| chosen[t] > 0).collect()
        };
        let mut out: Vec<Vec<usize>> = Vec::new();
        for i in effects {
            out.push(vec![i]);
            let sites = self.columns.effects[i - FIRST].spec().sites;
            let beside: Vec<usize> = sites.iter().flat_map(|s| flexible(*s)).collect();
            if !beside.is_empty() {
                out.push([vec![i], beside].concat());
            }
        }
        out.extend(Site::ALL.into_iter().map(flexible).filter(|f| !f.is_empty()));
        out
    }

    /// How much the evidence falls without a part of a configuration: by rollouts, where the linearisation does not make it clear.
    fn loss(&self, problem: &Quadratic, chosen: &[usize], part: &[usize], with: f64) -> Option<f64> {
        let linear = |chosen: &[usize]| {
            configuration(problem, self.dispersion, self.terms, chosen).map(|c| c.log_evidence)
        };
        let mut without = chosen.to_vec();
        let mut weight = 0.0;
        let mut flat = false;
        for &i in part {
            without[i] = 0;
            weight += self.terms[i].log_weights[1] - self.terms[i].log_weights[0];
            let effect = self.columns.effects.get(i - FIRST);
            // A difference quotient promises what it likes.
            flat |= effect.is_some_and(|e| e.spec().flat_at_null);
        }
        let promised = linear(chosen)? - linear(&without)? + weight;
        if promised > CLEAR && !flat {
            return Some(promised);
        }
        self.nearby(problem, &without).map(|(log, _)| with - log)
    }

    /// Probability of each term's mattering, with the odds of the effects in the most probable configuration corrected by what the evidence
    /// loses without them by rollouts.
    pub(crate) fn confirmed(
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

    /// Drops what rollouts find needless, the most needless first; the others are asked again once it is gone.
    pub(crate) fn pruned(&self, problem: &Quadratic, chosen: &[usize]) -> Option<Pruned> {
        let mut chosen = chosen.to_vec();
        let (mut with, _) = self.nearby(problem, &chosen)?;
        let moves = self.moves(&chosen);
        let mut losses: Vec<(Vec<usize>, f64)> = moves
            .into_par_iter()
            .filter_map(|part| self.loss(problem, &chosen, &part, with).map(|loss| (part, loss)))
            .collect();
        losses.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut out: Vec<(usize, f64)> = Vec::new();
        let mut dropped = false;
        for (mut part, mut loss) in losses {
            let whole = part.len();
            part.retain(|&i| chosen[i] > 0);
            if dropped && !part.is_empty() && (part.len() < whole || loss < DOUBTFUL) {
                loss = self.loss(problem, &chosen, &part, with).unwrap_or(loss);
            }
            if loss < 0.0 && !part.is_empty() {
                part.iter().for_each(|&i| chosen[i] = 0);
                with = self.nearby(problem, &chosen)?.0;
                dropped = true;
            } else if let [i] = part[..]
                && i < FIRST + self.columns.effects.len()
            {
                out.push((i, loss));
            }
        }
        let fitted = self.by_rollouts(problem, &chosen)?;
        Some(Pruned { chosen, fitted, losses: out })
    }
}
