//! A drive from before: what a later one of the same car is compared with.

use gripsight_estimation::Split;
use gripsight_estimation::selection::Term;
use gripsight_model::{Channel, EffectId, Recording, TIRES};
use gripsight_signals::DataHealth;
use gripsight_vehicle::VehicleParameters;

use crate::answer::Change;
use crate::budget::Budget;
use crate::changes::{Compared, SETTLED, compare};
use crate::decisions;
use crate::diagnose::{SEARCH_WINDOWS, explain};
use crate::engine::Engine;
use crate::frame::Frame;
use crate::infer::linearised;
use crate::inferred::Inferred;
use crate::outcome::{Diagnosis, RankedEffect};
use crate::paired::Paired;
use crate::sizes::{Sized, reported};
use crate::tire_change::reached_slip_rad;
use crate::trust::TireTrust;
use crate::usable::{Usable, usable};
use crate::{ExtendedModelFile, GapError, Request, Verdict};

/// Times at most that a later drive is linearised anew, around what has changed.
const AROUND_CHANGES: usize = 3;

/// A drive from before with its own diagnosis. A later drive is compared with all that was found in it: tires, effects, and what they left.
#[derive(Debug, Clone)]
pub struct Earlier {
    /// What it was explained with.
    pub diagnosis: Diagnosis,
    pub(crate) inferred: Inferred,
    usable: Usable,
    /// Effects that nobody asks for.
    left_out: Vec<EffectId>,
    /// All that the inference left in its model, stated as a cause or not: what it is not sure of is as much in a later drive.
    pub(crate) model: ExtendedModelFile,
}

impl Earlier {
    /// Diagnoses the drive from before; `request` as of a drive of its own. `progress` as of [`diagnose`](crate::diagnose).
    ///
    /// # Errors
    /// Those of [`diagnose`](crate::diagnose), and [`GapError::Earlier`] where its data cannot tell.
    pub fn diagnosed(request: &Request<'_>, progress: &mut dyn FnMut(&str)) -> Result<Self, GapError> {
        let data_health = DataHealth::of(request.sequence)?;
        let usable = usable(request, &data_health).map_err(|e| GapError::Earlier(e.to_string()))?;
        let (diagnosis, inferred) = explain(request, usable.clone(), data_health, progress)?;
        if diagnosis.verdict == Verdict::NotIdentifiable {
            return Err(GapError::Earlier(diagnosis.reasons.join("; ")));
        }
        let model = inferred.model();
        let left_out = EffectId::candidates().filter(|e| !request.considers(*e)).collect();
        Ok(Self { diagnosis, inferred, usable, left_out, model })
    }

    /// What it was explained with, in words.
    pub(crate) fn text(&self) -> String {
        let named: Vec<&str> = self.diagnosis.effects.iter().filter(|e| e.accepted).map(|e| e.name).collect();
        let of = if named.is_empty() { "tires alone".to_owned() } else { named.join(", ") };
        format!(
            "the drive before is explained by {of}; a change is asked for beside all that its model has, named or not, and only differences count"
        )
    }

    /// The channels by which both drives tell something: what one of them lacks is no change of the car.
    pub(crate) fn common(&self, later: &Recording) -> Result<Vec<Channel>, GapError> {
        let own = &self.usable.recording;
        if own.has_command != later.has_command {
            let which = if own.has_command { "earlier" } else { "later" };
            return Err(GapError::Earlier(format!("only the {which} drive records a longitudinal command")));
        }
        Ok(own.channels.iter().copied().filter(|c| later.channels.contains(c)).collect())
    }

    /// Compares another drive of the car with it, which has the channels that both tell something by: both in the same columns, around the same tires, with nothing held, and linearised in the same way, so that a
    /// drive differs from itself by nothing. Gives the other drive, linearised there, and what differs.
    pub(crate) fn with_later(
        &self,
        recording: &Recording,
        vehicle: &VehicleParameters,
        windows: &Split,
        progress: &mut dyn FnMut(&str),
    ) -> Result<(Inferred, Differences), GapError> {
        progress("comparing the drives");
        let own = &self.usable.recording;
        let frame =
            Frame::of(&self.inferred, (&own.channels, &recording.channels), |e| !self.left_out.contains(&e));
        let own = own.with_channels(&recording.channels);
        let engine = |of| Engine::new(of, vehicle, self.inferred.tires, TireTrust::file());
        let (mut before, mut after) = (engine(&own), engine(recording));
        let [here, there] = [&self.usable.windows, windows].map(|w| w.training.thinned(SEARCH_WINDOWS));
        let [front, rear] = reached_slip_rad(&before, &here);
        let [later_front, later_rear] = reached_slip_rad(&after, &there);
        let slip_rad = [front.min(later_front), rear.min(later_rear)];
        if let Some(paired) = Paired::of(&frame, (&before, &here), (&after, &there)) {
            progress("the drives are of one motion: comparing them sample by sample");
            let model = (&frame.values[..], &frame.chosen[..]);
            let earlier = linearised(&mut before, &frame, model, false, &here).ok_or(GapError::NotFinite)?;
            let earlier = Inferred { chosen: frame.chosen.clone(), sizes: frame.sizes.clone(), ..earlier };
            let compared = paired.compared(&before, &earlier, slip_rad).ok_or(GapError::NotFinite)?;
            let (values, chosen) = compared.changed_model(&earlier);
            let later = linearised(&mut after, &frame, (&values, &chosen), true, &there);
            let later = later.ok_or(GapError::NotFinite)?;
            let differences = Differences::of(earlier, &later, compared);
            return Ok((later, Differences { of_one_motion: true, ..differences }));
        }
        // Where the earlier drive was linearised, and where its model is fitted to either drive: fits may end apart although nothing has changed. Where the
        // drives contradict each other the least they are compared at their best. A place that the model runs away from tells nothing.
        let mut at = |fitted: bool| {
            let model = (&frame.values[..], &frame.chosen[..]);
            let earlier = linearised(&mut before, &frame, model, fitted, &here)?;
            let earlier = Inferred { chosen: frame.chosen.clone(), sizes: frame.sizes.clone(), ..earlier };
            let later = linearised(&mut after, &frame, model, fitted, &there)?;
            Pair::of(&before, earlier, later, frame.chosen.clone(), slip_rad)
        };
        let alike = [at(false), at(true)].into_iter().flatten();
        let least = alike.min_by(|a, b| a.compared.dispersion.total_cmp(&b.compared.dispersion));
        let mut best = least.ok_or(GapError::NotFinite)?;
        // A later drive that needs terms which the earlier one's model lacks is far from anything that tells how large they are: it is linearised anew, around
        // that model with what has changed, as long as this is likelier.
        for _ in 0..AROUND_CHANGES {
            let Some((values, chosen)) = best.later_model() else { break };
            let anew = linearised(&mut after, &frame, (&values, &chosen), true, &there);
            let anew =
                anew.and_then(|later| Pair::of(&before, best.earlier.clone(), later, chosen, slip_rad));
            match anew.filter(|anew| anew.is_likelier(&best)) {
                Some(anew) => best = anew,
                None => break,
            }
        }
        let Pair { earlier, later, compared, .. } = best;
        let differences = Differences::of(earlier, &later, compared);
        Ok((later, differences))
    }
}

/// Two drives in the same columns, and what differs.
struct Pair {
    earlier: Inferred,
    later: Inferred,
    /// The terms of the model that the later one was linearised around.
    around: Vec<usize>,
    compared: Compared,
}

impl Pair {
    fn of(
        engine: &Engine<'_>,
        earlier: Inferred,
        later: Inferred,
        around: Vec<usize>,
        slip_rad: [f64; 2],
    ) -> Option<Self> {
        let compared = compare(engine, &earlier, &later, slip_rad)?;
        Some(Self { earlier, later, around, compared })
    }

    /// The later drive's model with all that differs, where it was linearised around one that lacks something of it.
    fn later_model(&self) -> Option<(Vec<f64>, Vec<usize>)> {
        let changed = self.compared.changed();
        let (mut chosen, mut values) = (self.around.clone(), self.later.values.clone());
        let after = self.compared.later_values(&self.earlier);
        for (t, of) in self.later.terms.iter().enumerate().filter(|(t, _)| changed[*t]) {
            // Tires are in every model, changed or not.
            chosen[t] = of.log_weights.len() - 1;
            let columns = of.from..of.from + of.priors.len();
            values[columns.clone()].copy_from_slice(&after[columns]);
        }
        // And have stood in for what has changed.
        values[..TIRES].copy_from_slice(&after[..TIRES]);
        (chosen != self.around).then_some((values, chosen))
    }

    /// Whether the later drive is likelier to be of this model than of one with fewer terms, by what either leaves of it and how far it takes what is known
    /// beforehand (tires that stand in for another grip); and the drives contradict each other by no more, but for
    /// what counts as the same.
    fn is_likelier(&self, simpler: &Self) -> bool {
        let contradiction = |of: &Self| of.compared.dispersion;
        let left = (simpler.later.weighed.cost - self.later.weighed.cost) / self.later.dispersion;
        let pulled = pull(&simpler.later.terms, &simpler.around) - pull(&self.later.terms, &self.around);
        SETTLED * contradiction(self) <= contradiction(simpler)
            && left + pulled
                > contradiction(simpler) * price(&self.later.terms, &simpler.around, &self.around)
    }
}

/// How far the present values of a model are from where they are expected: the sum of squares over their variances.
fn pull(terms: &[Term], chosen: &[usize]) -> f64 {
    let of = |(t, &c): (&Term, &usize)| t.priors.iter().map(|p| (p.offset / p.sigma[c]).powi(2)).sum::<f64>();
    terms.iter().zip(chosen).map(of).sum()
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
    /// The earlier drive, linearised as the later one is.
    earlier: Inferred,
    compared: Compared,
    /// Whether they were compared sample by sample.
    pub(crate) of_one_motion: bool,
    /// Squared error that one model, fitted to either drive, leaves of the later one over that of the earlier one.
    pub(crate) error_over_earlier: f64,
    pub(crate) changes: Vec<Change>,
    /// The effects that have changed, the likeliest first: likelier than not, and by an amount whose interval holds no zero.
    pub(crate) accepted: Vec<EffectId>,
}

impl Differences {
    fn of(earlier: Inferred, later: &Inferred, compared: Compared) -> Self {
        let of_one_motion = false;
        let error = |of: &Inferred| of.weighed.cost / of.weighed.residuals;
        let error_over_earlier = error_over(error(later), error(&earlier));
        let changes = compared.changes(&earlier);
        let stands_out =
            |e: &EffectId| compared.standing_out(&earlier, *e).is_some_and(|(_, told)| told > 1.0);
        let mut accepted: Vec<EffectId> = changes
            .iter()
            .filter(|c| c.probability >= decisions::LIKELY)
            .filter_map(|c| EffectId::by_name(c.name))
            .filter(stands_out)
            .collect();
        accepted.dedup();
        Self { earlier, compared, of_one_motion, error_over_earlier, changes, accepted }
    }

    /// The changes that are likelier than not.
    pub(crate) fn likely(self) -> Vec<Change> {
        let effect = |c: &Change| EffectId::by_name(c.name).is_none_or(|e| self.accepted.contains(&e));
        self.changes.iter().filter(|c| c.probability >= decisions::LIKELY && effect(c)).cloned().collect()
    }

    /// Takes note that held-out data speak against a change: what is listed says so, too.
    pub(crate) fn refute(&mut self, effect: EffectId) {
        self.accepted.retain(|e| *e != effect);
        spoken_against(&mut self.changes, effect);
    }

    /// An effect's parameters in the later drive, with standard deviations of what the earlier drive has and of the differences together.
    pub(crate) fn size(&self, effect: EffectId) -> Sized {
        let earlier = &self.earlier;
        let before = self.compared.earlier(earlier, effect).unwrap_or_default();
        let (by, mut sigma) = self.compared.difference(earlier, effect).unwrap_or_default();
        let own = earlier.sizes.effect(&earlier.columns, effect);
        let own = own.map_or_else(Vec::new, |(_, sigma)| sigma);
        sigma.iter_mut().zip(own).for_each(|(s, own)| *s = s.hypot(own));
        (before.iter().zip(&by).map(|(b, d)| b + d).collect(), sigma)
    }

    /// The effects that have changed, then those that may have.
    pub(crate) fn ranked(&self, engine: &Engine<'_>, budget: &Budget) -> Vec<RankedEffect> {
        let of = |effect: EffectId| RankedEffect {
            name: effect.name(),
            accepted: self.accepted.contains(&effect),
            parameters: reported(engine, effect, &self.size(effect)),
            gap_closed_fraction: budget.closed_by(effect),
            needed_fraction: f64::NAN,
            held_out_log_ratio: f64::NAN,
            over_unexplained: f64::NAN,
            size_over_half_width: f64::NAN,
            confidence: self.changes.iter().find(|c| c.name == effect.name()).map_or(0.0, |c| c.probability),
            confused_with: Vec::new(),
        };
        self.accepted.iter().copied().chain(self.candidates()).map(of).collect()
    }

    /// The other effects that are worth a word, the likeliest first.
    pub(crate) fn candidates(&self) -> Vec<EffectId> {
        let all = self.changes.iter().filter_map(|c| EffectId::by_name(c.name));
        all.filter(|e| !self.accepted.contains(e)).collect()
    }

    /// Whether the later drive is out of the reach of what explains the earlier one, and no effect is said to have changed: contradictions so large let none stand out.
    fn is_out_of_reach(&self) -> bool {
        self.accepted.is_empty() && self.error_over_earlier > decisions::OUT_OF_REACH
    }

    /// What the verdict rests on that is no change by itself.
    pub(crate) fn reasons(&self) -> Vec<String> {
        let paired = "the two are recordings of one motion, and were compared sample by sample: what no model says of the car is in both and hides no change";
        let out_of_reach = || {
            format!(
                "the model that explains the drive before leaves {:.0} times its squared error in this one, fitted to it as well: something differs that no change explains",
                self.error_over_earlier
            )
        };
        let paired = self.of_one_motion.then(|| paired.to_owned());
        paired.into_iter().chain(self.is_out_of_reach().then(out_of_reach)).collect()
    }

    /// The verdict: effects where some have changed, other tires, something that the library lacks, or nothing.
    pub(crate) fn verdict(&self) -> Verdict {
        let likely =
            |name: &str| self.changes.iter().any(|c| c.name == name && c.probability >= decisions::LIKELY);
        if !self.accepted.is_empty() {
            Verdict::Effects
        } else if likely("other") || self.is_out_of_reach() {
            Verdict::NoneOfThese
        } else if self.compared.of_tires() >= decisions::LIKELY {
            Verdict::TireRetuneOnly
        } else {
            Verdict::NoGap
        }
    }
}

/// One squared error over another, both over the noise of the same sensors: below it none tells anything.
fn error_over(later: f64, earlier: f64) -> f64 {
    later.max(1.0) / earlier.max(1.0)
}

/// Says of a listed change what held-out data leave of it.
fn spoken_against(changes: &mut [Change], effect: EffectId) {
    for change in changes.iter_mut().filter(|c| c.name == effect.name()) {
        change.probability = change.probability.min(decisions::NEEDLESS);
    }
    changes.sort_by(|a, b| b.probability.total_cmp(&a.probability));
}

#[cfg(test)]
mod tests {
    use gripsight_estimation::selection::ColumnPrior;

    use super::*;
    use crate::outcome::EffectParameter;

    #[test]
    fn what_held_out_data_speak_against_is_not_listed_as_likely() {
        let change = |name, probability| Change {
            site: "steering",
            name,
            parameter: None,
            at_slip_rad: None,
            difference: EffectParameter { value: 0.0, low: 0.0, high: 0.0, unit: "1", before: None },
            probability,
        };
        let mut changes = [change("steering_offset", 0.84), change("tires", 0.6), change("gyro_bias", 0.03)];
        spoken_against(&mut changes, EffectId::SteeringOffset);
        spoken_against(&mut changes, EffectId::GyroBias);
        let left = changes.map(|c| (c.name, c.probability));
        assert_eq!(left, [("tires", 0.6), ("steering_offset", decisions::NEEDLESS), ("gyro_bias", 0.03)]);
    }

    #[test]
    fn an_error_below_the_noise_is_as_good_as_the_noise() {
        let over = [(0.2, 0.9), (6.0, 0.5), (6.0, 2.0)].map(|(later, earlier)| error_over(later, earlier));
        assert_eq!(over, [1.0, 6.0, 3.0]);
    }

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
