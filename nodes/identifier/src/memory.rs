//! The set that the MPC was told last, on disk: a node that was killed comes back with what it knew.

use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use gripsight_identification::export::{ExportError, read_text, replace_file};
use gripsight_msgs::PacejkaParams;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// The file's text below its first line, which tells the text's hash: a number that a disk or a hand has changed promises another grip.
/// YAML, because it has numbers that are none (what is not stated, and no limit).
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
            let text = format!("# {}\n{text}", sha256(&text));
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
    let text = match read_text(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(unusable(error.to_string())),
    };
    let (hash, text) = text.split_once('\n').unwrap_or_default();
    if hash.strip_prefix("# ") != Some(sha256(text).as_str()) {
        return Err(unusable("it is not as it was written".to_owned()));
    }
    let kept: Kept = serde_saphyr::from_str(text).map_err(|error| unusable(error.to_string()))?;
    let mut set = kept.set;
    if set.handshake.vehicle_hash != vehicle_hash {
        return Err(unusable("it is of another car".to_owned()));
    }
    let curves = [set.front, set.rear];
    if !curves.iter().all(|f| [f.b, f.c, f.d, f.e].iter().all(|number| number.is_finite())) {
        return Err(unusable("its curves are not finite".to_owned()));
    }
    let now_unix_s = now.duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
    let age = match now_unix_s.checked_sub(kept.accepted_unix_s) {
        Some(age_s) => format!("accepted {age_s} s ago, before this start"),
        None => "accepted before this start, by a clock that has gone back since".to_owned(),
    };
    set.status = PacejkaParams::PROVISIONAL;
    let before = if set.reason.is_empty() { String::new() } else { format!("; {}", set.reason) };
    set.reason = format!("from disk: {age}{before}");
    Ok(Some(set))
}

fn sha256(text: &str) -> String {
    Sha256::digest(text).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn place(folder: &Path, vehicle_hash: &str) -> PathBuf {
    folder.join(format!("last_set_{vehicle_hash}.yaml"))
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use gripsight_mutants::{Mutants, bombs, peak_memory_mb};

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

    /// Whatever has become of the file, it gives the set that was kept or none, and the error names it.
    #[test]
    fn a_mutated_file_never_gives_another_set() {
        let folder = tempfile::tempdir().unwrap();
        let now = SystemTime::now();
        keep(folder.path(), &accepted(), now).unwrap();
        let path = place(folder.path(), "c0ffee");
        let text = std::fs::read_to_string(&path).unwrap();
        let (mut mutants, mut refused) = (Mutants::new(0x5eed), 0);
        let count = Mutants::count(4000);
        let mutated = (0..count).map(|_| mutants.text(&text)).collect::<Vec<_>>();
        let cut = (0..text.len()).map(|length| text[..length].to_owned());
        for mutant in mutated.into_iter().chain(cut).chain(bombs()) {
            std::fs::write(&path, &mutant).unwrap();
            match recall(folder.path(), "c0ffee", now) {
                Err(error) => {
                    refused += 1;
                    assert!(error.to_string().contains("last_set_c0ffee.yaml"), "{error}");
                }
                Ok(set) => {
                    assert_eq!(mutant, text);
                    assert_eq!(set.unwrap().front, accepted().front);
                }
            }
        }
        assert!(refused > count * 9 / 10, "{refused}");
        assert!(peak_memory_mb().is_none_or(|peak_mb| peak_mb < 200.0), "{:?}", peak_memory_mb());
    }

    /// Whoever writes the hash, too, gets a refusal for what is no set, and no node dies of it.
    #[test]
    fn a_file_made_to_fit_is_answered() {
        let folder = tempfile::tempdir().unwrap();
        let now = SystemTime::now();
        keep(folder.path(), &accepted(), now).unwrap();
        let path = place(folder.path(), "c0ffee");
        let text = std::fs::read_to_string(&path).unwrap();
        let (_, text) = text.split_once('\n').unwrap();
        let recall = |text: &str| {
            std::fs::write(&path, format!("# {}\n{text}", sha256(text))).unwrap();
            recall(folder.path(), "c0ffee", now)
        };
        let mut mutants = Mutants::new(0xfeed);
        for _ in 0..Mutants::count(4000) {
            if let Ok(set) = recall(&mutants.text(text)) {
                assert!(set.unwrap().front.b.is_finite());
            }
        }
        for bomb in bombs() {
            assert!(recall(&bomb).is_err());
        }
        let at = text.lines().next().unwrap();
        let later =
            recall(&text.replacen(at, &format!("accepted_unix_s: {}", u64::MAX), 1)).unwrap().unwrap();
        assert!(later.reason.contains("a clock that has gone back"), "{}", later.reason);
        assert!(peak_memory_mb().is_none_or(|peak_mb| peak_mb < 200.0), "{:?}", peak_memory_mb());
    }

    #[test]
    fn a_file_without_end_is_not_read_to_its_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = place(folder.path(), "c0ffee");
        std::fs::File::create(&path).unwrap().set_len(1 << 40).unwrap();
        let error = recall(folder.path(), "c0ffee", SystemTime::now()).unwrap_err().to_string();
        assert!(error.contains("last_set_c0ffee.yaml") && error.contains("larger than"), "{error}");
    }
}
