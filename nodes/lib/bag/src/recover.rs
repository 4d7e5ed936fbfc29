//! Rewrites what is left of a damaged bag.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::bag::{Messages, check_profile};
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
    refuse_same(&files, bag, out)?;
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
    check_profile(file)?;
    for message in Messages::of([file.to_owned()]) {
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

/// A bag is not written over itself.
pub(crate) fn refuse_same(files: &[PathBuf], bag: &Path, out: &Path) -> Result<(), BagError> {
    let canonical = out.canonicalize().ok();
    let same = canonical.is_some()
        && files.iter().map(PathBuf::as_path).chain([bag]).any(|p| p.canonicalize().ok() == canonical);
    if same {
        return Err(BagError::Write { path: out.to_owned(), why: "is the bag itself".to_owned() });
    }
    Ok(())
}
