//! An earlier identification.json, as where to start.

use std::path::Path;

use anyhow::{Context, bail};
use gripsight_identification::export::{checked_tires, read_text};
use gripsight_identification::{
    AcceptedSet, Nuisance, PerAxle, RunKey, SignalCorrections, Status, ValidWithin,
};
use gripsight_vehicle::PacejkaParameters;
use serde::Deserialize;

/// What became of it.
#[derive(Deserialize)]
struct Verdict {
    status: Status,
}

/// The part of identification.json that a later run needs.
#[derive(Deserialize)]
struct Earlier {
    status: Status,
    phi_p: PacejkaParameters,
    found: PacejkaParameters,
    valid_within: ValidWithin,
    signals: SignalCorrections,
    nuisance: Nuisance,
    /// Not in files of before.
    fitted: Option<PacejkaParameters>,
    peak_friction: PerAxle<Peak>,
    rmse: Errors,
    key: RunKey,
}

#[derive(Deserialize)]
struct Peak {
    reached: bool,
}

#[derive(Deserialize)]
struct Errors {
    rollout: Rollout,
}

#[derive(Deserialize)]
struct Rollout {
    v_y_mps: Change,
    yaw_rate_radps: Change,
}

#[derive(Deserialize)]
struct Change {
    after: f64,
}

/// Reads an accepted set.
pub(crate) fn read(path: &Path) -> anyhow::Result<AcceptedSet> {
    let text = read_text(path).with_context(|| format!("cannot read {}", path.display()))?;
    let not_one = || format!("{} is not an identification.json", path.display());
    // What was not accepted has no limits to read.
    let verdict: Verdict = serde_json::from_str(&text).with_context(not_one)?;
    if !verdict.status.accepted() {
        bail!("{}: that identification was not accepted", path.display());
    }
    let earlier: Earlier = serde_json::from_str(&text).with_context(not_one)?;
    let tires = |set| checked_tires(set).with_context(|| format!("cannot use {}", path.display()));
    let (fitted, nuisance) = match earlier.fitted {
        Some(fitted) => (fitted, earlier.nuisance),
        None => (earlier.found, Nuisance { combined_slip: 0.0, ..earlier.nuisance }),
    };
    Ok(AcceptedSet {
        vehicle_hash: earlier.key.vehicle_hash,
        sequence_id: earlier.key.sequence_id,
        phi_p: tires(earlier.found)?,
        promised: tires(earlier.phi_p)?,
        status: earlier.status,
        valid_within: earlier.valid_within,
        corrections: earlier.signals,
        fitted: tires(fitted)?,
        nuisance,
        rollout_rmse: [earlier.rmse.rollout.v_y_mps.after, earlier.rmse.rollout.yaw_rate_radps.after],
        peak_reached: earlier.peak_friction.map(|p| p.reached),
    })
}
