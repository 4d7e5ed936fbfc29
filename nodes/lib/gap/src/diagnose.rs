//! The way from a recording to a diagnosis.

use std::collections::BTreeMap;

use gripsight_signals::{DataHealth, StateSequence};
use gripsight_vehicle::{PacejkaParameters, VehicleParameters};

use crate::effects::{EffectId, Need};
use crate::engine::{Engine, State, TireTrust};
use crate::evaluate::{by_block, interval, mean};
use crate::flexible::Flexible;
use crate::outcome::{DetectionLimit, Diagnosis, GapBudget, Invisible, TirePair};
use crate::recording::Recording;
use crate::select::{Round, reweigh, round, thresholds};
use crate::verdict::{Budget, decide, rank};
use crate::windows::{HORIZON_S, NEEDED_S, Split, Windows, split};
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
/// Held-out time that a score needs.
const LEAST_HELD_OUT_S: f64 = 3.0;

/// Diagnoses a recording. `progress` is told what is being done, in a few words.
///
/// # Errors
/// [`GapError`] says what is wrong with the data, the car or the request. That the data cannot tell is no error: the verdict then is
/// `not_identifiable`.
pub fn diagnose(request: &Request<'_>, progress: &mut dyn FnMut(&str)) -> Result<Diagnosis, GapError> {
    let data_health = DataHealth::of(request.sequence)?;
    let recording = Recording::new(request.sequence)?;
    let other = request.held_out.map(Recording::new).transpose()?;
    let mut windows = split(&recording, other.is_none());
    if windows.held_out.duration_s(recording.dt_s()) < LEAST_HELD_OUT_S && other.is_none() {
        windows = split(&recording, false);
    }
    let usable_s =
        windows.training.duration_s(recording.dt_s()) + windows.held_out.duration_s(recording.dt_s());
    if usable_s < NEEDED_S {
        return Err(GapError::TooLittle {
            usable_s,
            recorded_s: recording.recorded_s,
            needed_s: NEEDED_S,
            least_speed_mps: recording.least_speed_mps,
        });
    }
    informative(&recording)?;

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
    let budget = budget(&engine, other.as_ref(), &windows, &nominal, &null, &state, &rounds);
    let verdict = decide(&budget, &rounds, &state, instead);
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
        verdict: verdict.0,
        reasons: verdict.1,
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

/// Refuses recordings in which nothing happens.
fn informative(recording: &Recording) -> Result<(), GapError> {
    const LEAST_STEERING_RAD: f64 = 2e-3;
    const LEAST_A_Y_MPS2: f64 = 0.4;
    let rms = |values: &mut dyn Iterator<Item = f64>| {
        let (n, s) = values.fold((0.0_f64, 0.0_f64), |(n, s), v| (n + 1.0, s + v * v));
        if n > 0.0 { f64::sqrt(s / n) } else { 0.0 }
    };
    let steering = rms(&mut recording.runs.iter().flat_map(|r| r.steering_rad.iter().copied()));
    let a_y = rms(&mut recording
        .runs
        .iter()
        .flat_map(|r| r.v_x_mps.iter().zip(&r.measured[1]).map(|(v, w)| v * w)));
    if a_y < LEAST_A_Y_MPS2 || steering < LEAST_STEERING_RAD {
        return Err(GapError::NoInformation {
            what: "cornering",
            detail: format!(
                "RMS lateral acceleration {a_y:.2} m/s2 (at least {LEAST_A_Y_MPS2} needed), RMS steering {steering:.4} rad (at least {LEAST_STEERING_RAD})"
            ),
        });
    }
    let v_y = rms(&mut recording.runs.iter().flat_map(|r| r.measured[0].iter().copied()));
    if v_y < 1e-6 {
        return Err(GapError::NoInformation {
            what: "v_y",
            detail: "the odometry's lateral velocity is zero throughout: its estimator does not provide it"
                .to_owned(),
        });
    }
    Ok(())
}

fn budget(
    engine: &Engine<'_>,
    other: Option<&Recording>,
    windows: &Split,
    nominal: &[f64],
    null: &State,
    state: &State,
    rounds: &[Round],
) -> Budget {
    // The other bag has its own noise; models and weights are those fitted here.
    let foreign = other.map(|r| (Engine { recording: r, ..engine.clone() }, split(r, false)));
    let (scorer, on, scored_on): (&Engine<'_>, Windows, _) = match &foreign {
        Some((e, s)) => (e, crate::windows::of_length(e.recording, &s.training, HORIZON_S), "another bag"),
        None if windows.held_out.windows.is_empty() => (
            engine,
            crate::windows::of_length(engine.recording, &windows.training, HORIZON_S),
            "training blocks (too little data to hold any out)",
        ),
        None => (engine, windows.held_out.clone(), "held-out blocks"),
    };
    let blocks = |effects: &[EffectId], flexible: Option<&Flexible>, p: &[f64]| {
        by_block(scorer.recording, &on, &scorer.score(effects, flexible, p, &on))
    };
    let slip = large_slip_rad(engine, null, &windows.training);
    let flexible = Flexible::new(engine.recording, slip, engine.vehicle.wheelbase_m());
    let ceiling_values = engine.fit_flexible(state, &flexible, &windows.training);
    let mut steps = vec![blocks(&[], None, &null.parameters)];
    let mut so_far = Vec::new();
    for round in rounds {
        if let Some(best) = round.taken.and_then(|i| round.refits.get(i)) {
            so_far.push(best.effect);
            if so_far.len() < state.effects.len() {
                steps.push(blocks(&so_far, None, &best.state.parameters));
            }
        }
    }
    if !state.effects.is_empty() {
        steps.push(blocks(&state.effects, None, &state.parameters));
    }
    let ceiling = blocks(&state.effects, Some(&flexible), &ceiling_values);
    Budget::new(blocks(&[], None, nominal), steps, ceiling, scored_on)
}

/// A large slip angle of the recording on the fitted tires.
fn large_slip_rad(engine: &Engine<'_>, null: &State, windows: &Windows) -> f64 {
    let car = gripsight_vehicle::SingleTrack::new(engine.vehicle, &null.tires());
    let mut slips = Vec::new();
    for w in &windows.windows {
        let run = &engine.recording.runs[w.segment];
        for k in (w.from..w.from + w.len).step_by(5) {
            let state =
                gripsight_vehicle::State { v_y_mps: run.smooth[0][k], yaw_rate_radps: run.smooth[1][k] };
            let input =
                gripsight_vehicle::Input { v_x_mps: run.v_x_mps[k], steering_rad: run.steering_rad[k] };
            let (f, r) = car.slip_angles_rad(&state, &input);
            slips.push(f.abs().max(r.abs()));
        }
    }
    crate::smooth::quantile(slips, 0.8)
}

impl Budget {
    fn stated(&self, recording: &Recording) -> GapBudget {
        let channel_noise: BTreeMap<&'static str, f64> = recording
            .channels
            .iter()
            .zip(&recording.sigma)
            .filter(|(c, _)| c.scored())
            .map(|(c, s)| (c.name(), *s))
            .collect();
        let after = self.steps.last().map(|b| interval(b)).unwrap_or_default();
        let mut ceiling = interval(&self.ceiling);
        if mean(&self.ceiling) > after.value {
            ceiling = after;
        }
        GapBudget {
            nominal: interval(&self.nominal),
            retuned: self.steps.first().map(|b| interval(b)).unwrap_or_default(),
            after,
            unstructured_ceiling: ceiling,
            noise_floor: self.floor,
            horizon_s: HORIZON_S,
            channel_noise,
            scored_on: self.scored_on,
        }
    }
}
