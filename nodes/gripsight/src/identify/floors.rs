//! A drive over several floors, each identified by itself.

use std::path::{Path, PathBuf};

use anyhow::Context;
use gripsight_identification::{
    AcceptedSet, Config, Floors, FrictionPrior, IdentificationError, OnOneFloor, Outcome, Stage, identify,
    identify_floors,
};
use gripsight_report::status;
use gripsight_signals::{NS_PER_S, StateSequence};
use gripsight_vehicle::VehicleParameters;

/// Identifies a sequence: a whole drive floor by floor, with a remark on each; windows and drives put together as they are.
pub(super) fn identified(
    (sequence, whole): (&StateSequence, bool),
    vehicle: &VehicleParameters,
    prior: &dyn Fn(&StateSequence) -> Option<FrictionPrior>,
    previous: Option<&AcceptedSet>,
    config: &Config,
    progress: &mut dyn FnMut(Stage),
) -> Result<Floors, IdentificationError> {
    if !whole {
        let outcome = identify(sequence, vehicle, prior(sequence), previous, config, progress)?;
        return Ok(Floors {
            parts: vec![OnOneFloor { sequence: sequence.clone(), outcome }],
            changes: Vec::new(),
        });
    }
    let mut floors = identify_floors(sequence, vehicle, prior, previous, config, progress)?;
    let count = floors.parts.len();
    let changes = &floors.changes;
    for (k, part) in floors.parts.iter_mut().enumerate().filter(|_| count > 1) {
        let near = [k.checked_sub(1).and_then(|k| changes.get(k)), changes.get(k)];
        let near: Vec<String> = near.into_iter().flatten().map(ToString::to_string).collect();
        let remark = format!(
            "floor {} of {count}, {} of the drive: {}",
            k + 1,
            span(sequence, &part.sequence),
            near.join("; ")
        );
        part.outcome.reasons.insert(0, remark);
    }
    Ok(floors)
}

/// Where the files of a part go: those of the last one, which the car is on now, where they were asked for; those before it into folders of their own.
pub(super) fn folder(out: &Path, part: usize, parts: usize) -> anyhow::Result<PathBuf> {
    if part + 1 >= parts {
        return Ok(out.to_owned());
    }
    let folder = out.join(format!("floor_{}", part + 1));
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    Ok(folder)
}

/// Which part of a drive it is: `0.0 to 23.4 s`.
fn span(drive: &StateSequence, part: &StateSequence) -> String {
    let from_s = (part.start_stamp_ns - drive.start_stamp_ns) as f64 / NS_PER_S;
    format!("{from_s:.1} to {:.1} s", from_s + part.duration_s())
}

/// What the terminal says of a floor before the last one.
pub(super) fn line(drive: &StateSequence, part: &StateSequence, outcome: &Outcome, folder: &Path) -> String {
    let d = outcome.phi_p;
    format!(
        "floor of {}: {}, D {:.2} front, {:.2} rear: {}",
        span(drive, part),
        status(outcome),
        d.front.d,
        d.rear.d,
        folder.display()
    )
}
