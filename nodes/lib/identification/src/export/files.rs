//! Writing the files: never half, and never a bad set over a good one.

use std::ffi::OsString;
use std::fs;
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use gripsight_vehicle::{PacejkaParameters, VehicleParameters};

use super::tires::STAMP_COMMENT;
use super::{ExportError, Provenance, SteeringLookup, controller_txt, mpc_yaml};
use crate::Status;

/// All that is written for other stacks of one identification.
#[derive(Debug, Clone, Copy)]
pub struct TireFiles<'a> {
    /// The tires.
    pub tires: &'a PacejkaParameters,
    /// The car that they belong to.
    pub vehicle: &'a VehicleParameters,
    /// Where they come from.
    pub provenance: &'a Provenance,
    /// Name of the surface.
    pub floor: &'a str,
    /// Highest speed driven: how far the lookup table of a large car reaches.
    pub driven_mps: f64,
}

impl TireFiles<'_> {
    /// Writes `pacejka.yaml`, `<car>_pacejka.txt` and `<car>_lookup_table.csv` into a folder.
    ///
    /// Each file is written beside its place and renamed. A set that is replaced stays beside the new one, its name dated by the
    /// stamp of its own data (`pacejka.20231114T221314Z.yaml`). A set that was not accepted goes to `pacejka.rejected.yaml` and the
    /// like, a provisional one to `pacejka.provisional.yaml`, and what controllers read stays as it was. Which of them, the provenance's status says.
    /// Any other but a provisional set removes a provisional one that is there: write that after it.
    ///
    /// Returns the files in the order above.
    ///
    /// # Errors
    /// [`ExportError::Io`].
    pub fn write(&self, folder: &Path) -> Result<[PathBuf; 3], ExportError> {
        let car = file_name(&self.provenance.car);
        let lookup = SteeringLookup::new(self.vehicle, self.tires, self.driven_mps).to_csv();
        let mpc = mpc_yaml(self.tires, self.floor, self.provenance);
        let controller = controller_txt(self.tires, self.vehicle, self.provenance);
        let texts = [
            ("pacejka".to_owned(), "yaml", mpc),
            (format!("{car}_pacejka"), "txt", controller),
            (format!("{car}_lookup_table"), "csv", lookup),
        ];
        // The lookup table has no comments: the date of the set that it belongs to is in the MPC's file.
        let kept_date = date_of(&folder.join("pacejka.yaml"));
        let mut written = [const { PathBuf::new() }; 3];
        for (path, (stem, end, text)) in written.iter_mut().zip(texts) {
            let good = folder.join(format!("{stem}.{end}"));
            let [rejected, provisional] =
                ["rejected", "provisional"].map(|what| folder.join(format!("{stem}.{what}.{end}")));
            *path = match self.provenance.status {
                Status::Accepted | Status::AcceptedWithin => {
                    keep(&good, &text, &folder.join(format!("{stem}.{kept_date}.{end}")))?;
                    replace(&good, &text)?;
                    remove(&rejected)?;
                    remove(&provisional)?;
                    good
                }
                Status::Provisional => {
                    replace(&provisional, &text)?;
                    provisional
                }
                Status::Rejected => {
                    replace(&rejected, &text)?;
                    remove(&provisional)?;
                    rejected
                }
            };
        }
        Ok(written)
    }
}

/// A car's name as part of a file's name.
fn file_name(car: &str) -> String {
    car.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect()
}

/// The date of the data of a set on disk, fit for a file's name; `previous` where it does not say.
fn date_of(mpc_file: &Path) -> String {
    let text = fs::read_to_string(mpc_file).unwrap_or_default();
    let stamp = text.lines().find_map(|line| line.strip_prefix(STAMP_COMMENT));
    let date = stamp.and_then(|s| s.split(['.', ',']).next()).map(|s| s.replace(['-', ':'], ""));
    match date {
        Some(date) if !date.is_empty() && date.chars().all(char::is_alphanumeric) => format!("{date}Z"),
        _ => "previous".into(),
    }
}

/// Keeps what stands at a place under another name, where the new text differs.
fn keep(place: &Path, text: &str, kept: &Path) -> Result<(), ExportError> {
    match fs::read(place) {
        Ok(old) if old != text.as_bytes() => replace_file(kept, &old),
        Ok(_) => Ok(()),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(source) => Err(ExportError::Io { path: place.to_owned(), source }),
    }
}

fn replace(place: &Path, text: &str) -> Result<(), ExportError> {
    replace_file(place, text.as_bytes())
}

/// No text that the suite writes or reads is larger (bytes).
const MOST_TEXT: u64 = 64 << 20;

/// Reads a text from outside.
///
/// # Errors
/// As [`fs::read_to_string`]; a text above 64 MiB is [`io::ErrorKind::FileTooLarge`], and no more of it is read.
pub fn read_text(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    let file = fs::File::open(path)?;
    // A sparse file of a terabyte is not worth reading in part either.
    if file.metadata()?.len() > MOST_TEXT
        || file.take(MOST_TEXT + 1).read_to_string(&mut text)? as u64 > MOST_TEXT
    {
        let error = format!("larger than {} MiB", MOST_TEXT >> 20);
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, error));
    }
    Ok(text)
}

/// Writes a file beside its place and renames it: a reader, and whoever comes after a process that was killed, sees the old file or the
/// new one, whole.
///
/// # Errors
/// [`ExportError::Io`].
pub fn replace_file(place: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    let mut name = OsString::from(".");
    name.push(place.file_name().unwrap_or_default());
    name.push(format!(".{}.tmp", std::process::id()));
    let temporary = place.with_file_name(name);
    let io = |path: &Path| {
        let path = path.to_owned();
        move |source| ExportError::Io { path, source }
    };
    let write = || {
        let mut file = fs::File::create(&temporary)?;
        file.write_all(bytes)?;
        file.sync_all()
    };
    write().map_err(io(&temporary))?;
    fs::rename(&temporary, place).map_err(io(place))
}

fn remove(path: &Path) -> Result<(), ExportError> {
    match fs::remove_file(path) {
        Err(source) if source.kind() != io::ErrorKind::NotFound => {
            Err(ExportError::Io { path: path.to_owned(), source })
        }
        _ => Ok(()),
    }
}
