//! The report's files: gap.json and report.html, one folder a sequence.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;
use gripsight_diagnosis::Diagnosis;
use gripsight_report::{GapInput, Header, gap_page};

/// Writes the files; gives their folder.
pub(crate) fn write(
    folder: &Path,
    diagnosis: &Diagnosis,
    header: &Header,
    sequence_id: u64,
) -> anyhow::Result<PathBuf> {
    let place = folder.join(sequence_id.to_string());
    fs::create_dir_all(&place).with_context(|| format!("folder {}", place.display()))?;
    let page = gap_page(&GapInput { diagnosis, header, before: None, topics: &[], data_notes: &[] })?;
    for (name, text) in [("gap.json", serde_json::to_string_pretty(diagnosis)?), ("report.html", page)] {
        let path = place.join(name);
        fs::write(&path, text).with_context(|| format!("file {}", path.display()))?;
    }
    Ok(place)
}
