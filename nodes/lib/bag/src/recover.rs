//! Rewrites what is left of a damaged bag.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::bag::{Messages, check_profile};
use crate::storage::{Kind, source};
use crate::writer::part_of;
use crate::{BagError, BagWriter, rosbag2};

/// What [`recover`] found.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Recovered {
    /// Messages rewritten.
    pub messages: u64,
    /// Where a file ended early or was damaged, one line each; empty for a whole bag.
    pub damage: Vec<String>,
}

/// Rewrites a bag to `out`: of each of its files every message before the first place that is cut off or damaged, with its bytes,
/// times, topic and schema.
///
/// # Errors
/// [`BagError::NotABag`], [`BagError::Profile`], [`BagError::Empty`] where no message is whole; [`BagError::Write`],
/// [`BagError::Io`].
pub fn recover(bag: &Path, out: &Path) -> Result<Recovered, BagError> {
    let files = rosbag2::files(bag)?;
    refuse_overwriting(bag, out)?;
    let mut writer = None;
    let mut recovered = Recovered::default();
    for file in files {
        match copy_whole(&file, out, &mut writer, &mut recovered.messages) {
            Err(
                error
                @ (BagError::Truncated { .. } | BagError::Damaged { .. } | BagError::Compression { .. }),
            ) => recovered.damage.push(error.to_string()),
            other => other?,
        }
    }
    match writer {
        Some(writer) => writer.finish().map(|()| recovered),
        None => Err(BagError::Empty { path: bag.to_owned() }),
    }
}

/// Copies a file's messages up to the first that is not whole; the writer is made for the first message.
fn copy_whole(
    file: &Path,
    out: &Path,
    writer: &mut Option<BagWriter>,
    messages: &mut u64,
) -> Result<(), BagError> {
    let source = source(file)?;
    if source.kind == Kind::Mcap {
        check_profile(&source.path)?;
    }
    for message in Messages::of([source]) {
        let message = message?;
        let writer = match writer {
            Some(writer) => writer,
            None => writer.insert(BagWriter::create(out)?),
        };
        writer.copy(&message)?;
        *messages += 1;
    }
    Ok(())
}

/// Refuses to write a file where a bag that is read lies, by whatever path or link: the file itself, or one of a folder's.
///
/// # Errors
/// [`BagError::Write`]; [`BagError::NotABag`], [`BagError::Io`] where `bag` is none.
pub fn refuse_overwriting(bag: &Path, out: &Path) -> Result<(), BagError> {
    let files = rosbag2::files(bag)?;
    // A bag is written under another name at first.
    for written in [out.to_owned(), part_of(out)] {
        let canonical = written.canonicalize().ok();
        let same =
            files.iter().map(PathBuf::as_path).chain([bag]).any(|p| p.canonicalize().ok() == canonical);
        if canonical.is_some() && same {
            return Err(BagError::Write {
                path: out.to_owned(),
                why: format!("is {} itself", bag.display()),
            });
        }
    }
    Ok(())
}
