//! The report's files: gap.json and report.html, one folder a sequence.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;
use gripsight_diagnosis::Diagnosis;
use gripsight_report::{Before, GapInput, Header, gap_page};

/// Folder of the comparison with the first sequence, within that of a sequence.
const SINCE_FIRST: &str = "since_first";

/// Writes the files, and those of the sequence compared with the first one; gives their folder.
pub(crate) fn write(
    folder: &Path,
    diagnosis: &Diagnosis,
    since: Option<&Diagnosis>,
    header: &Header,
    sequence_id: u64,
) -> anyhow::Result<PathBuf> {
    let place = folder.join(sequence_id.to_string());
    write_one(&place, diagnosis, None, header)?;
    if let Some(since) = since {
        write_one(&place.join(SINCE_FIRST), since, Some(Before::Drive("the first sequence")), header)?;
    }
    Ok(place)
}

fn write_one(
    place: &Path,
    diagnosis: &Diagnosis,
    before: Option<Before<'_>>,
    header: &Header,
) -> anyhow::Result<()> {
    fs::create_dir_all(place).with_context(|| format!("folder {}", place.display()))?;
    let page = gap_page(&GapInput { diagnosis, header, before, topics: &[], data_notes: &[] })?;
    for (name, text) in [("gap.json", serde_json::to_string_pretty(diagnosis)?), ("report.html", page)] {
        let path = place.join(name);
        fs::write(&path, text).with_context(|| format!("file {}", path.display()))?;
    }
    Ok(())
}
