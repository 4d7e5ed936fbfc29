//! What survives on data that nothing was fitted to.

use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use gripsight_estimation::selection::Term;
use gripsight_model::{EffectId, Site};
use rayon::prelude::*;

use crate::around::{Around, Ended, Refined};
use crate::budget::Scorer;
use crate::decisions;
use crate::discrepancy::Discrepancy;
use crate::infer::FIRST;
use crate::joint::Weighed;
use crate::moves::TURNS;
use crate::near::Near;
use crate::statement::Statement;

/// Standard deviations of what any car has of an effect, beyond which it has more.
const USUAL: f64 = 2.0;

/// A configuration that was fitted.
#[derive(Debug, Clone)]
pub(crate) struct Tried {
    pub(crate) chosen: Vec<usize>,
    pub(crate) fitted: Refined,
    /// Robust sum of squares on data that it was not fitted to.
    pub(crate) cost: f64,
}

/// What is left in the end.
pub(crate) struct Stated {
    pub(crate) chosen: Vec<usize>,
    pub(crate) fitted: Refined,
    /// Free terms whose place an effect took, and that are needed beside it: something is left there that no effect does.
    pub(crate) beside: Vec<usize>,
    pub(crate) statements: Vec<Statement>,
}

/// An effect that all data make likelier than not.
pub(crate) struct Needed {
    pub(crate) term: usize,
    /// The model without it.
    pub(crate) lacking: Tried,
    /// What does nearly the same, by term, with the evidence of the model that has it in its place, over that of the model.
    pub(crate) rivals: Vec<(usize, f64)>,
}

impl Around<'_, '_> {
    /// The terms with those that a configuration lacks no larger than in any car: their prior alone lets strong data keep what every car has a little
    /// of, and more.
    fn lacking(&self, chosen: &[usize]) -> Vec<Term> {
        let mut terms = self.terms.to_vec();
        let lacking = terms.iter_mut().zip(chosen).filter(|(t, c)| t.log_weights.len() > 1 && **c == 0);
        for p in lacking.flat_map(|(t, _)| &mut t.priors) {
            let most = USUAL * p.sigma[0];
            p.bounds = [p.bounds[0].max(p.offset - most), p.bounds[1].min(p.offset + most)];
        }
        terms
    }

    /// Asks data that nothing was fitted to. Their predictive ratio, times the odds before the data are looked at, decides what is in the model.
    /// `start`: the most probable configuration by the fitted data, and its fit; `alone`: that of effects alone.
    pub(crate) fn stated(
        &self,
        library: &[EffectId],
        weighed: &Weighed,
        (start, fitted): (Vec<usize>, Refined),
        alone: Option<Vec<usize>>,
        scorer: &Scorer<'_>,
    ) -> Option<Stated> {
        let asked = Asked::new(self, library, scorer);
        let near = Near::to(self, library, &fitted)?;
        let nothing = asked.fitted_from(&vec![0; start.len()], self, weighed)?;
        let mut now = asked.fitted_from(&start, &near.around(self), &near.weighed)?;
        // The best of effects alone, where it does as well: free terms may do, roughly, what an effect does.
        if let Some(alone) = alone.filter(|a| *a != now.chosen) {
            let alone = asked.fitted(&alone, &now)?;
            if 1.0 - now.cost / alone.cost < decisions::LEAST_CLOSED {
                now = alone;
            }
        }
        let least = nothing.cost;
        let mut weeded = asked.weeded(now)?;
        // Each part may be needed beside the others, and all of them lead nowhere.
        if least < weeded.left.cost {
            weeded = asked.weeded(nothing)?;
        }
        let (mut now, mut needed) = asked.with_the_likeliest_of_alike(&weeded);
        let mut taken = weeded.taken;
        // Beside another one of those that are alike something else may be needed.
        for _ in 0..TURNS {
            if now.chosen == weeded.left.chosen {
                break;
            }
            weeded = asked.weeded(now)?;
            (now, needed) = asked.with_the_likeliest_of_alike(&weeded);
            taken.extend(&weeded.taken);
        }
        let (beside, whole) = asked.with_what_is_left(&now, &taken);
        let near = asked.near(&whole)?;
        let around = near.around(self);
        let discrepancy = Discrepancy::of(&around, &near.weighed.total, &whole.chosen, &whole.fitted.values)?;
        let statements = needed
            .into_iter()
            .map(|Needed { term, lacking, rivals }| Statement {
                term,
                untried: 0,
                rivals,
                closes: 1.0 - now.cost / lacking.cost,
                held_out_log_ratio: asked.log_ratio(lacking.cost, now.cost),
                size_over_half_width: f64::NAN,
                refuted: false,
                over_unexplained: discrepancy.beside(self.columns.effects[term - FIRST], &now.fitted.values),
            })
            .collect();
        Some(Stated { chosen: now.chosen, fitted: now.fitted, beside, statements })
    }
}

/// What all questions to data held out share.
pub(crate) struct Asked<'q, 'p, 'a, 's> {
    pub(crate) around: &'q Around<'p, 'a>,
    library: &'q [EffectId],
    scorer: &'q Scorer<'s>,
    /// What was fitted already. A fit asks for nothing that a linearisation says but where to begin, and is as good around another one.
    fits: RefCell<HashMap<Vec<usize>, Option<Tried>>>,
    /// Linearisations around fits, by configuration.
    nears: RefCell<HashMap<Vec<usize>, Arc<Near>>>,
    /// Start states of the first of them on the data held out.
    starts: OnceLock<Vec<[f64; 2]>>,
}

impl<'q, 'p, 'a, 's> Asked<'q, 'p, 'a, 's> {
    pub(crate) fn new(around: &'q Around<'p, 'a>, library: &'q [EffectId], scorer: &'q Scorer<'s>) -> Self {
        let (fits, nears) = (RefCell::default(), RefCell::default());
        Self { around, library, scorer, fits, nears, starts: OnceLock::new() }
    }

    /// Logarithm of how much likelier held-out data are by one model than by a simpler one.
    pub(crate) fn log_ratio(&self, simpler: f64, fuller: f64) -> f64 {
        0.5 * (simpler - fuller) / self.around.dispersion
    }

    /// Logarithm of the odds that an effect, by term, matters, from what is left without it and with it.
    pub(crate) fn log_odds(&self, term: usize, simpler: f64, fuller: f64) -> f64 {
        let effect = self.around.columns.effects[term - FIRST];
        let log_odds = prior_log_odds() + self.log_ratio(simpler, fuller);
        of_an_effect(effect, 1.0 - fuller / simpler, log_odds)
    }

    /// Everything linearised around a fit.
    pub(crate) fn near(&self, fit: &Tried) -> Option<Arc<Near>> {
        if let Some(near) = self.nears.borrow().get(&fit.chosen) {
            return Some(near.clone());
        }
        let near = Arc::new(Near::to(self.around, self.library, &fit.fitted)?);
        self.nears.borrow_mut().insert(fit.chosen.clone(), near.clone());
        Some(near)
    }

    /// A configuration fitted by rollouts, from another one's fit.
    pub(crate) fn fitted(&self, chosen: &[usize], from: &Tried) -> Option<Tried> {
        if let Some(found) = self.known(chosen, from) {
            return found;
        }
        let near = self.near(from)?;
        self.fitted_from(chosen, &near.around(self.around), &near.weighed)
    }

    /// What was found of a configuration before, unless an effect of a place is new in it: looked for from another fit, it may be found at another place.
    fn known(&self, chosen: &[usize], from: &Tried) -> Option<Option<Tried>> {
        let columns = self.around.columns;
        let is_new = |(i, e): (usize, &EffectId)| {
            e.is_of_a_place() && chosen[FIRST + i] > 0 && from.chosen[FIRST + i] == 0
        };
        let is_somewhere = columns.effects.iter().enumerate().any(is_new);
        self.fits.borrow().get(chosen).filter(|_| !is_somewhere).cloned()
    }

    /// The same from where everything was linearised.
    pub(crate) fn fitted_from(
        &self,
        chosen: &[usize],
        around: &Around<'_, '_>,
        weighed: &Weighed,
    ) -> Option<Tried> {
        let terms = around.lacking(chosen);
        let around = Around { terms: &terms, ..*around };
        let tried = |ended: Ended| {
            let cost = around.predictive_cost(self.scorer, chosen, &ended, &self.starts);
            Tried { chosen: chosen.to_vec(), fitted: ended.fitted, cost }
        };
        let found = around.by_rollouts_to_the_end(&weighed.total, chosen).map(tried);
        self.fits.borrow_mut().insert(chosen.to_vec(), found.clone());
        // With a patch at another place this is another fit.
        self.nears.borrow_mut().remove(chosen);
        found
    }

    /// What other configurations are foretold to leave of data held out, from a fit.
    pub(crate) fn foretold(&self, fit: &Tried, others: &[Vec<usize>]) -> Option<Vec<f64>> {
        let near = self.near(fit)?;
        let around = near.around(self.around);
        let of = |chosen: &Vec<usize>| {
            let terms = around.lacking(chosen);
            let left = Around { terms: &terms, ..around }.foretold(&near.weighed, chosen);
            left.unwrap_or(f64::INFINITY)
        };
        let mut left: Vec<f64> = others.par_iter().chain(rayon::iter::once(&fit.chosen)).map(of).collect();
        let own = left.pop()?;
        Some(left.into_iter().map(|left| fit.cost + left - own).collect())
    }

    /// The effects of a configuration, by term, or those that it lacks.
    pub(crate) fn effects(&self, of: &Tried, inside: bool) -> Vec<usize> {
        let all = FIRST..FIRST + self.around.columns.effects.len();
        all.filter(|&i| self.around.terms[i].log_weights.len() > 1 && (of.chosen[i] > 0) == inside).collect()
    }

    /// The free terms of a site that a configuration has.
    pub(crate) fn free_terms(&self, of: &Tried, site: Site) -> Vec<usize> {
        let columns = self.around.columns;
        let terms = columns.of_site(site).map(|c| columns.term_of_flexible(c));
        terms.filter(|&t| of.chosen[t] > 0).collect()
    }
}

/// Logarithm of the odds that an effect matters, before the data are looked at.
fn prior_log_odds() -> f64 {
    (decisions::PRIOR / (1.0 - decisions::PRIOR)).ln()
}

/// Logarithm of the odds that an effect of a model matters which closes a share of what is left without it. One whose derivative vanishes where it is absent has no
/// size that is far from nothing or near: it is needed as free terms are, or not at all.
fn of_an_effect(effect: EffectId, closes: f64, log_odds: f64) -> f64 {
    let needless = effect.spec().flat_at_null && closes < decisions::LEAST_CLOSED;
    if needless { f64::NEG_INFINITY } else { log_odds }
}

#[cfg(test)]
mod tests {
    use gripsight_estimation::split;

    use super::*;
    use crate::testing::{configured, with_around};

    #[test]
    fn from_a_model_without_any_effect_the_cause_is_found_with_its_size() {
        with_around(0.06, |around, weighed| {
            let scorer = Scorer::new(around.engine, None, &split(around.engine.recording, true));
            let here = Refined { values: around.values.to_vec(), starts: around.starts.to_vec() };
            let start = (configured(around, &[]), here);
            let found = around.stated(&around.columns.effects, weighed, start, None, &scorer).unwrap();
            let named: Vec<EffectId> =
                found.statements.iter().map(|s| around.columns.effects[s.term - FIRST]).collect();
            assert_eq!(named, [EffectId::SteeringLag]);
            let lag = around.columns.of_effect(EffectId::SteeringLag).unwrap().start;
            assert!((found.fitted.values[lag] - 0.06).abs() < 0.01, "{}", found.fitted.values[lag]);
        });
    }

    #[test]
    fn a_limit_that_hardly_acts_is_not_needed_however_likely_it_looks() {
        assert_eq!(of_an_effect(EffectId::SteeringRateLimit, 0.004, 30.0), f64::NEG_INFINITY);
        assert_eq!(of_an_effect(EffectId::SteeringRateLimit, 0.05, 30.0), 30.0);
        // A small size may be known well.
        assert_eq!(of_an_effect(EffectId::GyroBias, 0.004, 30.0), 30.0);
    }
}
