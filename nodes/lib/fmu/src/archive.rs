//! The unit's file.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::Path;

use gripsight_model::CarFile;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::description::{IDENTIFIER, description};
use crate::{FmuError, Version};

/// File name of the shared object, as it is built.
pub const LIBRARY: &str = "libgripsight_fmu.so";
/// The car among the resources.
pub(crate) const CAR: &str = "car.json";

/// Writes a unit: the description, the car, and the shared object `library`. The same for the same input.
///
/// # Errors
/// [`FmuError::Io`] and [`FmuError::Archive`] where a file cannot be read or written; else as for [`CarFile::driven`].
pub fn write(path: &Path, version: Version, car: &CarFile, library: &Path) -> Result<(), FmuError> {
    let text = serde_json::to_string_pretty(car)? + "\n";
    let description = description(version, &car.driven()?, &text)?;
    let library = fs::read(library).map_err(FmuError::io(library))?;
    let binary = format!("binaries/{}/{IDENTIFIER}.so", version.platform());
    // Written beside it and renamed: nobody loads half a unit.
    let beside = path.with_extension("part");
    let file = File::create(&beside).map_err(FmuError::io(&beside))?;
    let mut archive = ZipWriter::new(file);
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    for (name, bytes) in [
        ("modelDescription.xml", description.as_bytes()),
        (&format!("resources/{CAR}"), text.as_bytes()),
        (&binary, &library),
    ] {
        archive.start_file(name, options)?;
        archive.write_all(bytes).map_err(FmuError::io(path))?;
    }
    archive.finish()?;
    fs::rename(&beside, path).map_err(FmuError::io(path))
}
