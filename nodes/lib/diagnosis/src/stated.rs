//! What survives on data that nothing was fitted to.

use gripsight_estimation::selection::{Quadratic, Term};
use gripsight_estimation::shooting::{self, Parameter};
use gripsight_model::Site;
use rayon::prelude::*;

use crate::around::{Around, Refined};
use crate::budget::Scorer;
use crate::decisions;
use crate::discrepancy::Discrepancy;
use crate::infer::FIRST;

/// Iterations of the fit of start states.
const START_ITERATIONS: usize = 6;

/// Probabilities of the fitted data count no nearer to nothing or to certainty.
const LEAST_PROBABILITY: f64 = 1e-4;

/// Effects of a model, those needed least, that are taken out by a fit and not by a look.
const FITTED: usize = 3;

/// A configuration that was tried.
#[derive(Debug, Clone)]
struct Tried {
    chosen: Vec<usize>,
    values: Vec<f64>,
    /// Robust sum of squares on data held out.
    cost: f64,
}

/// What is left in the end.
pub(crate) struct Stated {
    pub(crate) chosen: Vec<usize>,
    pub(crate) fitted: Refined,
    pub(crate) statements: Vec<Statement>,
}

/// An effect of the model that is left in the end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Statement {
    pub(crate) term: usize,
    /// Effects that do nearly the same and are not among the candidates.
    pub(crate) untried: usize,
    /// Logarithm of the predictive ratio of held-out data, with it over without it.
    pub(crate) held_out_log_ratio: f64,
    /// How many half widths of its interval its size is away from nothing.
    pub(crate) size_over_half_width: f64,
    /// Share of the error on data held out, noise included, that is left without it and that it closes.
    pub(crate) closes: f64,
    /// What it explains over what of the unnamed looks like it; infinite where nothing unnamed is needed.
    pub(crate) over_unexplained: f64,
}

impl Statement {
    /// Chance that the effect is a cause.
    pub(crate) fn chance(&self) -> f64 {
        let signs = [self.closes, self.size_over_half_width];
        let sign = |i: usize| {
            let [unit, least] = [decisions::CHANCE_UNITS[i], decisions::CHANCE_LEAST[i]];
            decisions::CHANCE[i + 1] * (signs[i].max(least) / unit).ln()
        };
        let log_odds = decisions::CHANCE[0] + (0..signs.len()).map(sign).sum::<f64>();
        // A chance is shared with what does nearly the same and is not among the candidates.
        1.0 / (1.0 + (-log_odds).exp()) / (1.0 + self.untried as f64)
    }
}

impl Around<'_, '_> {
    /// Robust sum of squares of a model on data held out: all channels, under the noise of the inference.
    fn cost_apart(&self, scorer: &Scorer<'_>, chosen: &[usize], values: &[f64]) -> f64 {
        let (model, own, _) = self.model(&scorer.engine, chosen, values);
        let fixed = |&start: &f64| Parameter { start, low: start, high: start, free: false, prior: None };
        let parameters: Vec<Parameter> = own.iter().map(fixed).collect();
        let problem = self.engine.problem(&model, &scorer.windows.windows, &parameters, START_ITERATIONS);
        shooting::descend(&problem, None).at.cost
    }

    /// The terms with some of them no larger than in any car: their prior alone lets strong data keep what every car has a little of.
    fn without(&self, gone: &[usize]) -> Vec<Term> {
        /// Standard deviations of the prior.
        const MOST: f64 = 2.0;
        let mut terms = self.terms.to_vec();
        for &i in gone.iter().filter(|&&i| self.terms[i].log_weights.len() > 1) {
            for p in &mut terms[i].priors {
                let most = MOST * p.sigma[0];
                p.bounds = [p.bounds[0].max(p.offset - most), p.bounds[1].min(p.offset + most)];
            }
        }
        terms
    }

    /// Asks data that nothing was fitted to. Their predictive ratio multiplies the odds that the fitted data give: together they are the evidence
    /// of all data. `fitted`: the most probable configuration; `alone`: that of effects alone; `probability`: of each term, by the fitted data.
    pub(crate) fn stated(
        &self,
        problem: &Quadratic,
        (chosen, fitted): (Vec<usize>, Refined),
        alone: Option<Vec<usize>>,
        scorer: &Scorer<'_>,
        probability: &[f64],
    ) -> Option<Stated> {
        let none = self.without(&(0..chosen.len()).collect::<Vec<usize>>());
        let blank = vec![0; chosen.len()];
        let null = Around { terms: &none, ..*self }.by_rollouts(problem, &blank)?.1.values;
        let worst = self.cost_apart(scorer, &blank, &null);
        let asked = Asked { around: self, problem, scorer, probability, worst };
        let cost = self.cost_apart(scorer, &chosen, &fitted.values);
        let mut now = Tried { chosen, values: fitted.values, cost };
        // The best of effects alone, where it does as well: free terms may do, roughly, what an effect does.
        if let Some(alone) = alone.filter(|a| *a != now.chosen) {
            let alone = asked.fitted(alone)?;
            if 1.0 - now.cost / alone.cost < decisions::LEAST_CLOSED {
                now = alone;
            }
        }
        now = asked.without_needless_free_terms(now);
        now = asked.with_likely_effects(now)?;
        let (now, simpler) = asked.without_unlikely_effects(now);
        let discrepancy = Discrepancy::of(self, problem, &now.chosen, &now.values)?;
        let statements = simpler
            .iter()
            .map(|(term, lacking)| Statement {
                term: *term,
                untried: 0,
                closes: 1.0 - now.cost / lacking.cost,
                held_out_log_ratio: asked.log_ratio(lacking.cost, now.cost),
                size_over_half_width: f64::NAN,
                over_unexplained: discrepancy.beside(self.columns.effects[term - FIRST], &now.values),
            })
            .collect();
        let (_, fitted) = self.by_rollouts(problem, &now.chosen)?;
        Some(Stated { chosen: now.chosen, fitted, statements })
    }
}

/// What all questions to data held out share.
struct Asked<'q, 'p, 'a, 's> {
    around: &'q Around<'p, 'a>,
    problem: &'q Quadratic,
    scorer: &'q Scorer<'s>,
    /// Of each term, by the fitted data.
    probability: &'q [f64],
    /// Cost with no effect at all.
    worst: f64,
}

impl Asked<'_, '_, '_, '_> {
    /// Logarithm of how much likelier held-out data are by one model than by a simpler one.
    fn log_ratio(&self, simpler: f64, fuller: f64) -> f64 {
        0.5 * (simpler - fuller) / self.around.dispersion
    }

    /// Logarithm of a term's odds by all data.
    fn log_odds(&self, term: usize, simpler: f64, fuller: f64) -> f64 {
        let p = self.probability[term].clamp(LEAST_PROBABILITY, 1.0 - LEAST_PROBABILITY);
        (p / (1.0 - p)).ln() + self.log_ratio(simpler, fuller)
    }

    /// A configuration fitted by rollouts.
    fn fitted(&self, chosen: Vec<usize>) -> Option<Tried> {
        let values = self.around.by_rollouts(self.problem, &chosen)?.1.values;
        let cost = self.around.cost_apart(self.scorer, &chosen, &values);
        Some(Tried { chosen, values, cost })
    }

    /// A configuration without a part of it, fitted nearby.
    fn lacking(&self, from: &Tried, part: &[usize]) -> Option<Tried> {
        let mut chosen = from.chosen.clone();
        part.iter().for_each(|&i| chosen[i] = 0);
        let terms = self.around.without(part);
        let lacking = Around { terms: &terms, ..*self.around };
        let mut values = lacking.nearby(self.problem, &chosen)?.1.values;
        let mut cost = self.around.cost_apart(self.scorer, &chosen, &values);
        if cost.is_nan() || cost > self.worst {
            // Worse than with no effect at all: too far away for a look.
            values = lacking.by_rollouts(self.problem, &chosen)?.1.values;
            cost = self.around.cost_apart(self.scorer, &chosen, &values);
        }
        Some(Tried { chosen, values, cost })
    }

    /// A configuration that an effect was taken out of, fitted by rollouts.
    fn refitted(&self, chosen: Vec<usize>, gone: usize) -> Option<Tried> {
        let terms = self.around.without(&[gone]);
        let values = Around { terms: &terms, ..*self.around }.by_rollouts(self.problem, &chosen)?.1.values;
        let cost = self.around.cost_apart(self.scorer, &chosen, &values);
        Some(Tried { chosen, values, cost })
    }

    /// The effects of a configuration, by term, or those that it lacks.
    fn effects(&self, of: &Tried, inside: bool) -> Vec<usize> {
        let all = FIRST..FIRST + self.around.columns.effects.len();
        all.filter(|&i| self.around.terms[i].log_weights.len() > 1 && (of.chosen[i] > 0) == inside).collect()
    }

    /// Takes out the free terms of one site after the other, the least needed first, as long as they close too little.
    fn without_needless_free_terms(&self, mut now: Tried) -> Tried {
        let columns = self.around.columns;
        loop {
            let of = |site: Site| -> Vec<usize> {
                let terms = columns.of_site(site).map(|c| columns.term_of_flexible(c));
                terms.filter(|&t| now.chosen[t] > 0).collect()
            };
            let parts: Vec<Vec<usize>> =
                Site::ALL.into_iter().map(of).filter(|terms| !terms.is_empty()).collect();
            let tried: Vec<Tried> =
                parts.into_par_iter().filter_map(|part| self.lacking(&now, &part)).collect();
            let least = tried.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
            match least.filter(|l| 1.0 - now.cost / l.cost < decisions::LEAST_CLOSED) {
                Some(least) => now = least,
                None => return now,
            }
        }
    }

    /// Takes in the effects that all data make likelier than not, the likeliest first.
    fn with_likely_effects(&self, mut now: Tried) -> Option<Tried> {
        loop {
            let offered = self.effects(&now, false).into_iter();
            let offered: Vec<usize> = offered.filter(|&i| self.probability[i] >= decisions::LISTED).collect();
            let with = |i: usize| {
                let mut fuller = now.chosen.clone();
                fuller[i] = 1;
                fuller
            };
            let tried: Vec<(usize, f64)> = offered
                .into_par_iter()
                .filter_map(|i| {
                    let fuller = with(i);
                    let values = self.around.nearby(self.problem, &fuller)?.1.values;
                    let cost = self.around.cost_apart(self.scorer, &fuller, &values);
                    Some((i, self.log_odds(i, now.cost, cost)))
                })
                .filter(|(_, log_odds)| log_odds.is_finite())
                .collect();
            let best = tried.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).filter(|b| b.1 > 0.0);
            let Some((i, _)) = best else { return Some(now) };
            let fuller = self.fitted(with(i))?;
            if fuller.cost.is_nan() || fuller.cost >= now.cost {
                return Some(now);
            }
            now = fuller;
        }
    }

    /// Takes out the effects that all data make less likely than not, the unlikeliest first; what is left, and that without each effect.
    fn without_unlikely_effects(&self, mut now: Tried) -> (Tried, Vec<(usize, Tried)>) {
        loop {
            let simpler: Vec<(usize, Tried)> = self
                .effects(&now, true)
                .into_par_iter()
                .filter_map(|i| Some((i, self.lacking(&now, &[i])?)))
                .collect();
            let log_odds = |(i, lacking): &(usize, Tried)| self.log_odds(*i, lacking.cost, now.cost);
            let mut simpler = simpler;
            // A look from nearby may end short of what the others can do: those that seem needed least are fitted.
            simpler.sort_by(|a, b| log_odds(a).total_cmp(&log_odds(b)));
            simpler.par_iter_mut().take(FITTED).for_each(|(i, lacking)| {
                let better = self.refitted(lacking.chosen.clone(), *i).filter(|b| b.cost < lacking.cost);
                if let Some(better) = better {
                    *lacking = better;
                }
            });
            let least = simpler.iter().min_by(|a, b| log_odds(a).total_cmp(&log_odds(b)));
            match least.filter(|l| log_odds(l) < 0.0) {
                Some(least) => now = least.1.clone(),
                None => return (now, simpler),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows() -> Vec<(bool, Statement)> {
        let path =
            concat!(env!("CARGO_MANIFEST_DIR"), "/../../../tests/results/withheld/development_effects.csv");
        let table = std::fs::read_to_string(path).unwrap();
        let row = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            let number = |i: usize| cells[i].parse::<f64>().unwrap();
            let [closes, size_over_half_width, over_unexplained] = [5, 6, 7].map(number);
            let statement = Statement {
                term: 0,
                untried: 0,
                held_out_log_ratio: 0.0,
                size_over_half_width,
                closes,
                over_unexplained,
            };
            (cells[4] == "1", statement)
        };
        let counts = |(_, s): &(bool, Statement)| s.over_unexplained >= decisions::LEAST_OVER_UNEXPLAINED;
        table.lines().skip(1).map(row).filter(counts).collect()
    }

    #[test]
    fn the_chance_is_that_of_the_fit_to_the_development_effects() {
        let rows = rows();
        assert!(rows.len() > 100, "{}", rows.len());
        let chances = || rows.iter().map(|(cause, s)| (f64::from(u8::from(*cause)), s.chance()));
        // At the best fit as many are causes as the chances promise: overall, and among those that are named.
        let (causes, promised) = chances().fold((0.0, 0.0), |sum, (c, p)| (sum.0 + c, sum.1 + p));
        assert!((causes - promised).abs() < 0.03 * causes, "{causes} causes, {promised} promised");
        let loss = -chances().map(|(c, p)| (c * p + (1.0 - c) * (1.0 - p)).ln()).sum::<f64>();
        let share = causes / rows.len() as f64;
        let constant = -(causes * share.ln() + (rows.len() as f64 - causes) * (1.0 - share).ln());
        assert!(loss < 0.75 * constant, "log loss {loss}, that of a constant {constant}");
    }

    #[test]
    fn each_sign_raises_the_chance() {
        let weak = Statement {
            term: 0,
            untried: 0,
            held_out_log_ratio: 0.0,
            size_over_half_width: 0.7,
            closes: 0.01,
            over_unexplained: 0.1,
        };
        assert!(weak.chance() < 0.1, "{}", weak.chance());
        let strong =
            Statement { size_over_half_width: 8.0, closes: 0.5, over_unexplained: f64::INFINITY, ..weak };
        assert!(strong.chance() > 0.8, "{}", strong.chance());
        for less in [
            Statement { size_over_half_width: 1.0, ..strong },
            Statement { closes: 0.001, ..strong },
            Statement { untried: 1, ..strong },
        ] {
            assert!(less.chance() < strong.chance());
        }
    }
}
