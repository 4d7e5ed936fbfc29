//! A drive over several floors: cut where the grip changed, each part identified by itself.

use gripsight_signals::{NS_PER_S, StateSequence};
use gripsight_vehicle::VehicleParameters;

use crate::data::WINDOW_S;
use crate::run::{Identification, Started};
use crate::{AcceptedSet, Config, FrictionPrior, GripChange, IdentificationError, Outcome, Stage, Usable};

/// A part of a drive on which the grip stayed the same, and what it gives.
#[derive(Debug, Clone, PartialEq)]
pub struct OnOneFloor {
    /// The part.
    pub sequence: StateSequence,
    /// What it gives.
    pub outcome: Outcome,
}

/// A drive by its floors.
#[derive(Debug, Clone, PartialEq)]
pub struct Floors {
    /// The parts, in the order driven; the whole drive where the grip never changed.
    pub parts: Vec<OnOneFloor>,
    /// The changes between them, in time since the start of the drive.
    pub changes: Vec<GripChange>,
}

/// As [`crate::identify`], each floor by itself: a window on either side of a change belongs to neither. `prior` says what is believed of the friction of a
/// part.
///
/// # Errors
/// As [`crate::identify`].
pub fn identify_floors(
    sequence: &StateSequence,
    vehicle: &VehicleParameters,
    prior: &dyn Fn(&StateSequence) -> Option<FrictionPrior>,
    previous: Option<&AcceptedSet>,
    config: &Config,
    progress: &mut dyn FnMut(Stage),
) -> Result<Floors, IdentificationError> {
    progress(Stage::Preparing);
    let usable = Usable::of(sequence, vehicle)?;
    let started = Identification::start_on(&usable, sequence, vehicle, prior(sequence), previous, config)?;
    let run = match started {
        Started::Running(run) => run,
        Started::Refused(outcome) => return Ok(Floors::one(sequence, *outcome)),
    };
    let Some(change) = run.direct.grip_change else {
        return Ok(Floors::one(sequence, run.finished(&usable, progress)?));
    };
    let mut floors = Floors { parts: Vec::new(), changes: Vec::new() };
    let spans_s = [(0.0, change.at_s - WINDOW_S), (change.at_s + WINDOW_S, f64::from(f32::MAX))];
    for (place, (from_s, to_s)) in spans_s.into_iter().enumerate() {
        let part = sequence.between(from_s, to_s)?;
        let later_s = (part.start_stamp_ns - sequence.start_stamp_ns) as f64 / NS_PER_S;
        let found = identify_floors(&part, vehicle, prior, previous, config, progress)?;
        if place == 1 {
            floors.changes.push(change);
        }
        floors.changes.extend(found.changes.into_iter().map(|c| GripChange { at_s: later_s + c.at_s, ..c }));
        floors.parts.extend(found.parts);
    }
    Ok(floors)
}

impl Floors {
    fn one(sequence: &StateSequence, outcome: Outcome) -> Self {
        Self { parts: vec![OnOneFloor { sequence: sequence.clone(), outcome }], changes: Vec::new() }
    }
}
