//! The files of a bag as they can be read: MCAP or sqlite3, unpacked where rosbag2 compressed whole files.

use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tempfile::TempDir;

use crate::BagError;
use crate::sqlite::{MAGIC as SQLITE_MAGIC, ZSTD_MAGIC};

/// How a ROS 1 bag begins.
const ROS1_MAGIC: &[u8] = b"#ROSBAG";

/// No recording is packed tighter; a file that is made to fill the disk is.
const MOST_PACKED: u64 = 1000;
/// Topics files and rosbag2's `metadata.yaml` are no longer (bytes).
const MOST_TEXT: u64 = 16 << 20;

/// A file's text.
pub(crate) fn read_text(path: &Path) -> std::io::Result<String> {
    let mut text = String::new();
    // What is no plain file does not tell its length.
    if File::open(path)?.take(MOST_TEXT + 1).read_to_string(&mut text)? as u64 > MOST_TEXT {
        let error = format!("larger than {} MiB", MOST_TEXT >> 20);
        return Err(std::io::Error::new(std::io::ErrorKind::FileTooLarge, error));
    }
    Ok(text)
}

/// What a file holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Mcap,
    Sqlite,
}

/// A file to be read.
#[derive(Debug, Clone)]
pub(crate) struct Source {
    pub(crate) path: PathBuf,
    pub(crate) kind: Kind,
    /// Where the bag lies; `.msg` texts may lie beside it.
    pub(crate) beside: PathBuf,
    /// Keeps what was unpacked.
    _unpacked: Option<Arc<TempDir>>,
}

/// Looks at a file, and unpacks it onto the disk where it is compressed as a whole.
pub(crate) fn source(file: &Path) -> Result<Source, BagError> {
    let beside = file.parent().unwrap_or(Path::new("")).to_owned();
    let begin = begin(file)?;
    if !begin.starts_with(&ZSTD_MAGIC) {
        return Ok(Source { path: file.to_owned(), kind: kind(file, &begin)?, beside, _unpacked: None });
    }
    let folder = tempfile::tempdir().map_err(BagError::io(file))?;
    let path = folder.path().join(file.file_stem().unwrap_or_default());
    let mut packed = BufReader::new(File::open(file).map_err(BagError::io(file))?);
    let mut plain = File::create(&path).map_err(BagError::io(&path))?;
    let most = packed.get_ref().metadata().map_err(BagError::io(file))?.len() * MOST_PACKED;
    let unpacking = zstd::Decoder::with_buffer(&mut packed).map_err(BagError::io(file))?;
    if std::io::copy(&mut unpacking.take(most + 1), &mut plain).map_err(BagError::io(file))? > most {
        let why = format!("unpacked it is more than {MOST_PACKED} times as long");
        return Err(BagError::NotABag { path: file.to_owned(), why });
    }
    let kind = kind(file, &self::begin(&path)?)?;
    Ok(Source { path, kind, beside, _unpacked: Some(Arc::new(folder)) })
}

fn begin(file: &Path) -> Result<Vec<u8>, BagError> {
    let mut bytes = Vec::new();
    let opened = File::open(file).map_err(BagError::io(file))?;
    opened.take(SQLITE_MAGIC.len() as u64).read_to_end(&mut bytes).map_err(BagError::io(file))?;
    Ok(bytes)
}

fn kind(file: &Path, begin: &[u8]) -> Result<Kind, BagError> {
    if begin.starts_with(SQLITE_MAGIC) {
        return Ok(Kind::Sqlite);
    }
    if begin.starts_with(ROS1_MAGIC) {
        return Err(BagError::Ros1 { path: file.to_owned() });
    }
    // What is neither, the MCAP reader refuses with its reason.
    Ok(Kind::Mcap)
}
