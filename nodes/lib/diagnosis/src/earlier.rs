//! A drive from before: what a later one of the same car is compared with.

use gripsight_estimation::Windows;
use gripsight_model::{EffectId, Recording};

use crate::answer::Change;
use crate::budget::Budget;
use crate::changes::{Compared, compare};
use crate::decisions;
use crate::diagnose::{SEARCH_WINDOWS, explain};
use crate::engine::Engine;
use crate::infer::linearised;
use crate::inferred::Inferred;
use crate::outcome::{Diagnosis, RankedEffect};
use crate::sizes::{Sized, reported};
use crate::trust::TireTrust;
use crate::usable::usable;
use crate::{GapError, Request, Verdict};
use gripsight_signals::DataHealth;
use gripsight_vehicle::VehicleParameters;

/// How often another drive is linearised anew to be compared.
const COMPARISONS: usize = 2;

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
        training: &Windows,
    ) -> Result<(Inferred, Differences), GapError> {
        let windows = training.thinned(SEARCH_WINDOWS);
        let like = &self.inferred;
        let mut alike = Engine::new(recording, vehicle, like.tires, TireTrust::file());
        let (mut values, mut chosen) = (like.values.clone(), like.chosen.clone());
        let mut best: Option<(Inferred, Differences)> = None;
        // First where the earlier drive was linearised: fits may end apart although nothing has changed. Where something has, around the
        // later drive's own fits: from the earlier model on, then from what that comparison makes of it. Where the drives contradict each other
        // the least they are compared at their best.
        for comparison in 0..=COMPARISONS {
            let at = (&values[..], &chosen[..]);
            let later =
                linearised(&mut alike, like, at, comparison > 0, &windows).ok_or(GapError::NotFinite)?;
            let differences = self.compared(&alike, &later).ok_or(GapError::NotFinite)?;
            let same = differences.verdict() == Verdict::NoGap;
            if comparison > 0 {
                (values, chosen) = differences.later(&alike, self);
            }
            let left = differences.compared.dispersion;
            if best.as_ref().is_none_or(|(_, b)| left <= b.compared.dispersion) {
                best = Some((later, differences));
            }
            if same && comparison > 0 {
                break;
            }
        }
        best.ok_or(GapError::NotFinite)
    }

    /// What differs in a later drive that was linearised in the same columns.
    fn compared(&self, later: &Engine<'_>, inferred: &Inferred) -> Option<Differences> {
        let engine = Engine::new(&self.recording, later.vehicle, self.inferred.tires, TireTrust::drive());
        let compared = compare(&engine, &self.inferred, inferred)?;
        let changes = compared.changes(&self.inferred);
        let mut accepted: Vec<EffectId> = changes
            .iter()
            .filter(|c| {
                c.probability >= decisions::LIKELY && !(c.difference.low <= 0.0 && c.difference.high >= 0.0)
            })
            .filter_map(|c| EffectId::by_name(c.name))
            .collect();
        accepted.dedup();
        Some(Differences { compared, changes, accepted })
    }
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

    /// The later drive's most probable model: its values, and the terms that it has.
    pub(crate) fn later(&self, engine: &Engine<'_>, earlier: &Earlier) -> (Vec<f64>, Vec<usize>) {
        self.compared.later(engine, &earlier.inferred)
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
        let of = |effect: EffectId, closed| RankedEffect {
            name: effect.name(),
            accepted: self.accepted.contains(&effect),
            parameters: reported(engine, effect, &self.size(earlier, effect)),
            gap_closed_fraction: closed,
            needed_fraction: f64::NAN,
            held_out_log_ratio: f64::NAN,
            over_unexplained: f64::NAN,
            size_over_half_width: f64::NAN,
            confidence: self.compared.of_effect(&earlier.inferred, effect),
            confused_with: Vec::new(),
        };
        let mut out: Vec<RankedEffect> =
            (self.accepted.iter().enumerate()).map(|(i, e)| of(*e, budget.closed_by_step(i + 1))).collect();
        out.extend(self.candidates().into_iter().map(|e| of(e, budget.closed_by_candidate(e))));
        out
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
