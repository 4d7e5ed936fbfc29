//! What is taken into a model and out of it, one part after the other, as data held out ask for it: foretold by a linearisation around what is there, and
//! decided by fits.

use gripsight_model::Site;

use crate::decisions;
use crate::infer::FIRST;
use crate::stated::{Asked, Needed, Tried};

/// Parts, those that are foretold to be needed most or least, that a fit is asked of.
const FITTED: usize = 3;

/// Times at most that effects are taken in and out, and that it is asked for again beside others.
pub(crate) const TURNS: usize = 4;

/// Log odds from which a forecast is not put to a fit before the last turn, in which all are: this spares work, and decides nothing.
const CLEAR: f64 = 100.0;

/// A configuration from which everything was taken that is not needed.
pub(crate) struct Weeded {
    pub(crate) left: Tried,
    /// The same without each effect.
    pub(crate) simpler: Vec<(usize, Tried)>,
    /// Free terms whose place an effect took, and that still explain something.
    pub(crate) taken: Vec<usize>,
}

impl Asked<'_, '_, '_, '_> {
    /// Takes in what is likely and out what is not, by turns until nothing changes.
    pub(crate) fn weeded(&self, start: Tried) -> Option<Weeded> {
        let (mut now, taken) = self.with_effects_for_free_terms(self.without_needless_free_terms(start));
        let mut turns = 0;
        loop {
            let fuller = self.with_likely_effects(now);
            let full = fuller.chosen.clone();
            // What stood in for the effects is no longer needed beside them, and what it kept out may be likely without it.
            let (left, _) = self.without_unlikely_effects(self.without_needless_free_terms(fuller), CLEAR);
            turns += 1;
            if left.chosen != full && turns < TURNS {
                now = left;
                continue;
            }
            let settled = left.chosen.clone();
            let (left, simpler) = self.without_unlikely_effects(left, f64::INFINITY);
            if left.chosen == settled || turns >= TURNS {
                return Some(Weeded { left, simpler, taken });
            }
            now = left;
        }
    }

    /// Some parts with the configurations that they lead to, those first that are foretold to leave least.
    fn ranked<T>(
        &self,
        now: &Tried,
        moves: impl Iterator<Item = (T, Vec<usize>)>,
    ) -> Vec<(T, Vec<usize>, f64)> {
        let (parts, others): (Vec<T>, Vec<Vec<usize>>) = moves.unzip();
        let left = self.foretold(now, &others).unwrap_or_default();
        let mut ranked: Vec<(T, Vec<usize>, f64)> =
            parts.into_iter().zip(others).zip(left).map(|((part, to), left)| (part, to, left)).collect();
        ranked.sort_by(|a, b| a.2.total_cmp(&b.2));
        ranked
    }

    /// Takes out the free terms of one site after the other, the least needed first, as long as they close too little.
    fn without_needless_free_terms(&self, mut now: Tried) -> Tried {
        loop {
            let parts = Site::ALL.into_iter().map(|site| self.free_terms(&now, site));
            let moves = parts.filter(|p| !p.is_empty()).map(|part| {
                let to = without(&now, &part);
                (part, to)
            });
            let least = self.ranked(&now, moves).into_iter().next();
            let least = least.and_then(|(_, to, _)| self.fitted(&to, &now));
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
            let is_here = |i: &usize| self.around.columns.effects[i - FIRST].spec().sites.contains(&site);
            let moves = self.effects(&now, false).into_iter().filter(is_here).map(|i| {
                let mut to = without(&now, &free);
                to[i] = 1;
                (i, to)
            });
            let promised = self.ranked(&now, moves).into_iter().take(FITTED);
            let tried = promised.filter_map(|(_, to, _)| self.fitted(&to, &now));
            let Some(best) = tried.min_by(|a, b| a.cost.total_cmp(&b.cost)) else { continue };
            let as_well = 1.0 - now.cost / best.cost < decisions::LEAST_CLOSED;
            let does_most = |neither: Tried| does_most_of(neither.cost, best.cost, now.cost);
            if as_well {
                now = best;
            } else if self.fitted(&without(&now, &free), &now).is_some_and(does_most) {
                now = best;
                taken.extend(free);
            }
        }
        (now, taken)
    }

    /// The free terms, of those that effects of a model may have taken the place of, that are needed beside it; and the model with them.
    pub(crate) fn with_what_is_left(&self, now: &Tried, free: &[usize]) -> (Vec<usize>, Tried) {
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
            let tried = self.fitted(&chosen, &whole);
            if let Some(tried) = tried.filter(|t| 1.0 - t.cost / whole.cost >= decisions::LEAST_CLOSED) {
                beside.extend(lacks);
                whole = tried;
            }
        }
        (beside, whole)
    }

    /// Takes in the effects that all data make likelier than not, the likeliest first. How likely each is beside all others does not count: what stands in for an
    /// effect would keep it out.
    fn with_likely_effects(&self, mut now: Tried) -> Tried {
        loop {
            let moves = self.effects(&now, false).into_iter().map(|i| {
                let mut to = now.chosen.clone();
                to[i] = 1;
                (i, to)
            });
            let is_likely = |i: usize, cost: f64| self.log_odds(i, now.cost, cost) > 0.0;
            let ranked = self.ranked(&now, moves);
            let likely = ranked.into_iter().filter(|(i, _, left)| is_likely(*i, *left)).take(FITTED);
            let by_fit = |(i, to, _): (usize, Vec<usize>, f64)| {
                self.fitted(&to, &now).filter(|fuller| is_likely(i, fuller.cost))
            };
            match likely.into_iter().find_map(by_fit) {
                Some(fuller) => now = fuller,
                None => return now,
            }
        }
    }

    /// Takes out the effects that all data make less likely than not, those first that are foretold to be needed least; what is left, and that without each
    /// effect. No fit is asked of one whose log odds are foretold to be `clear` or more.
    fn without_unlikely_effects(&self, mut now: Tried, clear: f64) -> (Tried, Vec<(usize, Tried)>) {
        loop {
            let moves = self.effects(&now, true).into_iter().map(|i| (i, without(&now, &[i])));
            let mut simpler = Vec::new();
            let mut unlikely = None;
            let ranked = self.ranked(&now, moves);
            for (i, to, _) in
                ranked.into_iter().filter(|(i, _, left)| self.log_odds(*i, *left, now.cost) < clear)
            {
                let Some(lacking) = self.fitted(&to, &now) else { continue };
                if self.log_odds(i, lacking.cost, now.cost) < 0.0 {
                    unlikely = Some(lacking);
                    break;
                }
                simpler.push((i, lacking));
            }
            match unlikely {
                Some(lacking) => now = lacking,
                None => return (now, simpler),
            }
        }
    }

    /// Puts in each effect's place what does nearly the same, and keeps what predicts best; each effect's rivals with their odds over its.
    pub(crate) fn with_the_likeliest_of_alike(
        &self,
        Weeded { left, simpler, .. }: &Weeded,
    ) -> (Tried, Vec<Needed>) {
        let effect = |term: usize| self.around.columns.effects[term - FIRST];
        let mut now = left.clone();
        let mut out = Vec::with_capacity(simpler.len());
        for (term, lacking) in simpler.iter().cloned() {
            let alike = |&t: &usize| {
                effect(term).spec().alike.contains(&effect(t))
                    || effect(t).spec().alike.contains(&effect(term))
            };
            // Free terms of its site that complete the effect are in the way of what does the whole.
            let completing: Vec<usize> =
                effect(term).spec().sites.iter().flat_map(|s| self.free_terms(&now, *s)).collect();
            let swapped = |rival: usize| {
                let mut chosen = without(&now, &[term]);
                chosen[rival] = 1;
                let mut alone = chosen.clone();
                completing.iter().for_each(|&t| alone[t] = 0);
                let tried = [chosen, alone].into_iter().filter_map(|c| self.fitted(&c, &now));
                let tried = tried.filter(|t| t.cost.is_finite());
                Some((rival, tried.min_by(|a, b| a.cost.total_cmp(&b.cost))?))
            };
            let rivals = self.effects(&now, false).into_iter().filter(alike);
            let mut tried: Vec<(usize, Tried)> = rivals.filter_map(swapped).collect();
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

/// A configuration without some of its terms.
fn without(of: &Tried, terms: &[usize]) -> Vec<usize> {
    let mut chosen = of.chosen.clone();
    terms.iter().for_each(|&t| chosen[t] = 0);
    chosen
}

/// Whether an effect does so much of what free terms do that it is the cause and not something like it: from the costs with neither, with the effect and with
/// the terms.
fn does_most_of(neither: f64, effect: f64, free: f64) -> bool {
    effect - free < decisions::RIVAL_LEAVES * (neither - free)
}

#[cfg(test)]
mod tests {
    use gripsight_estimation::split;
    use gripsight_model::EffectId;

    use super::*;
    use crate::budget::Scorer;
    use crate::testing::{configured, with_around};

    /// What a move makes of some effects, with all free terms of a site or without, in a drive with a lag: the effects that are there then, and whether
    /// free terms are.
    fn moved(
        effects: &[EffectId],
        free: Option<Site>,
        by: impl FnOnce(&Asked<'_, '_, '_, '_>, Tried) -> Tried,
    ) -> (Vec<EffectId>, bool) {
        with_around(0.06, |around, weighed| {
            let columns = around.columns;
            let scorer = Scorer::new(around.engine, None, &split(around.engine.recording, true));
            let asked = Asked::new(around, &columns.effects, &scorer);
            let mut chosen = configured(around, effects);
            for column in free.into_iter().flat_map(|site| columns.of_site(site)) {
                chosen[columns.term_of_flexible(column)] = 1;
            }
            let to = by(&asked, asked.fitted_from(&chosen, around, weighed).unwrap());
            let there = asked.effects(&to, true).into_iter().map(|i| columns.effects[i - FIRST]).collect();
            (there, Site::ALL.into_iter().any(|site| !asked.free_terms(&to, site).is_empty()))
        })
    }

    #[test]
    fn what_is_likely_is_taken_in_and_what_is_not_is_taken_out() {
        let lag = vec![EffectId::SteeringLag];
        assert_eq!(moved(&[], None, |asked, now| asked.with_likely_effects(now)), (lag.clone(), false));
        let both = [EffectId::SteeringLag, EffectId::VyBias];
        let without = |asked: &Asked<'_, '_, '_, '_>, now| {
            let (left, simpler) = asked.without_unlikely_effects(now, f64::INFINITY);
            let [(term, lacking)] = &simpler[..] else { panic!("{}", simpler.len()) };
            assert!(left.chosen[*term] == 1 && lacking.chosen[*term] == 0 && lacking.cost > left.cost);
            left
        };
        assert_eq!(moved(&both, None, without), (lag.clone(), false));
        // What is foretold to be needed beyond doubt is left to the last turn.
        let in_a_turn = |asked: &Asked<'_, '_, '_, '_>, now| {
            let (left, simpler) = asked.without_unlikely_effects(now, CLEAR);
            assert!(simpler.is_empty());
            left
        };
        assert_eq!(moved(&both, None, in_a_turn), (lag, false));
    }

    #[test]
    fn free_terms_go_where_they_close_too_little_and_make_room_for_the_effect_that_does_as_well() {
        let lag = vec![EffectId::SteeringLag];
        let needless = moved(&lag, Some(Site::Vy), |asked, now| asked.without_needless_free_terms(now));
        assert_eq!(needless, (lag.clone(), false));
        let stood_in = moved(&[], Some(Site::Steering), |asked, now| asked.without_needless_free_terms(now));
        assert_eq!(stood_in, (Vec::new(), true));
        let named = moved(&[], Some(Site::Steering), |asked, now| asked.with_effects_for_free_terms(now).0);
        assert_eq!(named, (lag, false));
    }

    #[test]
    fn of_effects_that_are_alike_the_one_that_predicts_best_stays() {
        let relaxation = [EffectId::TireRelaxation];
        let (there, _) = moved(&relaxation, None, |asked, now| {
            let (left, simpler) = asked.without_unlikely_effects(now, f64::INFINITY);
            let weeded = Weeded { left, simpler, taken: Vec::new() };
            let (now, needed) = asked.with_the_likeliest_of_alike(&weeded);
            let [Needed { term, rivals, .. }] = &needed[..] else { panic!("{}", needed.len()) };
            assert_eq!(now.chosen[*term], 1);
            assert!(rivals.iter().all(|(_, odds)| *odds < 1.0), "{rivals:?}");
            now
        });
        assert_eq!(there, [EffectId::SteeringLag]);
    }

    #[test]
    fn an_effect_that_leaves_a_tenth_of_what_free_terms_explain_is_the_cause_and_one_that_leaves_a_fifth_is_not()
     {
        assert!(does_most_of(1000.0, 190.0, 100.0));
        assert!(!does_most_of(1000.0, 280.0, 100.0));
        // Nor one beside terms that explain nothing.
        assert!(!does_most_of(100.0, 100.0, 100.0));
    }
}
