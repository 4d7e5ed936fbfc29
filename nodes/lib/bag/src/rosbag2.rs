//! The rosbag2 folder: `metadata.yaml` and the files that it names.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::BagError;

/// What is read of `metadata.yaml`; the rest is left alone.
#[derive(Deserialize)]
struct MetadataFile {
    rosbag2_bagfile_information: Information,
}

#[derive(Deserialize)]
struct Information {
    storage_identifier: String,
    relative_file_paths: Vec<String>,
    #[serde(default)]
    compression_format: String,
    #[serde(default)]
    compression_mode: String,
}

/// The MCAP files of a bag in order: the file itself; what a folder's `metadata.yaml` names; or, where a recording was killed
/// before that was written, the folder's `.mcap` files by number.
pub(crate) fn files(path: &Path) -> Result<Vec<PathBuf>, BagError> {
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let refuse = |why: String| BagError::NotABag { path: path.to_owned(), why };
    let metadata = path.join("metadata.yaml");
    if !metadata.is_file() {
        let files = mcap_files(path)?;
        return if files.is_empty() {
            Err(refuse("a folder with neither metadata.yaml nor .mcap files".to_owned()))
        } else {
            Ok(files)
        };
    }
    let text = std::fs::read_to_string(&metadata).map_err(BagError::io(&metadata))?;
    let MetadataFile { rosbag2_bagfile_information: information } =
        serde_saphyr::from_str(&text).map_err(|e| refuse(format!("metadata.yaml: {e}")))?;
    if information.storage_identifier != "mcap" {
        return Err(refuse(format!(
            "storage `{}`, expected `mcap`; `ros2 bag convert` makes one of the other",
            information.storage_identifier
        )));
    }
    if !information.compression_mode.is_empty() && !information.compression_mode.eq_ignore_ascii_case("none")
    {
        return Err(refuse(format!(
            "compressed by rosbag2 (mode `{}`, format `{}`); MCAP's own compression is read: `ros2 bag convert`",
            information.compression_mode, information.compression_format
        )));
    }
    if information.relative_file_paths.is_empty() {
        return Err(refuse("metadata.yaml names no file".to_owned()));
    }
    Ok(information.relative_file_paths.iter().map(|name| path.join(name)).collect())
}

/// The `.mcap` files in a folder, ordered by the number at the end of their names (`bag_2` before `bag_10`).
fn mcap_files(folder: &Path) -> Result<Vec<PathBuf>, BagError> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(BagError::io(folder))? {
        let path = entry.map_err(BagError::io(folder))?.path();
        if path.extension().is_some_and(|e| e == "mcap") {
            files.push(path);
        }
    }
    files.sort_by_key(|path| {
        let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let number = stem.rsplit('_').next().and_then(|n| n.parse::<u64>().ok());
        (number, stem)
    });
    Ok(files)
}
