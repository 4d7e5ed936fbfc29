//! What is sealed: the labels of a batch, and the hash that commits to them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use gripsight_reference_car::effect_spec;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::WithheldError;

/// The file in the cases' folder that commits to the labels.
pub const COMMITMENT: &str = "commitment.txt";

/// What a case tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// No effect but the background.
    None,
    /// One effect of the library.
    Single,
    /// Two effects of the library.
    Pair,
    /// One effect that the library does not have.
    OutOfLibrary,
    /// One effect of the library, which the diagnosis has to do without.
    Deleted,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 5] = [Self::None, Self::Single, Self::Pair, Self::OutOfLibrary, Self::Deleted];

    /// As in the labels.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Single => "single",
            Self::Pair => "pair",
            Self::OutOfLibrary => "out_of_library",
            Self::Deleted => "deleted",
        }
    }
}

/// What the generator's own fit says of an effect in a drive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OracleFit {
    /// Size over the detection limit (five standard errors).
    pub severity: f64,
    /// Noise-free best fit over the mechanism's size.
    pub size_ratio: f64,
    /// Squared response that neither tires nor start states imitate, over the noise, per residual.
    pub chi2_per_residual: f64,
    /// What the best remaining effect of the library would leave of it, in the same measure; for effects that were left
    /// out.
    pub excess_without: Option<f64>,
}

/// An effect at work.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SealedEffect {
    /// Canonical name, or one of those that the library does not have.
    pub name: String,
    /// The mechanism's constants.
    pub parameters: BTreeMap<String, f64>,
    /// The same in the library's terms: the constants, the sizing ones times [`OracleFit::size_ratio`]; of a slope the steepest climb.
    pub library_parameters: BTreeMap<String, f64>,
    /// The generator's own fit; none for recorded and foreign drives.
    pub oracle: Option<OracleFit>,
}

/// The first parameter that sizes an effect, with its constant.
#[must_use]
pub fn sizing_parameter(effect: &SealedEffect) -> Option<(&'static str, f64)> {
    let spec = effect_spec(&effect.name).ok()?;
    let parameter = spec.parameters.iter().find(|p| p.null.is_some())?;
    Some((parameter.name, *effect.parameters.get(parameter.name)?))
}

/// Who drove.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Family {
    /// The reference car.
    Reference,
    /// A plant that others wrote.
    Foreign,
    /// A recorded bag.
    Recorded,
    /// A simulator and a car that is the same simulator with something changed; what differs from the simulator is asked.
    Simulator,
}

impl Family {
    /// All families.
    pub const ALL: [Self; 4] = [Self::Reference, Self::Foreign, Self::Recorded, Self::Simulator];

    /// As in the labels.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Reference => "reference",
            Self::Foreign => "foreign",
            Self::Recorded => "recorded",
            Self::Simulator => "simulator",
        }
    }
}

/// The label of a case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CaseLabel {
    /// Its folder's name.
    pub case: String,
    /// Who drove.
    pub family: Family,
    /// Whether an earlier drive of the car, without the effects, is there to compare with.
    #[serde(default)]
    pub compared: bool,
    /// What it tests.
    pub kind: Kind,
    /// The effects, none to two.
    pub effects: Vec<SealedEffect>,
    /// Effects left out of the library: decoys and, in cases of kind `deleted`, the true one.
    pub without: Vec<String>,
    /// Whether the drive is at race pace.
    pub race_pace: bool,
    /// Effects that the drive has of its own at full size: to name one of them is no false alarm.
    pub contained: Vec<String>,
    /// Car, track, pace, noise and the like, for the reader.
    pub circumstances: BTreeMap<String, serde_json::Value>,
}

/// The labels of a batch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Labels {
    /// Random, so that the commitment cannot be found by trying seeds.
    pub nonce: String,
    /// Seed of the batch.
    pub seed: u64,
    /// Settings of the batch, for the reader.
    pub settings: BTreeMap<String, serde_json::Value>,
    /// Labels in the order of the cases.
    pub cases: Vec<CaseLabel>,
}

impl Labels {
    /// Writes the labels, and the commitment into the folder of the cases.
    ///
    /// # Errors
    /// [`WithheldError::Io`].
    pub fn seal(&self, file: &Path, cases: &Path) -> Result<String, WithheldError> {
        let text = serde_json::to_string(self).map_err(|e| WithheldError::content(file, &e))? + "\n";
        fs::write(file, &text).map_err(WithheldError::io(file))?;
        let hash = sha256_hex(text.as_bytes());
        let commitment = cases.join(COMMITMENT);
        fs::write(&commitment, format!("{hash}\n")).map_err(WithheldError::io(&commitment))?;
        Ok(hash)
    }

    /// Opens labels after checking them against the commitment in the folder of the cases.
    ///
    /// # Errors
    /// [`WithheldError::Tampered`], [`WithheldError::Io`], [`WithheldError::Content`].
    pub fn open(file: &Path, cases: &Path) -> Result<Self, WithheldError> {
        let bytes = fs::read(file).map_err(WithheldError::io(file))?;
        let commitment = cases.join(COMMITMENT);
        let committed = fs::read_to_string(&commitment).map_err(WithheldError::io(&commitment))?;
        let (found, committed) = (sha256_hex(&bytes), committed.trim().to_owned());
        if found != committed {
            return Err(WithheldError::Tampered { labels: file.to_owned(), commitment, found, committed });
        }
        serde_json::from_slice(&bytes).map_err(|e| WithheldError::content(file, &e))
    }
}

/// SHA-256 in hexadecimal digits.
#[must_use]
pub fn sha256_hex(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

/// Bytes in hexadecimal digits.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}
