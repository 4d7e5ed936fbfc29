//! Several drives of one car in one state: explained together, and each held against what they give together.

use gripsight_estimation::{Estimate, Windows, by_block, interval};
use gripsight_model::Recording;
use gripsight_signals::{DataHealth, StateSequence};
use serde::Serialize;

use crate::answer::Change;
use crate::budget::Scorer;
use crate::state::State;
use crate::usable::usable;
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
    /// Mean squared error over the noise variance on its scored stretches, with tires fitted to all drives.
    pub retuned: Estimate,
    /// The same with what the diagnosis of all of them names.
    pub after: Estimate,
    /// What differs in it from what all of them give together: a car in one state has nothing here. Unknown (`null`) of a drive that cannot be compared:
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
            name: format!("drive {}", number + 1),
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

/// What differs in each drive from what all of them give. A drive is part of all of them, so that its difference is known somewhat better than is
/// stated.
pub(crate) fn contradictions(
    all: &Earlier,
    together: &Together<'_>,
    request: &Request<'_>,
    progress: &mut dyn FnMut(&str),
) -> Result<Vec<Option<Vec<Change>>>, GapError> {
    let mut out = Vec::new();
    for (number, drive) in together.alone.iter().enumerate() {
        progress(&format!("holding drive {} against all of them", number + 1));
        let own = usable(&Request::new(drive, request.vehicle), &DataHealth::of(drive)?).ok();
        // What only some drives record was left out of all of them.
        let Some(own) = own.filter(|own| all.matches(&own.recording)) else {
            out.push(None);
            continue;
        };
        let (_, differences) = all.with_later(&own.recording, request.vehicle, &own.windows.training)?;
        out.push(Some(differences.likely()));
    }
    Ok(out)
}
