//! A drive from before: what a later one of the same car is compared with.

use gripsight_estimation::Split;
use gripsight_estimation::selection::Term;
use gripsight_model::{EffectId, Flexible, Recording, Site};
use gripsight_signals::DataHealth;
use gripsight_vehicle::VehicleParameters;

use crate::answer::Change;
use crate::budget::{Budget, Scorer, large_slip_rad};
use crate::changes::{Compared, compare};
use crate::decisions;
use crate::diagnose::{SEARCH_WINDOWS, explain, fitted_null};
use crate::engine::Engine;
use crate::infer::{infer, linearised};
use crate::inferred::Inferred;
use crate::outcome::{Diagnosis, RankedEffect};
use crate::sizes::{Sized, reported};
use crate::trust::TireTrust;
use crate::usable::usable;
use crate::{GapError, Request, Verdict};

/// A drive from before with its own diagnosis. A later drive is compared with all that was found in it: tires, effects, and what they left.
#[derive(Debug, Clone)]
pub struct Earlier {
    /// What it was explained with.
    pub diagnosis: Diagnosis,
    pub(crate) inferred: Inferred,
    recording: Recording,
}

impl Earlier {
    /// Diagnoses the drive from before; `request` as of a drive of its own. `progress` as of [`diagnose`](crate::diagnose).
    ///
    /// # Errors
    /// Those of [`diagnose`](crate::diagnose), and [`GapError::Earlier`] where its data cannot tell.
    pub fn diagnosed(request: &Request<'_>, progress: &mut dyn FnMut(&str)) -> Result<Self, GapError> {
        let data_health = DataHealth::of(request.sequence)?;
        let usable = usable(request, &data_health).map_err(|e| GapError::Earlier(e.to_string()))?;
        let recording = usable.recording.clone();
        let (diagnosis, inferred) = explain(request, usable, data_health, progress)?;
        if diagnosis.verdict == Verdict::NotIdentifiable {
            return Err(GapError::Earlier(diagnosis.reasons.join("; ")));
        }
        Ok(Self { diagnosis, inferred, recording })
    }

    /// What it was explained with, in words.
    pub(crate) fn text(&self) -> String {
        let named: Vec<&str> = self.diagnosis.effects.iter().filter(|e| e.accepted).map(|e| e.name).collect();
        let of = if named.is_empty() { "tires alone".to_owned() } else { named.join(", ") };
        format!(
            "the drive before is explained by {of}; what either drive leaves is in both, and only differences count"
        )
    }

    /// Whether another recording holds the same signals.
    pub(crate) fn matches(&self, later: &Recording) -> bool {
        self.recording.channels == later.channels && self.recording.has_command == later.has_command
    }

    /// Compares another drive of the car with it: both in the same columns, around the same tires, with nothing held. Gives the other drive, linearised
    /// there, and what differs.
    pub(crate) fn with_later(
        &self,
        recording: &Recording,
        vehicle: &VehicleParameters,
        windows: &Split,
        progress: &mut dyn FnMut(&str),
    ) -> Result<(Inferred, Differences), GapError> {
        let own = self.explained(recording, vehicle, windows, progress);
        let windows = windows.training.thinned(SEARCH_WINDOWS);
        let like = &self.inferred;
        let mut engine = Engine::new(recording, vehicle, like.tires, TireTrust::file());
        let mut at = |place: (&[f64], &[usize]), fitted: bool| {
            let later = linearised(&mut engine, like, place, fitted, &windows)?;
            let differences = self.compared(&engine, &later)?;
            Some((later, differences))
        };
        // Where the earlier drive was linearised, and where its model is fitted to the later one: fits may end apart although nothing has changed. Where the
        // drives contradict each other the least they are compared at their best. A place that the model runs away from tells nothing.
        let earlier = (&like.values[..], &like.chosen[..]);
        let [here, refitted] = [at(earlier, false), at(earlier, true)];
        let contradiction = |place: &(Inferred, Differences)| place.1.compared.dispersion;
        let alike = [here, refitted]
            .into_iter()
            .flatten()
            .min_by(|a, b| contradiction(a).total_cmp(&contradiction(b)));
        // But where the later drive needs terms that the earlier one's model lacks it is far from anything that tells what has changed, and is linearised around
        // a model of its own: where that is likelier, by what either place leaves of the later drive and what the drives contradict each other by.
        let own = own.map(|own| like.model_of(&own)).and_then(|(values, chosen)| {
            let own = at((&values, &chosen), true)?;
            let likelier = alike.as_ref().is_none_or(|alike| {
                let gained = (alike.0.weighed.cost - own.0.weighed.cost) / own.0.dispersion;
                let contradicts = (contradiction(&own) / contradiction(alike)).ln() * values.len() as f64;
                gained > contradiction(alike) * (price(&own.0.terms, &like.chosen, &chosen) + contradicts)
            });
            likelier.then_some(own)
        });
        own.or(alike).ok_or(GapError::NotFinite)
    }

    /// What the inference makes of another drive by itself, from this one's model on.
    fn explained(
        &self,
        recording: &Recording,
        vehicle: &VehicleParameters,
        windows: &Split,
        progress: &mut dyn FnMut(&str),
    ) -> Option<Inferred> {
        let model = &self.diagnosis.extended_model;
        let mut engine = Engine::new(recording, vehicle, model.tires, TireTrust::drive());
        (engine.held, engine.usual) = model.parameters().ok()?;
        let search = windows.training.thinned(SEARCH_WINDOWS);
        let null = fitted_null(&engine, &search).ok()?;
        let slip_rad = large_slip_rad(&engine, &search);
        let flexible = Flexible::new(recording, slip_rad, vehicle.wheelbase_m(), &Site::ALL);
        let scorer = Scorer::new(&engine.clone(), None, windows);
        let effects = self.inferred.columns.effects.iter().copied();
        let library: Vec<EffectId> = effects.filter(|e| self.inferred.is_open(*e)).collect();
        infer(&mut engine, &null, &library, flexible, &search, &scorer, progress)
    }

    /// What differs in a later drive that was linearised in the same columns.
    fn compared(&self, later: &Engine<'_>, inferred: &Inferred) -> Option<Differences> {
        let engine = Engine::new(&self.recording, later.vehicle, self.inferred.tires, TireTrust::drive());
        let compared = compare(&engine, &self.inferred, inferred)?;
        let changes = compared.changes(&self.inferred);
        let stands_out =
            |e: &EffectId| compared.standing_out(&self.inferred, *e).is_some_and(|(_, told)| told > 1.0);
        let mut accepted: Vec<EffectId> = changes
            .iter()
            .filter(|c| c.probability >= decisions::LIKELY)
            .filter_map(|c| EffectId::by_name(c.name))
            .filter(stands_out)
            .collect();
        accepted.dedup();
        Some(Differences { compared, changes, accepted })
    }
}

/// The drop of a cost by which terms that only one of two models has are worth it (twice the log odds against them).
fn price(terms: &[Term], without: &[usize], with: &[usize]) -> f64 {
    let odds = |t: &Term| t.log_weights.first().zip(t.log_weights.last()).map_or(0.0, |(no, yes)| no - yes);
    let added = terms
        .iter()
        .zip(without.iter().zip(with))
        .filter(|(_, (without, with))| **without == 0 && **with > 0);
    added.map(|(t, _)| 2.0 * odds(t)).sum()
}

/// What differs between two drives.
#[derive(Debug, Clone)]
pub(crate) struct Differences {
    compared: Compared,
    pub(crate) changes: Vec<Change>,
    /// The effects that have changed, the likeliest first: likelier than not, and by an amount whose interval holds no zero.
    pub(crate) accepted: Vec<EffectId>,
}

impl Differences {
    /// The changes that are likelier than not.
    pub(crate) fn likely(self) -> Vec<Change> {
        let effect = |c: &Change| EffectId::by_name(c.name).is_none_or(|e| self.accepted.contains(&e));
        self.changes.iter().filter(|c| c.probability >= decisions::LIKELY && effect(c)).cloned().collect()
    }

    /// Takes note that held-out data speak against a change.
    pub(crate) fn refute(&mut self, effect: EffectId) {
        self.accepted.retain(|e| *e != effect);
    }

    /// An effect's parameters in the later drive, with standard deviations of what the earlier drive has and of the differences together.
    pub(crate) fn size(&self, earlier: &Earlier, effect: EffectId) -> Sized {
        let before = self.compared.earlier(&earlier.inferred, effect).unwrap_or_default();
        let (by, mut sigma) = self.compared.difference(&earlier.inferred, effect).unwrap_or_default();
        let own = earlier.inferred.sizes.effect(&earlier.inferred.columns, effect);
        let own = own.map_or_else(Vec::new, |(_, sigma)| sigma);
        sigma.iter_mut().zip(own).for_each(|(s, own)| *s = s.hypot(own));
        (before.iter().zip(&by).map(|(b, d)| b + d).collect(), sigma)
    }

    /// The effects that have changed, then those that may have.
    pub(crate) fn ranked(
        &self,
        earlier: &Earlier,
        engine: &Engine<'_>,
        budget: &Budget,
    ) -> Vec<RankedEffect> {
        let of = |effect: EffectId| RankedEffect {
            name: effect.name(),
            accepted: self.accepted.contains(&effect),
            parameters: reported(engine, effect, &self.size(earlier, effect)),
            gap_closed_fraction: budget.closed_by(effect),
            needed_fraction: f64::NAN,
            held_out_log_ratio: f64::NAN,
            over_unexplained: f64::NAN,
            size_over_half_width: f64::NAN,
            confidence: self.compared.of_effect(&earlier.inferred, effect),
            confused_with: Vec::new(),
        };
        self.accepted.iter().copied().chain(self.candidates()).map(of).collect()
    }

    /// The other effects that are worth a word, the likeliest first.
    pub(crate) fn candidates(&self) -> Vec<EffectId> {
        let all = self.changes.iter().filter_map(|c| EffectId::by_name(c.name));
        all.filter(|e| !self.accepted.contains(e)).collect()
    }

    /// The verdict: effects where some have changed, other tires, something that the library lacks, or nothing.
    pub(crate) fn verdict(&self) -> Verdict {
        let likely =
            |name: &str| self.changes.iter().any(|c| c.name == name && c.probability >= decisions::LIKELY);
        if !self.accepted.is_empty() {
            Verdict::Effects
        } else if likely("other") {
            Verdict::NoneOfThese
        } else if likely("tires") {
            Verdict::TireRetuneOnly
        } else {
            Verdict::NoGap
        }
    }
}

#[cfg(test)]
mod tests {
    use gripsight_estimation::selection::ColumnPrior;

    use super::*;

    #[test]
    fn a_term_costs_its_odds_and_what_both_models_have_nothing() {
        let prior = || ColumnPrior { offset: 0.0, sigma: vec![0.1, 1.0], bounds: [-9.0, 9.0] };
        let offered =
            |from| Term { from, priors: vec![prior()], log_weights: vec![0.9_f64.ln(), 0.1_f64.ln()] };
        let terms = [Term { from: 0, priors: vec![prior()], log_weights: vec![0.0] }, offered(1), offered(2)];
        approx::assert_relative_eq!(price(&terms, &[0, 0, 1], &[1, 1, 1]), 2.0 * 9.0_f64.ln());
        approx::assert_relative_eq!(price(&terms, &[0, 1, 1], &[0, 0, 1]), 0.0);
    }
}
