//! What the inference comes to, and what may be asked of it.

use std::ops::Range;

use gripsight_estimation::selection::{Selection, Term};
use gripsight_model::{EffectId, Site, TIRES};
use gripsight_vehicle::{OWN_TIRE_PARAMETERS, OwnTires};

use crate::ExtendedModelFile;
use crate::columns::Columns;
use crate::decisions;
use crate::infer::FIRST;
use crate::joint::Weighed;
use crate::sizes::{Sized, Sizes};
use crate::statement::Statement;

/// What the inference comes to.
#[derive(Debug, Clone)]
pub(crate) struct Inferred {
    pub(crate) columns: Columns,
    /// The tires that the priors are around.
    pub(crate) tires: OwnTires,
    /// Where everything was linearised last.
    pub(crate) values: Vec<f64>,
    pub(crate) selection: Selection,
    /// The configuration that is left in the end.
    pub(crate) chosen: Vec<usize>,
    /// Free terms that it needs beside effects which do most of what they do: what is left is stated, and the effects are sized without them.
    pub(crate) beside: Vec<usize>,
    /// Its effects; `None` where held-out data were not asked.
    pub(crate) stated: Option<Vec<Statement>>,
    /// Probability that each term matters, confirmed by rollouts.
    pub(crate) confirmed: Vec<f64>,
    /// The most probable model's parameters.
    pub(crate) sizes: Sizes,
    pub(crate) terms: Vec<Term>,
    pub(crate) weighed: Weighed,
    /// How many times the errors' information is smaller than if they were independent.
    pub(crate) dispersion: f64,
    /// Noise of each channel.
    pub(crate) sigma: Vec<f64>,
    pub(crate) rounds: usize,
}

impl Inferred {
    /// Place of an effect among the terms.
    pub(crate) fn term_of(&self, effect: EffectId) -> Option<usize> {
        self.columns.effects.iter().position(|e| *e == effect).map(|i| FIRST + i)
    }

    /// Places of a site's flexible terms among the terms.
    pub(crate) fn terms_of_site(&self, site: Site) -> Range<usize> {
        let range = self.columns.of_site(site);
        self.columns.term_of_flexible(range.start)..self.columns.term_of_flexible(range.end)
    }

    /// Probability that something is the matter at a site that no effect of the library does.
    pub(crate) fn other(&self, site: Site) -> f64 {
        let terms = self.terms_of_site(site);
        let by_fit = self.selection.probability_that(|c| c[terms.clone()].iter().any(|&a| a > 0));
        let needed = terms.clone().any(|t| self.chosen[t] > 0 || self.beside.contains(&t));
        if needed { by_fit } else { by_fit.min(decisions::NEEDLESS) }
    }

    /// Whether the data were asked for an effect.
    pub(crate) fn is_open(&self, effect: EffectId) -> bool {
        self.term_of(effect).is_some_and(|t| self.terms[t].log_weights.len() > 1)
    }

    /// Probability that an effect matters: the chance that it is a cause where it is left in the model or does as well in another's place, that of the
    /// fit where held-out data were not asked.
    pub(crate) fn probability(&self, effect: EffectId) -> f64 {
        let in_place = self.statement(effect).map(|s| s.chance() * self.ground(effect, s));
        let in_place = in_place.unwrap_or_else(|| self.probability_instead(effect));
        in_place.max(self.probability_beside(effect))
    }

    /// Probability that an effect, or what does nearly the same, matters; what does nearly the same as an effect of the model counts there.
    pub(crate) fn probability_of_alike(&self, effect: EffectId) -> f64 {
        self.statement(effect).map_or_else(|| self.probability_beside(effect), Statement::chance_of_alike)
    }

    /// Chance that an effect is a cause in the place of one that is left in the model.
    pub(crate) fn probability_instead(&self, effect: EffectId) -> f64 {
        let Some(term) = self.term_of(effect) else { return 0.0 };
        self.stated.iter().flatten().map(|s| s.chance_instead(term)).fold(0.0, f64::max)
    }

    /// Probability that an effect which is not in the model matters beside it.
    fn probability_beside(&self, effect: EffectId) -> f64 {
        if self.statement(effect).is_some() {
            return 0.0;
        }
        let by_fit = self.term_of(effect).filter(|_| self.is_open(effect)).map_or(0.0, |t| self.confirmed[t]);
        if self.stated.is_some() { by_fit.min(decisions::NEEDLESS) } else { by_fit }
    }

    /// What is stated of an effect, if it is in the model.
    pub(crate) fn statement(&self, effect: EffectId) -> Option<&Statement> {
        let term = self.term_of(effect).filter(|_| self.is_open(effect))?;
        self.stated.as_ref()?.iter().find(|s| s.term == term)
    }

    /// Chance that larger effects at an effect's sites are what they are taken for: beside a stand-in for what nobody asked for, a smaller one may be
    /// the rest of that.
    fn ground(&self, effect: EffectId, statement: &Statement) -> f64 {
        let beside = |other: &EffectId| {
            let sites = effect.spec().sites;
            *other != effect && other.spec().sites.iter().any(|site| sites.contains(site))
        };
        let effects = self.columns.effects.iter().filter(|e| beside(e));
        let larger = effects.filter_map(|e| self.statement(*e)).filter(|s| s.closes > statement.closes);
        larger.map(Statement::asked).product()
    }

    /// Takes note that held-out data speak against an effect.
    pub(crate) fn refute(&mut self, effect: EffectId) {
        let term = self.term_of(effect);
        let stated = self.stated.iter_mut().flatten().filter(|s| Some(s.term) == term);
        stated.for_each(|s| s.refuted = true);
    }

    /// Whether the verdict names an effect: it, or another candidate that does nearly the same, is likely a cause, and not small beside what of the
    /// unexplained looks like it.
    pub(crate) fn is_accepted(&self, effect: EffectId) -> bool {
        let holds = |s: &Statement| {
            s.chance_of_candidates() * self.ground(effect, s) >= decisions::NAMED
                && s.over_unexplained >= decisions::LEAST_OVER_UNEXPLAINED
        };
        self.statement(effect).is_some_and(holds)
    }

    /// Whether an effect is not named and stays in the model beside what is: it, or what does nearly the same and is not among the candidates, is likely a
    /// cause, and the others would make up for it.
    pub(crate) fn stands_in(&self, effect: EffectId) -> bool {
        let holds = |s: &Statement| {
            s.chance_of_alike() >= decisions::NAMED && s.over_unexplained >= decisions::LEAST_OVER_UNEXPLAINED
        };
        !self.is_accepted(effect) && self.statement(effect).is_some_and(holds)
    }

    /// The terms with each effect that does not matter, but for what every car has, and each flexible term that is not needed gone for good: the narrow
    /// prior alone lets large evidence keep them, and what they keep would be missing in what a site closes.
    pub(crate) fn absent_terms(&self) -> Vec<Term> {
        const GONE: f64 = 0.01;
        let mut out = self.terms.clone();
        let (effects, flexible) = out[FIRST..].split_at_mut(self.columns.effects.len());
        for (effect, term) in self.columns.effects.iter().zip(effects) {
            if effect.spec().usual.is_none() {
                term.priors.iter_mut().take(effect.sizing()).for_each(|p| p.sigma[0] *= GONE);
            }
        }
        flexible.iter_mut().flat_map(|term| &mut term.priors).for_each(|p| p.sigma[0] *= GONE);
        out
    }

    /// The effects that are left in the model in the end, and tires and what is usual fitted beside them; without flexible terms.
    pub(crate) fn model(&self) -> ExtendedModelFile {
        let values = &self.sizes.values;
        let mut tires = [0.0; OWN_TIRE_PARAMETERS];
        tires.copy_from_slice(&values[..TIRES]);
        let mut file = ExtendedModelFile::of_tires(OwnTires::from_parameters(&tires));
        for &effect in &self.columns.effects {
            let (Some(term), Some(range)) = (self.term_of(effect), self.columns.of_effect(effect)) else {
                continue;
            };
            let chosen = self.chosen[term] > 0;
            if chosen || effect.spec().usual.is_some() {
                file.insert(effect, &values[range], !chosen);
            }
        }
        file
    }

    /// Parameters of an effect where it matters, and their standard deviations: those of the most probable model, if it has the effect, else of
    /// the models that have it.
    pub(crate) fn size(&self, effect: EffectId) -> Sized {
        let Some(t) = self.term_of(effect) else { return (Vec::new(), Vec::new()) };
        if let Some(sized) = self.sizes.effect(&self.columns, effect) {
            return sized;
        }
        let wide = self.selection.mean[t].len() - 1;
        let from = self.terms[t].from;
        let mean = self.selection.mean[t][wide].iter().enumerate();
        (mean.map(|(i, step)| self.values[from + i] + step).collect(), self.selection.sigma[t][wide].clone())
    }
}
