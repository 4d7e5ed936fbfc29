//! The labels of a batch in the making, so that it can be stopped and taken up again.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use rand::TryRng as _;
use rand::rngs::SysRng;
use serde::{Deserialize, Serialize};

use crate::WithheldError;
use crate::batch::BatchSettings;
use crate::label::{CaseLabel, hex};

/// Labels so far, a line each, in a file beside the label file.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
    nonce: String,
    done: BTreeMap<String, CaseLabel>,
}

#[derive(Serialize, Deserialize)]
struct Head {
    nonce: String,
    settings: BatchSettings,
}

impl Journal {
    /// Begins a batch, or takes it up where it was left. Without a seed given, that of the batch left is taken, or a new one from
    /// the system's random source.
    ///
    /// # Errors
    /// [`WithheldError::OtherBatch`] where the file is that of another batch; [`WithheldError::Io`].
    pub fn open(
        labels: &Path,
        seed: Option<u64>,
        settings: impl FnOnce(u64) -> BatchSettings,
    ) -> Result<(Self, BatchSettings), WithheldError> {
        let path = labels.with_extension("part.jsonl");
        if path.exists() {
            let text = fs::read_to_string(&path).map_err(WithheldError::io(&path))?;
            let mut lines = text.lines();
            let head: Head = serde_json::from_str(lines.next().unwrap_or_default())
                .map_err(|e| WithheldError::content(&path, &e))?;
            let asked = settings(seed.unwrap_or(head.settings.seed));
            if asked != head.settings {
                let found = serde_json::to_string(&head.settings).unwrap_or_default();
                return Err(WithheldError::OtherBatch { path, found });
            }
            // A line that was cut off is a case that is made again.
            let labels = lines.filter_map(|line| serde_json::from_str::<CaseLabel>(line).ok());
            let done = labels.map(|label| (label.case.clone(), label)).collect();
            let mut file = OpenOptions::new().append(true).open(&path).map_err(WithheldError::io(&path))?;
            file.write_all(b"\n").map_err(WithheldError::io(&path))?;
            return Ok((Self { path, file, nonce: head.nonce, done }, asked));
        }
        let settings = settings(match seed {
            Some(seed) => seed,
            None => u64::from_le_bytes(random_bytes(&path)?),
        });
        let head = Head { nonce: hex(&random_bytes::<32>(&path)?), settings: settings.clone() };
        let mut file = File::create(&path).map_err(WithheldError::io(&path))?;
        let line = serde_json::to_string(&head).map_err(|e| WithheldError::content(&path, &e))?;
        writeln!(file, "{line}").map_err(WithheldError::io(&path))?;
        Ok((Self { path, file, nonce: head.nonce, done: BTreeMap::new() }, settings))
    }

    /// The label of a case that is made.
    #[must_use]
    pub fn label(&self, case: &str) -> Option<&CaseLabel> {
        self.done.get(case)
    }

    /// Notes a case.
    ///
    /// # Errors
    /// [`WithheldError::Io`].
    pub fn note(&mut self, label: CaseLabel) -> Result<(), WithheldError> {
        let line = serde_json::to_string(&label).map_err(|e| WithheldError::content(&self.path, &e))?;
        writeln!(self.file, "{line}").map_err(WithheldError::io(&self.path))?;
        self.done.insert(label.case.clone(), label);
        Ok(())
    }

    /// The nonce and all labels in the order of the cases.
    #[must_use]
    pub fn content(&self) -> (String, Vec<CaseLabel>) {
        (self.nonce.clone(), self.done.values().cloned().collect())
    }

    /// Removes the file: the labels are sealed.
    ///
    /// # Errors
    /// [`WithheldError::Io`].
    pub fn close(self) -> Result<(), WithheldError> {
        fs::remove_file(&self.path).map_err(WithheldError::io(&self.path))
    }
}

fn random_bytes<const N: usize>(path: &Path) -> Result<[u8; N], WithheldError> {
    let mut bytes = [0; N];
    SysRng.try_fill_bytes(&mut bytes).map_err(|e| WithheldError::content(path, &e))?;
    Ok(bytes)
}
