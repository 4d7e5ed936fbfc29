//! Several drives of one car in one state: explained together, and each held against the drive that most agree with.

use gripsight_estimation::{Estimate, Windows, by_block, interval};
use gripsight_model::Recording;
use gripsight_signals::{DataHealth, Joined, StateSequence};
use serde::Serialize;

use crate::answer::Change;
use crate::budget::Scorer;
use crate::diagnose::explain;
use crate::outcome::Diagnosis;
use crate::state::State;
use crate::usable::{Usable, usable};
use crate::{Earlier, GapError, Request};

/// The drives that a [`Request`]'s sequence joins.
#[derive(Debug, Clone, Copy)]
pub struct Together<'a> {
    /// Each by itself.
    pub alone: &'a [StateSequence],
    /// When each begins and ends in the joined sequence, s: as of [`Joined`](gripsight_signals::Joined).
    pub spans_s: &'a [[f64; 2]],
}

/// What one of several drives says of what they give together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DriveAnswer {
    /// Which: by its place, until somebody knows a better name.
    pub name: String,
    /// Its length, s.
    pub duration_s: f64,
    /// Mean squared error over the noise variance on its scored stretches, with tires fitted to all drives that are explained together; unknown (`null`)
    /// of one that is not.
    pub retuned: Estimate,
    /// The same with what the diagnosis of all of them names.
    pub after: Estimate,
    /// What differs in it from the others: a car in one state has nothing here. Unknown (`null`) of a drive that cannot be compared:
    /// it is too short by itself, or records other signals.
    pub contradicts: Option<Vec<Change>>,
}

/// Errors drive by drive. `null`: tires alone, `model`: with the effects named.
pub(crate) fn errors(
    together: &Together<'_>,
    scorer: &Scorer<'_>,
    null: &State,
    model: &State,
) -> Vec<DriveAnswer> {
    let recording = scorer.engine.recording;
    let of = |(number, span): (usize, &[f64; 2])| {
        let windows = within(recording, &scorer.windows, *span);
        let error = |state: &State| {
            if windows.windows.is_empty() {
                return Estimate::UNKNOWN;
            }
            let score = scorer.engine.score(&state.effects, None, &state.parameters, &windows);
            interval(&by_block(recording, &windows, &score))
        };
        DriveAnswer {
            name: name(number),
            duration_s: span[1] - span[0],
            retuned: error(null),
            after: error(model),
            contradicts: None,
        }
    };
    together.spans_s.iter().enumerate().map(of).collect()
}

/// The windows of a span of time.
fn within(recording: &Recording, windows: &Windows, [from_s, to_s]: [f64; 2]) -> Windows {
    let inside = |k: &usize| {
        let window = windows.windows[*k];
        let time_s = recording.runs[window.segment].time_s(window.from);
        (from_s..=to_s).contains(&time_s)
    };
    let places: Vec<usize> = (0..windows.windows.len()).filter(inside).collect();
    windows.picked(&places)
}

/// What differs in each drive from the others; `None` of a drive that cannot be compared.
type Differing = Vec<Option<Vec<Change>>>;

/// What differs in each drive from the drive that most of them agree with: what drives in unlike states give together is the state of none, and
/// lacks so much that anything agrees with it.
fn contradictions(
    together: &Together<'_>,
    request: &Request<'_>,
    progress: &mut dyn FnMut(&str),
) -> Result<Differing, GapError> {
    let mut drives = Vec::new();
    for drive in together.alone {
        let health = DataHealth::of(drive)?;
        drives.push(usable(&Request::new(drive, request.vehicle), &health).ok());
    }
    let mut most: Differing = vec![None; drives.len()];
    let agreeing = |of: &Differing| of.iter().flatten().filter(|c| c.is_empty()).count();
    for (number, drive) in together.alone.iter().enumerate().filter(|(i, _)| drives[*i].is_some()) {
        let alone = Request { sequence: drive, held_out: None, together: None, ..request.clone() };
        let Ok(reference) = Earlier::diagnosed(&alone, progress) else { continue };
        let found = held_against(&reference, number, &drives, request, progress)?;
        if agreeing(&found) > agreeing(&most) {
            most = found;
        }
        if 2 * agreeing(&most) > most.iter().flatten().count() {
            break;
        }
    }
    Ok(most)
}

/// The diagnosis of all drives where they agree, else of those that do. `usable_of_all`, `data_health`: of all of them, joined.
pub(crate) fn of_one_state(
    together: &Together<'_>,
    request: &Request<'_>,
    usable_of_all: Usable,
    data_health: DataHealth,
    progress: &mut dyn FnMut(&str),
) -> Result<Diagnosis, GapError> {
    let differing = contradictions(together, request, progress)?;
    let one_state: Vec<usize> = (differing.iter().enumerate())
        .filter(|(_, c)| c.as_ref().is_some_and(Vec::is_empty))
        .map(|(i, _)| i)
        .collect();
    let agree = differing.iter().flatten().all(Vec::is_empty);
    if agree || one_state.is_empty() {
        let (mut diagnosis, _) = explain(request, usable_of_all, data_health, progress)?;
        diagnosis.drives.iter_mut().zip(differing).for_each(|(d, c)| d.contradicts = c);
        return Ok(diagnosis);
    }
    let alone: Vec<StateSequence> = one_state.iter().map(|&i| together.alone[i].clone()).collect();
    let joined = Joined::of(&alone)?;
    let part = Request {
        sequence: &joined.sequence,
        together: Some(Together { alone: &alone, spans_s: &joined.spans_s }),
        ..request.clone()
    };
    progress("explaining the drives that agree");
    let health = DataHealth::of(part.sequence)?;
    let (mut diagnosis, _) = explain(&part, usable(&part, &health)?, health, progress)?;
    let explained = std::mem::take(&mut diagnosis.drives);
    let spans = together.spans_s.iter().enumerate();
    diagnosis.drives = spans
        .zip(differing)
        .map(|((number, span), contradicts)| {
            let place = one_state.iter().position(|&i| i == number);
            let own = place.and_then(|place| explained.get(place));
            DriveAnswer {
                name: name(number),
                duration_s: span[1] - span[0],
                retuned: own.map_or(Estimate::UNKNOWN, |own| own.retuned),
                after: own.map_or(Estimate::UNKNOWN, |own| own.after),
                contradicts,
            }
        })
        .collect();
    let apart = if one_state.len() > 1 {
        "the drives are not in one state: only those that agree with each other are explained"
    } else {
        "no two of the drives are in one state: one of them is explained, and the others are held against it"
    };
    diagnosis.reasons.insert(0, apart.to_owned());
    Ok(diagnosis)
}

/// What a drive is called.
fn name(number: usize) -> String {
    format!("drive {}", number + 1)
}

/// What differs in each drive from the drive `number`.
fn held_against(
    reference: &Earlier,
    number: usize,
    drives: &[Option<Usable>],
    request: &Request<'_>,
    progress: &mut dyn FnMut(&str),
) -> Result<Differing, GapError> {
    let mut out = Vec::new();
    for (other, drive) in drives.iter().enumerate() {
        if other == number {
            out.push(Some(Vec::new()));
            continue;
        }
        let common = drive.as_ref().map(|own| (own, reference.common(&own.recording)));
        let Some((own, Ok(common))) = common else {
            out.push(None);
            continue;
        };
        progress(&format!("holding drive {} against drive {}", other + 1, number + 1));
        let recording = own.recording.with_channels(&common);
        let (_, differences) = reference.with_later(&recording, request.vehicle, &own.windows, progress)?;
        out.push(Some(differences.likely()));
    }
    Ok(out)
}
