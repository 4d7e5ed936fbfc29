//! The way from a recording to a diagnosis.

use gripsight_estimation::{Windows, split};
use gripsight_model::{EffectId, HOLD, Need, Recording};
use gripsight_signals::{DataHealth, StateSequence};
use gripsight_vehicle::{PacejkaParameters, VehicleParameters};

use crate::budget::{Budget, Models, Scorer, large_slip_rad};
use crate::engine::Engine;
use crate::outcome::{DetectionLimit, Diagnosis, Invisible, TirePair, Unexplained};
use crate::rooms::{Left, explained};
use crate::search::{Found, completed, search, without};
use crate::select::reweigh;
use crate::state::State;
use crate::transfer::drifts;
use crate::trust::TireTrust;
use crate::usable::{Usable, cannot_tell, refused, usable};
use crate::verdict::{Claim, Remains, claims, decide, drive_next, looks, rank, record_next};
use crate::{Earlier, ExtendedModelFile, GapError, noise, pictures, place, plausible};

/// What is diagnosed, and with what.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The recording.
    pub sequence: &'a StateSequence,
    /// Another recording of the same car in the same state, to score on; else every fourth block of the first is held out.
    pub held_out: Option<&'a StateSequence>,
    /// A drive from before, in place of `tires` and `model`: what has changed since is diagnosed.
    pub earlier: Option<&'a Earlier>,
    /// The car as the model has it.
    pub vehicle: &'a VehicleParameters,
    /// The tires as the model has them, and trusted to a few percent; `None`: identified from the training blocks.
    pub tires: Option<PacejkaParameters>,
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
            vehicle,
            tires: None,
            model: None,
            without: &[],
            only: &[],
        }
    }

    /// The model to start from, if any.
    fn given_model(&self) -> Option<&'a ExtendedModelFile> {
        self.earlier.map(|earlier| &earlier.diagnosis.extended_model).or(self.model)
    }

    /// The tires to start from, if any.
    pub(crate) fn given_tires(&self) -> Option<PacejkaParameters> {
        self.given_model().map(|m| m.tires).or(self.tires)
    }
}

/// Where fits without any knowledge of the tires start: (B, C, D, E) front and rear.
const GENERIC: [[f64; 8]; 3] = [
    [6.5, 1.5, 1.0, 0.0, 6.5, 1.5, 1.0, 0.0],
    [12.0, 1.5, 1.2, 0.0, 13.0, 1.5, 1.2, 0.0],
    [14.0, 1.5, 1.7, 0.0, 18.0, 1.5, 1.7, 0.0],
];
/// Windows that the search works on, at most.
pub(crate) const SEARCH_WINDOWS: usize = 70;

/// Diagnoses a recording. `progress` is told what is being done, in a few words.
///
/// # Errors
/// [`GapError`] says what is wrong with the data, the car or the request. That the data cannot tell is no error: the verdict then is
/// `not_identifiable`.
pub fn diagnose(request: &Request<'_>, progress: &mut dyn FnMut(&str)) -> Result<Diagnosis, GapError> {
    let data_health = DataHealth::of(request.sequence)?;
    match usable(request, &data_health) {
        Ok(usable) => explain(request, usable, data_health, progress),
        Err(error) if cannot_tell(&error) => Ok(refused(request, &error, data_health)),
        Err(error) => Err(error),
    }
}

fn explain(
    request: &Request<'_>,
    usable: Usable,
    data_health: DataHealth,
    progress: &mut dyn FnMut(&str),
) -> Result<Diagnosis, GapError> {
    let Usable { recording, windows } = usable;
    let other = request.held_out.map(|h| Recording::beside(h, Some(&recording))).transpose()?;
    progress("fitting the tires");
    let (tires, trust) = match request.given_tires() {
        Some(tires) if request.earlier.is_some() => (tires, TireTrust::drive()),
        Some(tires) => (tires, TireTrust::file()),
        None => (fit_tires(&recording, request.vehicle, &windows.training)?, TireTrust::free()),
    };
    let (library, invisible) = library(request, &recording, trust != TireTrust::free())?;
    let mut engine = Engine::new(&recording, request.vehicle, tires, trust);
    if let Some(model) = request.given_model() {
        (engine.held, engine.usual) = model.parameters()?;
    }
    let nominal = engine.nominal_model();
    // The search works on a bounded number of windows, the final fit on all.
    let search_windows = windows.training.thinned(SEARCH_WINDOWS);
    let blank = engine.blank();
    let first = engine.look(&[], &blank, None, &search_windows, 25);
    if !first.finite {
        return Err(GapError::NotFinite);
    }
    reweigh(&mut engine, &first, &search_windows);
    let null = engine.fit(&[], &first.parameters, Some(first.starts), &search_windows, 15);
    let Found { state, evidence, first, last, costs } =
        search(&mut engine, &null, &library, &search_windows, progress);
    let (null, state) = if search_windows.windows.len() < windows.training.windows.len() {
        progress("fitting on all training blocks");
        let on_all = |s: &State| engine.fit(&s.named, &s.parameters, None, &windows.training, 10);
        (on_all(&null), on_all(&state))
    } else {
        (null, state)
    };
    progress("looking at what is left, room by room");
    let slip_rad = large_slip_rad(&engine, &null, &windows.training);
    let before = Left::by(&engine, &null, &windows.training, slip_rad);
    let after = Left::where_calm(&engine, &state, &windows.training, slip_rad);
    let explained = explained(&engine, &state, &windows.training);
    let noise_is_known = noise::is_known(&recording);
    let scorer = Scorer::new(&engine, other.as_ref(), &windows);
    let drifts = drifts(&engine, &state, &windows.training, scorer.apart());
    let norm = request.earlier.map(|earlier| earlier.left(request)).transpose()?.unwrap_or_default();
    let remains = Remains {
        norm: &norm,
        before: &before,
        after: &after,
        explained: &explained,
        drifts: &drifts,
        noise_is_known,
    };
    let blocks = &windows.training.block;
    let mut claims = claims(&engine, &evidence, &state, &remains, &library, blocks);
    // What is no more than a candidate is left out of the model, and what harms where it was not fitted is no more.
    let model_of = |claims: &[Claim]| {
        let named: Vec<EffectId> = claims.iter().filter(|c| c.named).map(|c| c.effect).collect();
        if named.is_empty() {
            return null.clone();
        } else if named.len() == state.named.len() {
            return state.clone();
        }
        let values = engine.carry(&state, &named);
        engine.fit(&named, &values, Some(state.starts.clone()), &windows.training, 10)
    };
    let mut model = model_of(&claims);
    let with = scorer.error(&model);
    let mut harm = false;
    for claim in claims.iter_mut().filter(|claim| claim.is_unsure()) {
        let simpler = without(&engine, &model, claim.effect, &windows.training);
        harm |= claim.doubt_if_harmful(with, scorer.error(&simpler));
    }
    if harm {
        model = model_of(&claims);
    }
    let named = &model.named;
    claims.iter_mut().for_each(|claim| claim.with_company(&engine, &model, &windows.training));
    progress("scoring on held-out data");
    // What else there is stands beside what is named.
    let others = if named.is_empty() { &completed(&engine, first, &search_windows) } else { &last };
    let models = Models { nominal: &nominal, null: &null, state: &model, found: &state, others };
    let budget = Budget::of(&engine, &scorer, &windows, &models);
    let (verdict, mut reasons) = decide(&budget, &claims, &remains, &costs);
    // What cannot be right comes right after the errors: it explains more than any effect.
    reasons.splice(1..1, plausible::doubts(&recording, request.vehicle));
    reasons.extend(held_command(null.parameters[HOLD]));
    reasons.extend(request.earlier.map(|earlier| earlier.text()));
    reasons.extend(noise::caveat(&recording));
    let effects = rank(&engine, &claims, [&model, &state], blocks, others, &budget);
    let scored_windows =
        if windows.held_out.windows.is_empty() { &windows.training } else { &windows.held_out };
    let on_all = split(&recording, false).training;
    let nominal_score = engine.score(&nominal.effects, None, &nominal.parameters, &on_all);
    let detection_limits = last
        .screening
        .candidates
        .iter()
        .flat_map(|c| {
            c.effect
                .spec()
                .parameters
                .iter()
                .take(c.effect.sizing())
                .zip(&c.error)
                .map(|(p, e)| DetectionLimit { name: c.effect.name(), parameter: p.name, size: 5.0 * e })
        })
        .filter(|l| l.size.is_finite())
        .collect();
    Ok(Diagnosis {
        verdict,
        reasons,
        drive_next: [drive_next(&effects), record_next(verdict, &invisible)].concat(),
        effects,
        invisible,
        detection_limits,
        places: place::places(&engine, &nominal, &on_all, &nominal_score),
        identities: recording.identities.clone(),
        gap: budget.stated(&recording),
        gap_closed_fraction: budget.closed,
        tires: TirePair { without_effect: null.tires(), with_effect: model.tires() },
        extended_model: ExtendedModelFile::of(&engine, &model),
        data_health,
        looks: looks(&engine, &evidence, &last, &state),
        search_costs: costs,
        unexplained: Unexplained {
            cost: [before.cost, after.cost],
            explained: state.named.iter().map(|e| e.name()).zip(explained.iter().copied()).collect(),
            drift: state.named.iter().map(|e| e.name()).zip(drifts.iter().copied()).collect(),
            rooms: before.gains.iter().zip(&after.gains).map(|(b, a)| (b.0.name(), [b.1, a.1])).collect(),
        },
        series: pictures::series(&engine, &nominal, &null, &model, &on_all, &nominal_score, scored_windows),
    })
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
) -> Result<PacejkaParameters, GapError> {
    const FIRST: usize = 8;
    const REST: usize = 17;
    let windows = windows.thinned(SEARCH_WINDOWS);
    let best = GENERIC
        .iter()
        .map(|&start| {
            let engine =
                Engine::new(recording, vehicle, PacejkaParameters::from_array(start), TireTrust::free());
            let state = engine.look(&[], &engine.blank(), None, &windows, FIRST);
            (engine, state)
        })
        .filter(|(_, state)| state.finite)
        .min_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
    let (engine, state) = best.ok_or(GapError::NotFinite)?;
    let state = engine.look(&[], &state.parameters, Some(state.starts), &windows, REST);
    if state.finite { Ok(state.tires()) } else { Err(GapError::NotFinite) }
}

/// The effects to consider, and those that these signals cannot show.
pub(crate) fn library(
    request: &Request<'_>,
    recording: &Recording,
    trusted: bool,
) -> Result<(Vec<EffectId>, Vec<Invisible>), GapError> {
    let known = |name: &String| EffectId::known(name);
    let without = request.without.iter().map(known).collect::<Result<Vec<_>, _>>()?;
    let only = request.only.iter().map(known).collect::<Result<Vec<_>, _>>()?;
    let met = |need: Need| match need {
        Need::LongitudinalCommand => recording.has_command,
        Need::Accelerometer => recording.channels.contains(&gripsight_model::Channel::LateralAcceleration),
        // A second drive passes the places of the first.
        Need::Passes => {
            recording.laps.laps >= 1.5 || (recording.laps.lap_m > 0.0 && request.held_out.is_some())
        }
        Need::ReferenceTires => trusted,
    };
    let mut library = Vec::new();
    let mut invisible = Vec::new();
    for &effect in EffectId::ALL {
        if without.contains(&effect) || (!only.is_empty() && !only.contains(&effect)) {
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
