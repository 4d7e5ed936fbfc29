//! The way from a recording to a diagnosis.

use gripsight_signals::{DataHealth, StateSequence};
use gripsight_vehicle::{PacejkaParameters, VehicleParameters};

use crate::budget::{Budget, Models};
use crate::effects::{EffectId, Need};
use crate::engine::{Engine, State, TireTrust};
use crate::outcome::{DetectionLimit, Diagnosis, Invisible, TirePair};
use crate::recording::Recording;
use crate::select::{Round, reweigh, round, thresholds};
use crate::usable::{Usable, cannot_tell, refused, usable};
use crate::verdict::{decide, rank};
use crate::windows::{Windows, split};
use crate::{GapError, pictures, place};

/// What is diagnosed, and with what.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The recording.
    pub sequence: &'a StateSequence,
    /// Another recording of the same car in the same state, to score on; else every fourth block of the first is held out.
    pub held_out: Option<&'a StateSequence>,
    /// A drive from before: its tires are the reference that the recording is compared with.
    pub reference: Option<&'a StateSequence>,
    /// The car as the model has it.
    pub vehicle: &'a VehicleParameters,
    /// The tires as the model has them, and trusted to a few percent; `None`: identified from the training blocks.
    pub tires: Option<PacejkaParameters>,
    /// Names of effects to leave out of the library.
    pub without: &'a [String],
    /// The only effects to consider, by name; empty: the whole library.
    pub only: &'a [String],
}

/// Where a fit without any knowledge of the tires starts.
const GENERIC: [f64; 8] = [6.5, 1.5, 1.0, 0.0, 6.5, 1.5, 1.0, 0.0];
/// Windows that the search works on, at most.
const SEARCH_WINDOWS: usize = 70;

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
    let other = request.held_out.map(Recording::new).transpose()?;
    progress("fitting the tires");
    let (tires, trust) = match (request.tires, request.reference) {
        (Some(tires), _) => (tires, TireTrust::file()),
        (None, Some(reference)) => {
            let reference = Recording::new(reference)?;
            let windows = split(&reference, false);
            (fit_tires(&reference, request.vehicle, &windows.training)?, TireTrust::drive())
        }
        (None, None) => (fit_tires(&recording, request.vehicle, &windows.training)?, TireTrust::free()),
    };
    let (library, invisible) = library(request, &recording, trust != TireTrust::free())?;
    let mut engine = Engine::new(&recording, request.vehicle, tires, trust);
    let nominal = engine.nominal_parameters();
    // The search works on a bounded number of windows, the final fit on all.
    let search = windows.training.thinned(SEARCH_WINDOWS);
    let first = engine.fit(&[], &nominal, None, &search, 25);
    if !first.finite {
        return Err(GapError::NotFinite);
    }
    reweigh(&mut engine, &first, &search);
    let null = engine.fit(&[], &first.parameters, Some(first.starts), &search, 15);

    let mut state = null.clone();
    let mut rounds: Vec<Round> = Vec::new();
    // Whether the effect stands instead of a retune: the tires are then held where they were handed over.
    let mut instead = false;
    while rounds.len() <= thresholds::MOST_EFFECTS {
        progress(&format!(
            "comparing {} effects, round {}",
            library.len() - state.effects.len(),
            rounds.len() + 1
        ));
        let here = round(&engine, &state, &library, &search, rounds.len());
        let taken = here.taken;
        let next = taken.and_then(|i| here.refits.get(i)).map(|r| r.state.clone());
        rounds.push(here);
        match next {
            Some(next) if rounds.len() <= thresholds::MOST_EFFECTS => {
                state = next;
                reweigh(&mut engine, &state, &search);
                let effects = state.effects.clone();
                state = engine.fit(&effects, &state.parameters, Some(state.starts), &search, 8);
            }
            _ => break,
        }
    }

    if state.effects.is_empty() && engine.trust != TireTrust::free() {
        progress("comparing effects with a retune of the tires");
        if let Some((here, found)) = instead_of_retune(&engine, &null, &library, &search) {
            rounds = vec![here];
            state = found;
            instead = true;
        }
    }
    let (null, state) = if search.windows.len() < windows.training.windows.len() {
        progress("fitting on all training blocks");
        let held = engine.holding();
        let on_all =
            |e: &Engine<'_>, s: &State| e.fit(&s.effects, &s.parameters, None, &windows.training, 10);
        (on_all(&engine, &null), on_all(if instead { &held } else { &engine }, &state))
    } else {
        (null, state)
    };
    progress("scoring on held-out data");
    let models = Models { nominal: &nominal, null: &null, state: &state, rounds: &rounds, instead };
    let budget = Budget::of(&engine, other.as_ref(), &windows, &models);
    let (verdict, mut reasons) = decide(&budget, &rounds, &state, instead);
    reasons.extend(crate::noise::caveat(&recording));
    let effects = rank(&rounds, &state, &budget);
    let scored_windows =
        if windows.held_out.windows.is_empty() { &windows.training } else { &windows.held_out };
    let on_all = split(&recording, false).training;
    let nominal_score = engine.score(&[], None, &nominal, &on_all);
    let detection_limits = rounds
        .first()
        .map(|r| {
            r.screening
                .candidates
                .iter()
                .flat_map(|c| {
                    c.effect.spec().parameters.iter().zip(&c.error).map(|(p, e)| DetectionLimit {
                        name: c.effect.name(),
                        parameter: p.name,
                        size: 5.0 * e,
                    })
                })
                .filter(|l| l.size.is_finite())
                .collect()
        })
        .unwrap_or_default();
    Ok(Diagnosis {
        verdict,
        reasons,
        drive_next: crate::verdict::drive_next(&effects),
        effects,
        invisible,
        detection_limits,
        places: place::places(&engine, &nominal, &on_all, &nominal_score),
        identities: recording.identities.clone(),
        gap: budget.stated(&recording),
        gap_closed_fraction: budget.closed,
        tires: TirePair { without_effect: null.tires(), with_effect: state.tires() },
        data_health,
        series: pictures::series(&engine, &nominal, &null, &state, &on_all, &nominal_score, scored_windows),
    })
}

/// Where trusted tires had to move far, an effect may explain the same with the tires as they were: the round of that search, and
/// the model found, if one does as well as the retune.
fn instead_of_retune(
    engine: &Engine<'_>,
    null: &State,
    library: &[EffectId],
    windows: &Windows,
) -> Option<(Round, State)> {
    if engine.tire_shift(null) < thresholds::FAR_SHIFT {
        return None;
    }
    let held = engine.holding();
    let before = held.fit(&[], &held.nominal_parameters(), None, windows, 12);
    let here = round(&held, &before, library, windows, 0);
    let best = here.taken.and_then(|i| here.refits.get(i)).map(|r| r.state.clone())?;
    // Let go again, the tires must stay nearer to what was handed over than a retune would take them.
    let free = engine.fit(&best.effects, &best.parameters, Some(best.starts.clone()), windows, 12);
    let cost = |s: &State| s.window_costs.iter().sum::<f64>();
    let as_good = cost(&free) < cost(null) + thresholds::LEAST_GAIN * null.residuals();
    let nearer = engine.tire_shift(&free) < thresholds::NEARER * engine.tire_shift(null);
    (free.finite && as_good && nearer).then_some((here, best))
}

/// The best tires of a recording, with nothing known of them.
fn fit_tires(
    recording: &Recording,
    vehicle: &VehicleParameters,
    windows: &Windows,
) -> Result<PacejkaParameters, GapError> {
    let engine = Engine::new(recording, vehicle, PacejkaParameters::from_array(GENERIC), TireTrust::free());
    let state = engine.fit(&[], &engine.nominal_parameters(), None, windows, 25);
    if state.finite { Ok(state.tires()) } else { Err(GapError::NotFinite) }
}

/// The effects to consider, and those that these signals cannot show.
fn library(
    request: &Request<'_>,
    recording: &Recording,
    trusted: bool,
) -> Result<(Vec<EffectId>, Vec<Invisible>), GapError> {
    let known = |name: &String| {
        EffectId::by_name(name).ok_or_else(|| GapError::UnknownEffect {
            name: name.clone(),
            known: EffectId::ALL.iter().map(|e| e.name()).collect::<Vec<_>>().join(", "),
        })
    };
    let without = request.without.iter().map(known).collect::<Result<Vec<_>, _>>()?;
    let only = request.only.iter().map(known).collect::<Result<Vec<_>, _>>()?;
    let met = |need: Need| match need {
        Need::LongitudinalCommand => recording.has_command,
        Need::Accelerometer => recording.channels.contains(&crate::Channel::LateralAcceleration),
        Need::Laps => recording.laps.laps >= 1.5,
        Need::ReferenceTires => trusted,
    };
    let mut library = Vec::new();
    let mut invisible = Vec::new();
    for &effect in EffectId::ALL {
        if without.contains(&effect) || (!only.is_empty() && !only.contains(&effect)) {
            continue;
        }
        match effect.spec().needs.iter().find(|n| !met(**n)) {
            Some(need) => invisible.push(Invisible { name: effect.name(), reason: need.reason().to_owned() }),
            None => library.push(effect),
        }
    }
    Ok((library, invisible))
}
