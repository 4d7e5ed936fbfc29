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

/// Moves the folders of floors that an earlier run found in `out`, and this one did not: they would read as floors of this drive.
pub(super) fn set_aside(out: &Path, parts: usize) -> anyhow::Result<()> {
    for floor in parts.max(1).. {
        let old = out.join(format!("floor_{floor}"));
        if !old.exists() {
            break;
        }
        let aside = (1..).map(|k| out.join(format!("floor_{floor}.earlier_{k}"))).find(|path| !path.exists());
        let aside = aside.context("no name is free for an earlier floor")?;
        std::fs::rename(&old, &aside).with_context(|| format!("cannot move {}", old.display()))?;
        tracing::warn!("{} is of another drive: moved to {}", old.display(), aside.display());
    }
    Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_floor_of_an_earlier_run_is_moved_aside_and_kept() {
        let out = tempfile::tempdir().unwrap();
        let floor = |name: &str| out.path().join(name).join("pacejka.yaml");
        for name in ["floor_1", "floor_2", "floor_2.earlier_1", "floor_3", "floor_5"] {
            std::fs::create_dir(out.path().join(name)).unwrap();
            std::fs::write(floor(name), name).unwrap();
        }
        // Two floors now: the first one's folder is written anew, the last one's files go to `out` itself.
        set_aside(out.path(), 2).unwrap();
        let held = |name: &str| std::fs::read_to_string(floor(name)).ok();
        assert_eq!(held("floor_1").as_deref(), Some("floor_1"));
        assert_eq!([held("floor_2"), held("floor_3")], [None, None]);
        assert_eq!(held("floor_2.earlier_1").as_deref(), Some("floor_2.earlier_1"));
        assert_eq!(held("floor_2.earlier_2").as_deref(), Some("floor_2"));
        assert_eq!(held("floor_3.earlier_1").as_deref(), Some("floor_3"));
        // No run leaves a gap.
        assert_eq!(held("floor_5").as_deref(), Some("floor_5"));
    }
}
