//! The set that the MPC was told last, on disk: a node that was killed comes back with what it knew.

use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use gripsight_identification::export::{ExportError, replace_file};
use gripsight_msgs::PacejkaParams;
use serde::{Deserialize, Serialize};

/// The file's text; YAML, because it has numbers that are none (what is not stated, and no limit).
#[derive(Debug, Serialize, Deserialize)]
struct Kept {
    /// When the set was accepted, by the machine's clock: it outlives the process, unlike `/clock`.
    accepted_unix_s: u64,
    set: PacejkaParams,
}

/// Why what is on disk is not used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum MemoryError {
    #[error("{path}: {reason}")]
    Unusable { path: PathBuf, reason: String },
    #[error(transparent)]
    File(#[from] ExportError),
}

/// Keeps what the MPC is told: a set for use, until it is withdrawn.
///
/// # Errors
/// [`MemoryError`] when the folder cannot be written to.
pub(crate) fn keep(folder: &Path, set: &PacejkaParams, now: SystemTime) -> Result<(), MemoryError> {
    let place = place(folder, &set.handshake.vehicle_hash);
    let unusable = |reason: String| MemoryError::Unusable { path: place.clone(), reason };
    match set.status {
        PacejkaParams::ACCEPTED | PacejkaParams::ACCEPTED_WITHIN | PacejkaParams::PROVISIONAL => {
            let accepted_unix_s = now.duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
            let kept = Kept { accepted_unix_s, set: set.clone() };
            let text = serde_saphyr::to_string(&kept).map_err(|error| unusable(error.to_string()))?;
            std::fs::create_dir_all(folder).map_err(|error| unusable(error.to_string()))?;
            Ok(replace_file(&place, text.as_bytes())?)
        }
        PacejkaParams::WITHDRAWN => match std::fs::remove_file(&place) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(unusable(error.to_string())),
            _ => Ok(()),
        },
        _ => Ok(()),
    }
}

/// The set that was kept for this car, as PROVISIONAL, its age in the reason; none where nothing was kept.
///
/// # Errors
/// [`MemoryError`] when the file cannot be read, or is not of this car.
pub(crate) fn recall(
    folder: &Path,
    vehicle_hash: &str,
    now: SystemTime,
) -> Result<Option<PacejkaParams>, MemoryError> {
    let path = place(folder, vehicle_hash);
    let unusable = |reason: String| MemoryError::Unusable { path: path.clone(), reason };
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(unusable(error.to_string())),
    };
    let kept: Kept = serde_saphyr::from_str(&text).map_err(|error| unusable(error.to_string()))?;
    let mut set = kept.set;
    if set.handshake.vehicle_hash != vehicle_hash {
        return Err(unusable("it is of another car".to_owned()));
    }
    let curves = [set.front, set.rear];
    if !curves.iter().all(|f| [f.b, f.c, f.d, f.e].iter().all(|number| number.is_finite())) {
        return Err(unusable("its curves are not finite".to_owned()));
    }
    let accepted = UNIX_EPOCH + Duration::from_secs(kept.accepted_unix_s);
    let age_s = now.duration_since(accepted).unwrap_or_default().as_secs();
    set.status = PacejkaParams::PROVISIONAL;
    let before = if set.reason.is_empty() { String::new() } else { format!("; {}", set.reason) };
    set.reason = format!("from disk: accepted {age_s} s ago, before this start{before}");
    Ok(Some(set))
}

fn place(folder: &Path, vehicle_hash: &str) -> PathBuf {
    folder.join(format!("last_set_{vehicle_hash}.yaml"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn accepted() -> PacejkaParams {
        let mut set = PacejkaParams { status: PacejkaParams::ACCEPTED_WITHIN, ..PacejkaParams::default() };
        set.handshake.vehicle_hash = "c0ffee".into();
        set.reason = "peak not reached".into();
        (set.front.b, set.front.d, set.rear.e) = (0.1 + 0.2, 1e-300, -7.25);
        (set.front_valid_slip_rad, set.rear_valid_slip_rad) = (f64::NAN, f64::INFINITY);
        set
    }

    #[test]
    fn what_was_accepted_comes_back_as_provisional_with_its_age() {
        let folder = tempfile::tempdir().unwrap();
        let now = SystemTime::now();
        let folder = folder.path().join("not there yet");
        assert!(recall(&folder, "c0ffee", now).unwrap().is_none());
        keep(&folder, &accepted(), now).unwrap();
        let back = recall(&folder, "c0ffee", now + Duration::from_secs(75)).unwrap().unwrap();
        assert_eq!(back.status, PacejkaParams::PROVISIONAL);
        assert!(["75 s ago", "76 s ago"].iter().any(|age| back.reason.contains(age)), "{}", back.reason);
        assert!(back.reason.ends_with("peak not reached"));
        assert_eq!((back.front, back.rear), (accepted().front, accepted().rear));
        assert!(back.front_valid_slip_rad.is_nan() && back.rear_valid_slip_rad.is_infinite());
        assert!(recall(&folder, "another", now).unwrap().is_none());
    }

    #[test]
    fn what_was_withdrawn_does_not_come_back_and_a_rejected_set_changes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let now = SystemTime::now();
        let with = |status| PacejkaParams { status, ..accepted() };
        keep(folder.path(), &accepted(), now).unwrap();
        keep(folder.path(), &with(PacejkaParams::REJECTED), now).unwrap();
        assert!(recall(folder.path(), "c0ffee", now).unwrap().is_some());
        keep(folder.path(), &with(PacejkaParams::WITHDRAWN), now).unwrap();
        assert!(recall(folder.path(), "c0ffee", now).unwrap().is_none());
        keep(folder.path(), &with(PacejkaParams::WITHDRAWN), now).unwrap();
    }

    /// A file cut off anywhere, as by a full disk, is refused or whole: it never gives other tires.
    #[test]
    fn a_damaged_file_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let now = SystemTime::now();
        keep(folder.path(), &accepted(), now).unwrap();
        let path = place(folder.path(), "c0ffee");
        let text = std::fs::read(&path).unwrap();
        let mut refused = 0;
        for length in (0..text.len()).step_by(7) {
            std::fs::write(&path, &text[..length]).unwrap();
            match recall(folder.path(), "c0ffee", now) {
                Err(_) => refused += 1,
                Ok(set) => assert_eq!(set.unwrap().front, accepted().front),
            }
        }
        assert!(refused > text.len() / 7 / 2, "{refused}");
    }
}
