//! What survives on data that nothing was fitted to.

use std::collections::HashMap;
use std::sync::{Mutex, OnceLock};

use gripsight_estimation::selection::{Term, configuration};
use gripsight_model::{EffectId, Site};
use rayon::prelude::*;

use crate::around::{Around, Ended, Refined};
use crate::budget::Scorer;
use crate::columns::Columns;
use crate::decisions;
use crate::discrepancy::Discrepancy;
use crate::infer::FIRST;
use crate::joint::Weighed;
use crate::pruned::CLEAR;
use crate::statement::Statement;

/// Effects, the likeliest to be taken in and those needed least, that are asked for by a fit and not by a look alone.
const FITTED: usize = 3;

/// Effects that are looked at, those that the linearisation promises most of.
const LOOKED_AT: usize = 8;

/// Standard deviations of what any car has of an effect, beyond which it has more.
const USUAL: f64 = 2.0;

/// Times at most that effects are taken in and out.
const TURNS: usize = 4;

/// A configuration that was tried.
#[derive(Debug, Clone)]
struct Tried {
    chosen: Vec<usize>,
    fitted: Refined,
    /// Robust sum of squares on data that it was not fitted to.
    cost: f64,
    /// Its effects, by term, that it surely needs.
    sure: Vec<usize>,
}

impl Tried {
    /// Which configuration it is, and its fit.
    fn place(&self) -> Option<(&[usize], &Refined)> {
        Some((&self.chosen, &self.fitted))
    }
}

/// Configurations that were fitted to the end. A fit asks for nothing that a linearisation says but where to begin, and is as good around another one.
#[derive(Debug, Default)]
pub(crate) struct Fits(Mutex<HashMap<Vec<usize>, Option<Tried>>>);

impl Fits {
    fn known(&self, chosen: &[usize]) -> Option<Option<Tried>> {
        self.0.lock().ok()?.get(chosen).cloned()
    }

    fn learn(&self, chosen: Vec<usize>, fit: Option<Tried>) {
        if let Ok(mut fits) = self.0.lock() {
            fits.insert(chosen, fit);
        }
    }

    /// Forgets those with an effect of a place that a model lacks: linearised around this model, the effect is looked for at another place.
    pub(crate) fn forget_places_apart_from(&self, model: &[usize], columns: &Columns) {
        let elsewhere = |&t: &usize| columns.effects[t - FIRST].is_of_a_place() && model[t] == 0;
        let elsewhere: Vec<usize> = (FIRST..FIRST + columns.effects.len()).filter(elsewhere).collect();
        if let Ok(mut fits) = self.0.lock() {
            fits.retain(|chosen, _| elsewhere.iter().all(|&t| chosen[t] == 0));
        }
    }
}

/// An effect that all data make likelier than not.
struct Needed {
    term: usize,
    /// The model without it.
    lacking: Tried,
    /// What does nearly the same, by term, with the evidence of the model that has it in its place, over that of the model.
    rivals: Vec<(usize, f64)>,
}

/// A configuration from which everything was taken that is not needed.
struct Weeded {
    left: Tried,
    /// The same without each effect.
    simpler: Vec<(usize, Tried)>,
    /// Free terms whose place an effect took, and that still explain something.
    taken: Vec<usize>,
}

/// What is left in the end.
pub(crate) struct Stated {
    pub(crate) chosen: Vec<usize>,
    pub(crate) fitted: Refined,
    /// Free terms whose place an effect took, and that are needed beside it: something is left there that no effect does.
    pub(crate) beside: Vec<usize>,
    pub(crate) statements: Vec<Statement>,
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
    /// `start`: the most probable configuration by the fitted data, and its fit; `alone`: that of effects alone; `beside`: free terms whose place effects of
    /// the start took.
    pub(crate) fn stated(
        &self,
        weighed: &Weighed,
        (start, fitted): (Vec<usize>, Refined),
        (alone, beside): (Option<Vec<usize>>, &[usize]),
        scorer: &Scorer<'_>,
        fits: &Fits,
    ) -> Option<Stated> {
        let starts = OnceLock::new();
        let asked = Asked { around: self, weighed, scorer, fits, starts, worst: f64::INFINITY };
        let nothing = asked.fitted(vec![0; start.len()], None)?;
        let asked = Asked { worst: nothing.cost, ..asked };
        let mut now = asked.fitted(start.clone(), Some((&start, &fitted)))?;
        // The best of effects alone, where it does as well: free terms may do, roughly, what an effect does.
        if let Some(alone) = alone.filter(|a| *a != now.chosen) {
            let alone = asked.fitted(alone, now.place())?;
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
        let (now, simpler) = asked.with_the_likeliest_of_alike(weeded.left, weeded.simpler);
        let taken = [beside, &weeded.taken].concat();
        let (beside, whole) = asked.with_what_is_left(&now, &taken);
        let discrepancy = Discrepancy::of(self, &weighed.total, &whole.chosen, &whole.fitted.values)?;
        let statements = simpler
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
struct Asked<'q, 'p, 'a, 's> {
    around: &'q Around<'p, 'a>,
    weighed: &'q Weighed,
    scorer: &'q Scorer<'s>,
    /// Cost with no effect at all.
    worst: f64,
    /// What was fitted already.
    fits: &'q Fits,
    /// Start states of the first of them on the data held out.
    starts: OnceLock<Vec<[f64; 2]>>,
}

impl Asked<'_, '_, '_, '_> {
    /// Logarithm of how much likelier held-out data are by one model than by a simpler one.
    fn log_ratio(&self, simpler: f64, fuller: f64) -> f64 {
        0.5 * (simpler - fuller) / self.around.dispersion
    }

    /// Logarithm of the odds that an effect matters, from what is left without it and with it.
    fn log_odds(&self, simpler: f64, fuller: f64) -> f64 {
        prior_log_odds() + self.log_ratio(simpler, fuller)
    }

    /// The same of an effect of the model, by term, as [`of_an_effect`] weighs it.
    fn log_odds_of(&self, term: usize, simpler: f64, fuller: f64) -> f64 {
        let effect = self.around.columns.effects[term - FIRST];
        of_an_effect(effect, 1.0 - fuller / simpler, self.log_odds(simpler, fuller))
    }

    /// A configuration fitted by rollouts; `near`: another one with its fit.
    fn fitted(&self, chosen: Vec<usize>, near: Option<(&[usize], &Refined)>) -> Option<Tried> {
        if let Some(found) = self.fits.known(&chosen) {
            return found;
        }
        let found = self.tried(chosen.clone(), |around, chosen| {
            around.by_rollouts_to_the_end(&self.weighed.total, chosen, near)
        });
        self.fits.learn(chosen, found.clone());
        found
    }

    /// A configuration fitted roughly, for a look: beside another one, or, unless that predicts well enough, near the linearisation, whichever is better.
    fn look(&self, chosen: Vec<usize>, beside: &Tried, well: f64) -> Option<Tried> {
        if let Some(found) = self.fits.known(&chosen) {
            return found;
        }
        let total = &self.weighed.total;
        let look = self.tried(chosen.clone(), |around, chosen| {
            around.there(chosen, around.beside(total, chosen, beside.place()?)?.1)
        });
        if look.as_ref().is_some_and(|look| look.cost <= well) {
            return look;
        }
        let near = self.tried(chosen, |around, chosen| around.there(chosen, around.nearby(total, chosen)?.1));
        near.into_iter().chain(look).min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    fn tried(
        &self,
        chosen: Vec<usize>,
        fit: impl Fn(&Around<'_, '_>, &[usize]) -> Option<Ended>,
    ) -> Option<Tried> {
        let terms = self.around.lacking(&chosen);
        let ended = fit(&Around { terms: &terms, ..*self.around }, &chosen)?;
        let cost = self.around.predictive_cost(&terms, self.scorer, &chosen, &ended, &self.starts);
        let losses = self.around.linear_losses(&chosen, &ended).unwrap_or_default();
        let sure = losses.into_iter().filter(|(_, loss)| *loss > CLEAR).map(|(term, _)| term).collect();
        Some(Tried { chosen, fitted: ended.fitted, cost, sure })
    }

    /// A configuration without a part of it, fitted nearby.
    fn lacking(&self, from: &Tried, part: &[usize]) -> Option<Tried> {
        let mut chosen = from.chosen.clone();
        part.iter().for_each(|&i| chosen[i] = 0);
        // Below this cost the part is not worth the odds against it, and a better fit without it would say the same.
        let needless = from.cost - 2.0 * self.around.dispersion * prior_log_odds();
        let near = self.look(chosen.clone(), from, needless);
        // Worse than with no effect at all: too far away for a look.
        near.filter(|n| n.cost <= self.worst).or_else(|| self.fitted(chosen, from.place()))
    }

    /// The effects of a configuration, by term, or those that it lacks.
    fn effects(&self, of: &Tried, inside: bool) -> Vec<usize> {
        let all = FIRST..FIRST + self.around.columns.effects.len();
        all.filter(|&i| self.around.terms[i].log_weights.len() > 1 && (of.chosen[i] > 0) == inside).collect()
    }

    /// Whether a drive asks for more of an effect than any car has: its size is where it may be at most without it.
    fn is_at_its_most(&self, of: &Tried, term: usize) -> bool {
        let sizing = self.around.columns.effects[term - FIRST].sizing();
        let term = &self.around.terms[term];
        term.priors.iter().take(sizing).enumerate().any(|(k, p)| {
            let step = of.fitted.values[term.from + k] - self.around.values[term.from + k] - p.offset;
            step.abs() > 0.99 * USUAL * p.sigma[0]
        })
    }

    /// The free terms of a site that a configuration has.
    fn free_terms(&self, of: &Tried, site: Site) -> Vec<usize> {
        let columns = self.around.columns;
        let terms = columns.of_site(site).map(|c| columns.term_of_flexible(c));
        terms.filter(|&t| of.chosen[t] > 0).collect()
    }

    /// Takes in what is likely and out what is not, by turns until nothing changes.
    fn weeded(&self, start: Tried) -> Option<Weeded> {
        let (mut now, taken) = self.with_effects_for_free_terms(self.without_needless_free_terms(start));
        let mut turns = 0;
        loop {
            let fuller = self.with_likely_effects(now)?;
            let full = fuller.chosen.clone();
            // What stood in for the effects is no longer needed beside them, and what it kept out may be likely without it.
            let (left, simpler) = self.without_unlikely_effects(self.without_needless_free_terms(fuller));
            turns += 1;
            if left.chosen == full || turns == TURNS {
                return Some(Weeded { left, simpler, taken });
            }
            now = left;
        }
    }

    /// Takes out the free terms of one site after the other, the least needed first, as long as they close too little.
    fn without_needless_free_terms(&self, mut now: Tried) -> Tried {
        loop {
            let parts: Vec<Vec<usize>> = Site::ALL
                .into_iter()
                .map(|site| self.free_terms(&now, site))
                .filter(|terms| !terms.is_empty())
                .collect();
            let tried: Vec<Tried> =
                parts.into_par_iter().filter_map(|part| self.lacking(&now, &part)).collect();
            let least = tried.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
            match least.filter(|l| 1.0 - now.cost / l.cost < decisions::LEAST_CLOSED) {
                Some(least) => now = least,
                None => return now,
            }
        }
    }

    /// Puts an effect in the place of its site's free terms where it does as well, or leaves less of what they do than an effect does that is not the cause: they do,
    /// roughly, what any cause there does. The terms that still explain something are given, too.
    fn with_effects_for_free_terms(&self, mut now: Tried) -> (Tried, Vec<usize>) {
        let mut taken = Vec::new();
        for site in Site::ALL {
            let free = self.free_terms(&now, site);
            if free.is_empty() {
                continue;
            }
            let swapped = |i: usize| {
                let mut chosen = now.chosen.clone();
                free.iter().for_each(|&t| chosen[t] = 0);
                chosen[i] = 1;
                chosen
            };
            let is_here = |i: usize| self.around.columns.effects[i - FIRST].spec().sites.contains(&site);
            let mut promised = self.promised(&now, swapped);
            promised.retain(|&i| is_here(i));
            promised.truncate(FITTED);
            let tried = promised.into_par_iter().filter_map(|i| self.fitted(swapped(i), now.place()));
            let Some(best) = tried.min_by(|a, b| a.cost.total_cmp(&b.cost)) else { continue };
            let as_well = 1.0 - now.cost / best.cost < decisions::LEAST_CLOSED;
            let does_most = |neither: Tried| does_most_of(neither.cost, best.cost, now.cost);
            if as_well {
                now = best;
            } else if self.lacking(&now, &free).is_some_and(does_most) {
                now = best;
                taken.extend(free);
            }
        }
        (now, taken)
    }

    /// The free terms, of those that effects of a model may have taken the place of, that are needed beside it; and the model with them.
    fn with_what_is_left(&self, now: &Tried, free: &[usize]) -> (Vec<usize>, Tried) {
        let columns = self.around.columns;
        let (mut beside, mut whole) = (Vec::new(), now.clone());
        for site in Site::ALL {
            let here = |t: &usize| columns.of_site(site).any(|c| columns.term_of_flexible(c) == *t);
            let lacks: Vec<usize> =
                free.iter().copied().filter(|t| here(t) && whole.chosen[*t] == 0).collect();
            let is_here = |i: &usize| columns.effects[i - FIRST].spec().sites.contains(&site);
            if lacks.is_empty() || !self.effects(now, true).iter().any(is_here) {
                continue;
            }
            let mut chosen = whole.chosen.clone();
            lacks.iter().for_each(|&t| chosen[t] = 1);
            let tried = self.fitted(chosen, whole.place());
            if let Some(tried) = tried.filter(|t| 1.0 - t.cost / whole.cost >= decisions::LEAST_CLOSED) {
                beside.extend(lacks);
                whole = tried;
            }
        }
        (beside, whole)
    }

    /// The effects that a model lacks, those first of which the linearisation promises most in a configuration with it.
    fn promised(&self, now: &Tried, with: impl Fn(usize) -> Vec<usize> + Sync) -> Vec<usize> {
        let evidence = |chosen: &[usize]| {
            let around = self.around;
            configuration(&self.weighed.total, around.dispersion, around.terms, chosen)
                .map(|c| c.log_evidence)
        };
        let mut promised: Vec<(usize, f64)> =
            self.effects(now, false).into_par_iter().filter_map(|i| Some((i, evidence(&with(i))?))).collect();
        promised.sort_by(|a, b| b.1.total_cmp(&a.1));
        promised.into_iter().map(|p| p.0).collect()
    }

    /// Effects that a model lacks and may need: those that the linearisation promises most of beside what it has, and those of which it asks for more
    /// than any car has. How likely each is beside all others does not count: what stands in for an effect would keep it out.
    fn offered(&self, now: &Tried, with: impl Fn(usize) -> Vec<usize> + Sync) -> Vec<usize> {
        let promised = self.promised(now, with);
        let (promising, others) = promised.split_at(LOOKED_AT.min(promised.len()));
        let at_most = others.iter().filter(|&&i| self.is_at_its_most(now, i));
        promising.iter().chain(at_most).copied().collect()
    }

    /// Takes in the effects that all data make likelier than not, the likeliest first.
    fn with_likely_effects(&self, mut now: Tried) -> Option<Tried> {
        loop {
            let with = |i: usize| {
                let mut fuller = now.chosen.clone();
                fuller[i] = 1;
                fuller
            };
            let offered = self.offered(&now, with);
            let astray = now.cost / (1.0 - decisions::LEAST_CLOSED);
            let looks: Vec<(usize, Tried)> = offered
                .into_par_iter()
                .filter_map(|i| Some((i, self.look(with(i), &now, astray)?)))
                .collect();
            let costs: Vec<(usize, f64)> = looks.iter().map(|(i, look)| (*i, look.cost)).collect();
            let likely = |cost: f64| self.log_odds(now.cost, cost) > 0.0;
            // A look that went astray is no place to begin.
            let begin = |i: usize| {
                let look = looks.iter().find(|(effect, look)| *effect == i && look.cost < now.cost);
                look.map_or(&now, |(_, look)| look).place()
            };
            let by_fit = |i: usize| self.fitted(with(i), begin(i)).filter(|fuller| likely(fuller.cost));
            match to_be_fitted(&costs, now.cost, likely).into_iter().find_map(by_fit) {
                Some(fuller) => now = fuller,
                None => return Some(now),
            }
        }
    }

    /// Takes out the effects that all data make less likely than not, the unlikeliest first; what is left, and that without each effect.
    fn without_unlikely_effects(&self, mut now: Tried) -> (Tried, Vec<(usize, Tried)>) {
        loop {
            let (sure, doubtful): (Vec<usize>, Vec<usize>) =
                self.effects(&now, true).into_iter().partition(|i| now.sure.contains(i));
            let left = FITTED.saturating_sub(doubtful.len());
            let log_odds = |(i, lacking): &(usize, Tried)| self.log_odds_of(*i, lacking.cost, now.cost);
            let without_unlikeliest = |simpler: &[(usize, Tried)]| {
                let unlikely = simpler.iter().filter(|s| log_odds(s) < 0.0);
                let least = unlikely.min_by(|a, b| log_odds(a).total_cmp(&log_odds(b)));
                least.map(|(_, lacking)| lacking.clone())
            };
            let mut simpler = self.without_each(&now, doubtful, FITTED);
            let mut next = without_unlikeliest(&simpler);
            if next.is_none() {
                // What is left in the end is asked for once, however sure.
                simpler.extend(self.without_each(&now, sure, left));
                next = without_unlikeliest(&simpler);
            }
            match next {
                Some(lacking) => now = lacking,
                None => return (now, simpler),
            }
        }
    }

    /// A model without each of some effects; without those that seem needed least, so many of them, it is fitted to the end: a look from nearby may stop
    /// short of what the others can do.
    fn without_each(&self, now: &Tried, effects: Vec<usize>, fitted: usize) -> Vec<(usize, Tried)> {
        let lacking = |i: usize| Some((i, self.lacking(now, &[i])?));
        let mut simpler: Vec<(usize, Tried)> = effects.into_par_iter().filter_map(lacking).collect();
        let log_odds = |(i, lacking): &(usize, Tried)| self.log_odds_of(*i, lacking.cost, now.cost);
        simpler.sort_by(|a, b| log_odds(a).total_cmp(&log_odds(b)));
        simpler.par_iter_mut().take(fitted).for_each(|(_, lacking)| {
            let better =
                self.fitted(lacking.chosen.clone(), lacking.place()).filter(|b| b.cost < lacking.cost);
            if let Some(better) = better {
                *lacking = better;
            }
        });
        simpler
    }

    /// Puts in each effect's place what does nearly the same, and keeps what predicts best; each effect's rivals with their odds over its.
    fn with_the_likeliest_of_alike(
        &self,
        mut now: Tried,
        simpler: Vec<(usize, Tried)>,
    ) -> (Tried, Vec<Needed>) {
        let effect = |term: usize| self.around.columns.effects[term - FIRST];
        let mut out = Vec::with_capacity(simpler.len());
        for (term, lacking) in simpler {
            let alike = |&t: &usize| {
                effect(term).spec().alike.contains(&effect(t))
                    || effect(t).spec().alike.contains(&effect(term))
            };
            // Free terms of its site that complete the effect are in the way of what does the whole.
            let completing: Vec<usize> =
                effect(term).spec().sites.iter().flat_map(|s| self.free_terms(&now, *s)).collect();
            let swapped = |rival: usize| {
                let mut chosen = now.chosen.clone();
                chosen[term] = 0;
                chosen[rival] = 1;
                let mut alone = chosen.clone();
                completing.iter().for_each(|&t| alone[t] = 0);
                let tried = [chosen, alone].into_iter().filter_map(|c| self.fitted(c, now.place()));
                let tried = tried.filter(|t| t.cost.is_finite());
                Some((rival, tried.min_by(|a, b| a.cost.total_cmp(&b.cost))?))
            };
            let rivals: Vec<usize> = self.effects(&now, false).into_iter().filter(alike).collect();
            let mut tried: Vec<(usize, Tried)> = rivals.into_par_iter().filter_map(swapped).collect();
            tried.push((term, now));
            let costs = tried.iter().enumerate().map(|(i, (_, t))| (i, t.cost));
            let least = costs.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(i, _)| i);
            let (best, model) = tried.swap_remove(least);
            let odds = |(t, other): &(usize, Tried)| (*t, self.log_ratio(model.cost, other.cost).exp());
            let rivals = tried.iter().map(odds).collect();
            now = model;
            out.push(Needed { term: best, lacking, rivals });
        }
        (now, out)
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

/// Whether an effect does so much of what free terms do that it is the cause and not something like it: from the costs with neither, with the effect and with
/// the terms.
fn does_most_of(neither: f64, effect: f64, free: f64) -> bool {
    effect - free < decisions::RIVAL_LEAVES * (neither - free)
}

/// Which effects are asked for by a fit, in this order, from the costs that looks at them ended with, in the order of their promise, and the cost without any
/// of them: the likely ones, the best first, then those whose look went astray.
fn to_be_fitted(looks: &[(usize, f64)], without: f64, is_likely: impl Fn(f64) -> bool) -> Vec<usize> {
    let mut likely: Vec<(usize, f64)> = looks.iter().copied().filter(|(_, cost)| is_likely(*cost)).collect();
    likely.sort_by(|a, b| a.1.total_cmp(&b.1));
    // A model with one effect more does no worse: of a look that does, only a fit tells.
    let astray = looks.iter().copied().filter(|(_, cost)| 1.0 - without / cost >= decisions::LEAST_CLOSED);
    likely.into_iter().take(FITTED).chain(astray.take(FITTED)).map(|(effect, _)| effect).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_that_hardly_acts_is_not_needed_however_likely_it_looks() {
        assert_eq!(of_an_effect(EffectId::SteeringRateLimit, 0.004, 30.0), f64::NEG_INFINITY);
        assert_eq!(of_an_effect(EffectId::SteeringRateLimit, 0.05, 30.0), 30.0);
        // A small size may be known well.
        assert_eq!(of_an_effect(EffectId::GyroBias, 0.004, 30.0), 30.0);
    }

    #[test]
    fn an_effect_that_leaves_a_tenth_of_what_free_terms_explain_is_the_cause_and_one_that_leaves_a_fifth_is_not()
     {
        assert!(does_most_of(1000.0, 190.0, 100.0));
        assert!(!does_most_of(1000.0, 280.0, 100.0));
        // Nor one beside terms that explain nothing.
        assert!(!does_most_of(100.0, 100.0, 100.0));
    }

    #[test]
    fn likely_effects_are_fitted_the_best_first_then_those_whose_look_ends_above_the_model_without_them() {
        // Of effects 0 to 9: better, hardly different, far worse.
        let looks =
            [(0, 80.0), (1, 99.0), (2, 60.0), (3, 101.0), (4, 150.0), (5, 70.0), (6, 90.0), (7, 400.0)];
        let asked = to_be_fitted(&looks, 100.0, |cost| cost < 95.0);
        assert_eq!(
            asked,
            [2, 5, 0, 4, 7],
            "three of the likely ones, and all that went astray in the order of their promise"
        );
        assert!(to_be_fitted(&looks[1..2], 100.0, |cost| cost < 95.0).is_empty());
    }
}
