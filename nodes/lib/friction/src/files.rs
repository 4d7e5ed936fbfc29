//! Where the ONNX Runtime library and the model are looked for, and how much of a file is read.

use std::fs::File;
use std::io::{Error, ErrorKind, Read as _};
use std::path::{Path, PathBuf};

use crate::error::FrictionError;

/// The library's file names: the plain one, and the versioned one that a bare wheel unpacks to.
const LIBRARY: &str = "libonnxruntime.so";
/// The trained network's file name, and that of the embedding.
const MODEL: &str = "road_mobilenet_v3_small.onnx";
const EMBEDDING: &str = "embedding_efficientnet_lite0.onnx";

/// The ONNX Runtime library: `explicit`, else beside the program, else `.deps/onnxruntime` in any folder above it.
///
/// `program_folder` is the folder of the running program.
///
/// # Errors
/// [`FrictionError::NotFound`] with the places looked at.
pub fn find_library(explicit: Option<&Path>, program_folder: &Path) -> Result<PathBuf, FrictionError> {
    let beside = [program_folder.join(LIBRARY)];
    let above = program_folder.ancestors().map(|a| a.join(".deps/onnxruntime").join(LIBRARY));
    find("ONNX Runtime library", explicit, beside.into_iter().chain(above))
}

/// The model: `explicit`, else beside the program, else in the installed share folder or the source tree above it.
///
/// # Errors
/// [`FrictionError::NotFound`] with the places looked at.
pub fn find_model(explicit: Option<&Path>, program_folder: &Path) -> Result<PathBuf, FrictionError> {
    find("model", explicit, places_of(MODEL, program_folder))
}

/// The embedding: beside the model in use, else where a model is looked for.
///
/// # Errors
/// [`FrictionError::NotFound`] with the places looked at.
pub fn find_embedding(model: &Path, program_folder: &Path) -> Result<PathBuf, FrictionError> {
    let beside = [model.with_file_name(EMBEDDING)];
    find("embedding model", None, beside.into_iter().chain(places_of(EMBEDDING, program_folder)))
}

fn places_of<'a>(file: &'a str, program_folder: &'a Path) -> impl Iterator<Item = PathBuf> + 'a {
    let beside = [program_folder.join(file)];
    let above = program_folder.ancestors().flat_map(move |a| {
        ["share/gripsight_camera_prior/model", "nodes/camera_prior/model"]
            .map(|place| a.join(place).join(file))
    });
    beside.into_iter().chain(above)
}

/// No picture, basis or calibration is larger (bytes).
const MOST_BYTES: u64 = 64 << 20;

/// A picture's bytes.
///
/// # Errors
/// [`FrictionError::Read`], also of more than 64 MiB, which are not read.
pub fn read_picture(path: &Path) -> Result<Vec<u8>, FrictionError> {
    read(path).map_err(|source| FrictionError::Read { path: path.to_path_buf(), source })
}

/// The text of a basis or a calibration.
pub(crate) fn read_text(path: &Path) -> Result<String, FrictionError> {
    let text = read(path).and_then(|bytes| {
        String::from_utf8(bytes).map_err(|error| Error::new(ErrorKind::InvalidData, error))
    });
    text.map_err(|source| FrictionError::Read { path: path.to_path_buf(), source })
}

fn read(path: &Path) -> Result<Vec<u8>, Error> {
    let file = File::open(path)?;
    within(file.metadata()?.len(), MOST_BYTES)?;
    let mut bytes = Vec::new();
    // What is no plain file does not tell its length.
    file.take(MOST_BYTES + 1).read_to_end(&mut bytes)?;
    within(bytes.len() as u64, MOST_BYTES)?;
    Ok(bytes)
}

/// Refuses a file that is too large.
pub(crate) fn within(length: u64, most: u64) -> Result<(), Error> {
    if length <= most {
        return Ok(());
    }
    Err(Error::new(ErrorKind::FileTooLarge, format!("it is larger than {} MiB", most >> 20)))
}

fn find(
    name: &'static str,
    explicit: Option<&Path>,
    places: impl Iterator<Item = PathBuf>,
) -> Result<PathBuf, FrictionError> {
    let searched: Vec<PathBuf> = match explicit {
        Some(path) => vec![path.to_path_buf()],
        None => places.collect(),
    };
    match searched.iter().find(|p| p.is_file()) {
        Some(path) => Ok(path.clone()),
        None => Err(FrictionError::NotFound { name, searched }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_library_is_found_in_an_ancestor_and_an_explicit_path_is_final() {
        let root = tempfile::tempdir().unwrap();
        let deps = root.path().join(".deps/onnxruntime");
        let program = root.path().join("target/debug");
        std::fs::create_dir_all(&deps).unwrap();
        std::fs::create_dir_all(&program).unwrap();
        std::fs::write(deps.join(LIBRARY), b"x").unwrap();
        assert_eq!(find_library(None, &program).unwrap(), deps.join(LIBRARY));
        std::fs::write(program.join(LIBRARY), b"x").unwrap();
        assert_eq!(find_library(None, &program).unwrap(), program.join(LIBRARY));
        let missing = root.path().join("nowhere.so");
        let text = find_library(Some(&missing), &program).unwrap_err().to_string();
        assert!(text.contains("nowhere.so"), "{text}");
    }
}
