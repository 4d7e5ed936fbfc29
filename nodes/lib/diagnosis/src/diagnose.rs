//! The way from a recording to a diagnosis.

use gripsight_estimation::{Windows, split};
use gripsight_model::{EffectId, Flexible, HOLD, Need, Recording, Site};
use gripsight_signals::{DataHealth, StateSequence};
use gripsight_vehicle::{OWN_TIRE_PARAMETERS, OwnTires, PacejkaParameters, TirePosterior, VehicleParameters};

use crate::budget::{Budget, CANDIDATES, Models, Scorer, Steps, large_slip_rad};
use crate::engine::Engine;
use crate::figures::figures;
use crate::finding::{detection_limits, ranked, sites};
use crate::infer::infer;
use crate::inferred::Inferred;
use crate::outcome::{Diagnosis, Inference, Invisible, TirePair};
use crate::posterior::{is_of, trust, usual};
use crate::state::State;
use crate::trust::TireTrust;
use crate::usable::{Usable, cannot_tell, refused, usable};
use crate::verdict::{decide, drive_next, errors, record_next};
use crate::{Earlier, ExtendedModelFile, GapError, Together, drives, noise, pictures, place, plausible};

/// What is diagnosed, and with what.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The recording.
    pub sequence: &'a StateSequence,
    /// Another recording of the same car in the same state, to score on; else every fourth block of the first is held out.
    pub held_out: Option<&'a StateSequence>,
    /// A drive from before, in place of `tires` and `model`: what has changed since is diagnosed.
    pub earlier: Option<&'a Earlier>,
    /// The drives that `sequence` joins, where it is not one drive.
    pub together: Option<Together<'a>>,
    /// The car as the model has it.
    pub vehicle: &'a VehicleParameters,
    /// The effective tires of a file, taken for the car's own and trusted to a few percent; `None`: identified from the training blocks.
    pub tires: Option<PacejkaParameters>,
    /// The car's own tires from another drive, or from this one, where they are but a place to start from; in place of `tires`.
    pub posterior: Option<&'a TirePosterior>,
    /// The model to start from, in place of `tires`: an earlier diagnosis, its effects in place at their sizes.
    pub model: Option<&'a ExtendedModelFile>,
    /// Names of effects to leave out of the library.
    pub without: &'a [String],
    /// The only effects to consider, by name; empty: the whole library.
    pub only: &'a [String],
}

impl<'a> Request<'a> {
    /// Diagnoses a recording by the whole library, with nothing known but the car.
    #[must_use]
    pub fn new(sequence: &'a StateSequence, vehicle: &'a VehicleParameters) -> Self {
        Self {
            sequence,
            held_out: None,
            earlier: None,
            together: None,
            vehicle,
            tires: None,
            posterior: None,
            model: None,
            without: &[],
            only: &[],
        }
    }

    /// Whether an effect is of the library that is considered.
    pub(crate) fn considers(&self, effect: EffectId) -> bool {
        let among = |names: &[String]| names.iter().any(|name| EffectId::by_name(name) == Some(effect));
        !among(self.without) && (self.only.is_empty() || among(self.only))
    }

    /// The model to start from, if any.
    fn given_model(&self) -> Option<&'a ExtendedModelFile> {
        self.earlier.map(|earlier| &earlier.model).or(self.model)
    }

    /// The tires to start from, if any.
    pub(crate) fn given_tires(&self) -> Option<OwnTires> {
        self.given_model().map(|m| m.tires).or(self.tires.as_ref().map(OwnTires::assumed))
    }
}

/// Where fits without any knowledge of the tires start, from soft to stiff: cornering stiffness over load (B C D, 1/rad), C, D, E of front and rear, as
/// [`OwnTires::from_parameters`] takes them. B is 6.5 to 18.
const GENERIC: [[f64; OWN_TIRE_PARAMETERS]; 3] = [
    [9.75, 1.5, 1.0, 0.0, 9.75, 1.5, 1.0, 0.0],
    [21.6, 1.5, 1.2, 0.0, 23.4, 1.5, 1.2, 0.0],
    [35.7, 1.5, 1.7, 0.0, 45.9, 1.5, 1.7, 0.0],
];
/// Windows that the inference works on, at most.
pub(crate) const SEARCH_WINDOWS: usize = 70;
/// Iterations of the fits on all training blocks.
const FINAL_ITERATIONS: usize = 15;

/// Diagnoses a recording. `progress` is told what is being done, in a few words.
///
/// # Errors
/// [`GapError`] says what is wrong with the data, the car or the request. That the data cannot tell is no error: the verdict then is
/// `not_identifiable`.
pub fn diagnose(request: &Request<'_>, progress: &mut dyn FnMut(&str)) -> Result<Diagnosis, GapError> {
    let data_health = DataHealth::of(request.sequence)?;
    match usable(request, &data_health) {
        Ok(usable) => match &request.together {
            Some(together) => drives::of_one_state(together, request, usable, data_health, progress),
            None => Ok(explain(request, usable, data_health, progress)?.0),
        },
        Err(error) if cannot_tell(&error) => Ok(refused(request, &error, data_health)),
        Err(error) => Err(error),
    }
}

/// The way of a recording that can tell.
pub(crate) fn explain(
    request: &Request<'_>,
    usable: Usable,
    data_health: DataHealth,
    progress: &mut dyn FnMut(&str),
) -> Result<(Diagnosis, Inferred), GapError> {
    let Usable { recording, windows } = usable;
    let recording = match request.earlier {
        Some(earlier) => recording.with_channels(&earlier.common(&recording)?),
        None => recording,
    };
    let other = request.held_out.map(|h| Recording::beside(h, Some(&recording))).transpose()?;
    progress("fitting the tires");
    let (tires, trust) = match (request.posterior, request.given_tires()) {
        (Some(posterior), _) if is_of(posterior, request.sequence) => (posterior.tires()?, TireTrust::free()),
        (Some(posterior), _) => (posterior.tires()?, trust(posterior)?),
        (None, Some(tires)) if request.earlier.is_some() => (tires, TireTrust::drive()),
        (None, Some(tires)) => (tires, TireTrust::file()),
        (None, None) => (fit_tires(&recording, request.vehicle, &windows.training)?, TireTrust::free()),
    };
    let (library, invisible) = library(request, &recording, trust.knows_the_peak())?;
    let mut engine = Engine::new(&recording, request.vehicle, tires, trust);
    if let Some(model) = request.given_model() {
        (engine.held, engine.usual) = model.parameters()?;
    } else if let Some(posterior) = request.posterior {
        engine.usual = usual(posterior)?;
    }
    let nominal = engine.nominal_model();
    // The inference works on a bounded number of windows, the final fit on all.
    let search_windows = windows.training.thinned(SEARCH_WINDOWS);
    let first = fitted_null(&engine, &search_windows)?;
    let (mut inferred, mut differences) = match request.earlier {
        None => {
            let slip_rad = large_slip_rad(&engine, &search_windows);
            let wheelbase_m = request.vehicle.wheelbase_m();
            let flexible = Flexible::new(&recording, slip_rad, wheelbase_m, &Site::ALL);
            let scorer = Scorer::new(&engine.clone(), other.as_ref(), &windows);
            let found = infer(&mut engine, &first, &library, flexible, &search_windows, &scorer, progress);
            (found.ok_or(GapError::NotFinite)?, None)
        }
        Some(earlier) => {
            let (later, differences) = earlier.with_later(&recording, request.vehicle, &windows, progress)?;
            engine.sigma.clone_from(&later.sigma);
            (later, Some(differences))
        }
    };
    progress("fitting on all training blocks");
    let null = engine.fit(&[], &first.parameters, None, &windows.training, FINAL_ITERATIONS);
    let scorer = Scorer::new(&engine, other.as_ref(), &windows);
    // What rollouts of held-out data speak against is not named, and the rest fitted without it.
    let (model, steps, candidates) = loop {
        let (named, candidates) = match &differences {
            Some(differences) => (differences.accepted.clone(), differences.candidates()),
            None => (inferred.modelled(), inferred.candidates()),
        };
        let size = |effect: &EffectId| match &differences {
            Some(differences) => differences.size(*effect).0,
            None => inferred.size(*effect).0,
        };
        let model = if named.is_empty() {
            null.clone()
        } else {
            let mut values = engine.carry(&null, &named);
            let own: Vec<f64> = named.iter().flat_map(size).collect();
            let from = values.len() - own.len();
            values[from..].copy_from_slice(&own);
            engine.fit(&named, &values, Some(null.starts.clone()), &windows.training, FINAL_ITERATIONS)
        };
        let steps = Steps::of(&engine, &scorer, &windows, &null, &model);
        // What falls out of a comparison sample by sample is in the rollouts of one drive.
        let by_rollouts = differences.as_ref().is_none_or(|d| !d.of_one_motion);
        let refuted = by_rollouts.then(|| steps.refuted(&engine, &scorer, &windows, &model)).flatten();
        let Some(effect) = refuted else {
            let candidates = candidates.into_iter().filter(|e| !named.contains(e)).take(CANDIDATES);
            let candidates: Vec<(EffectId, Vec<f64>)> = candidates.map(|e| (e, size(&e))).collect();
            break (model, steps, candidates);
        };
        match &mut differences {
            Some(differences) => differences.refute(effect),
            None => inferred.refute(effect),
        }
    };
    progress("scoring on held-out data");
    let models =
        Models { nominal: &nominal, null: &null, state: &model, steps: &steps, candidates: &candidates };
    let budget = Budget::of(&engine, &scorer, &windows, &models);
    let (verdict, mut reasons) = match &differences {
        Some(differences) => {
            let mut reasons = errors(&budget, model.named.is_empty());
            reasons.extend(differences.reasons());
            (differences.verdict(), reasons)
        }
        None => decide(&budget, &inferred, &library),
    };
    // What cannot be right comes right after the errors: it explains more than any effect.
    reasons.splice(1..1, plausible::doubts(&recording, request.vehicle));
    // By its stamps a command is held as it is; an angle without any may still be one.
    if !recording.steering_is_held() {
        reasons.extend(held_command(null.parameters[HOLD]));
    }
    reasons.extend(request.earlier.map(Earlier::text));
    reasons.extend(noise::caveat(&recording));
    let error_over_earlier = differences.as_ref().map(|d| d.error_over_earlier);
    let effects = match &differences {
        Some(differences) => differences.ranked(&engine, &budget),
        None => ranked(&engine, &inferred, &library, &budget),
    };
    let scored_windows =
        if windows.held_out.windows.is_empty() { &windows.training } else { &windows.held_out };
    let on_all = split(&recording, false).training;
    let slips_rad = pictures::slips(&engine, &on_all);
    let tires = TirePair {
        without_effect: engine.effective_tires(&null, slips_rad),
        with_effect: engine.effective_tires(&model, slips_rad),
    };
    let nominal_score = engine.score(&nominal.effects, None, &nominal.parameters, &on_all);
    let series = pictures::series(
        &engine,
        &nominal,
        [&null, &model],
        (&tires, slips_rad),
        &on_all,
        &nominal_score,
        scored_windows,
    );
    let diagnosis = Diagnosis {
        verdict,
        reasons,
        drive_next: [drive_next(&effects), record_next(verdict, &invisible)].concat(),
        sites: sites(&inferred, &effects),
        effects,
        changes: differences.map(|d| d.changes).unwrap_or_default(),
        drives: request.together.map_or_else(Vec::new, |t| drives::errors(&t, &scorer, &null, &model)),
        invisible,
        detection_limits: detection_limits(&engine, &inferred),
        figures: figures(&engine, &inferred),
        places: place::places(&engine, &nominal, &on_all, &nominal_score),
        identities: recording.identities.clone(),
        gap: budget.stated(&recording),
        gap_closed_fraction: budget.closed,
        tires,
        extended_model: ExtendedModelFile::of(&engine, &model),
        data_health,
        inference: Some(Inference {
            rounds: inferred.rounds,
            dispersion: inferred.dispersion,
            error_over_earlier,
        }),
        series,
    };
    Ok((diagnosis, inferred))
}

/// Tires and background fitted, nothing else.
pub(crate) fn fitted_null(engine: &Engine<'_>, windows: &Windows) -> Result<State, GapError> {
    const ITERATIONS: usize = 30;
    let null = engine.fit(&[], &engine.blank(), None, windows, ITERATIONS);
    if null.finite { Ok(null) } else { Err(GapError::NotFinite) }
}

/// A sentence where the steering is so late by its hold alone that one could take it for a delay.
fn held_command(hold_s: f64) -> Option<String> {
    const LATE_S: f64 = 0.01;
    (hold_s > LATE_S).then(|| {
        format!(
            "the steering acts {:.0} ms after its stamp, as a command that is held until the next one does: steering_delay and steering_lag are what comes on top",
            1e3 * hold_s
        )
    })
}

/// The best tires of a recording, with nothing known of them: from several starts, soft and stiff.
pub(crate) fn fit_tires(
    recording: &Recording,
    vehicle: &VehicleParameters,
    windows: &Windows,
) -> Result<OwnTires, GapError> {
    const FIRST: usize = 8;
    const REST: usize = 17;
    let windows = windows.thinned(SEARCH_WINDOWS);
    // Which start leads on shows on a part of them.
    let some = windows.thinned(SEARCH_WINDOWS / 3);
    let best = GENERIC
        .iter()
        .map(|&start| {
            let engine =
                Engine::new(recording, vehicle, OwnTires::from_parameters(&start), TireTrust::free());
            let state = engine.fit(&[], &engine.blank(), None, &some, FIRST);
            (engine, state)
        })
        .filter(|(_, state)| state.finite)
        .min_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
    let (engine, state) = best.ok_or(GapError::NotFinite)?;
    let state = engine.fit(&[], &state.parameters, None, &windows, REST);
    if state.finite { Ok(state.tires()) } else { Err(GapError::NotFinite) }
}

/// The effects to consider, and those that these signals cannot show.
pub(crate) fn library(
    request: &Request<'_>,
    recording: &Recording,
    peak_is_known: bool,
) -> Result<(Vec<EffectId>, Vec<Invisible>), GapError> {
    for name in request.without.iter().chain(request.only) {
        EffectId::known(name)?;
    }
    let met = |need: Need| match need {
        Need::LongitudinalCommand => recording.has_command,
        Need::Accelerometer => recording.channels.contains(&gripsight_model::Channel::LateralAcceleration),
        // A second drive passes the places of the first.
        Need::Passes => {
            recording.laps.laps >= 1.5 || (recording.laps.lap_m > 0.0 && request.held_out.is_some())
        }
        Need::ReferenceTires => peak_is_known,
    };
    let mut library = Vec::new();
    let mut invisible = Vec::new();
    for effect in EffectId::candidates() {
        if !request.considers(effect) {
            continue;
        }
        match effect.spec().needs.iter().find(|n| !met(**n)) {
            Some(&need) => {
                invisible.push(Invisible { name: effect.name(), reason: need.reason().to_owned(), need });
            }
            None => library.push(effect),
        }
    }
    Ok((library, invisible))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fits_start_from_soft_and_stiff_tires() {
        let b = GENERIC.map(|start| {
            let tires = OwnTires::from_parameters(&start);
            [tires.front.b, tires.rear.b]
        });
        for (found, expected) in b.iter().zip([[6.5, 6.5], [12.0, 13.0], [14.0, 18.0]]) {
            for (found, expected) in found.iter().zip(expected) {
                approx::assert_relative_eq!(*found, expected, max_relative = 1e-12);
            }
        }
    }
}
