//! posterior.json: the car's own tires, for a diagnosis to start from.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;
use gripsight_diagnosis::own_tires;
use gripsight_identification::Outcome;
use gripsight_signals::StateSequence;
use gripsight_vehicle::VehicleParameters;

use crate::data::for_diagnosis;

/// Name of the file.
const FILE: &str = "posterior.json";

/// Fits the car's own tires and writes them; a drive that cannot tell them leaves no file.
pub(super) fn write(
    out: &Path,
    vehicle: &VehicleParameters,
    sequence: &StateSequence,
    result: &Outcome,
) -> anyhow::Result<Option<PathBuf>> {
    let path = out.join(FILE);
    let (usable, _) = for_diagnosis(sequence, vehicle)?;
    // A set that may be used is near the car's own tires.
    let start = result.accepted.then_some(result.phi_p);
    match own_tires(&usable, vehicle, start, (result.status.name(), &result.key.vehicle_hash)) {
        Ok(posterior) => {
            fs::write(&path, serde_json::to_string_pretty(&posterior)? + "\n")
                .with_context(|| format!("cannot write {}", path.display()))?;
            Ok(Some(path))
        }
        Err(error) => {
            tracing::warn!("no {FILE}: {error}");
            super::remove_old(&path)?;
            Ok(None)
        }
    }
}
