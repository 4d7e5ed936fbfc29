//! The calibration's file: JSON with a schema, what it rests on, and a hash.

use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::appearance::APPEARANCE;
use crate::embedding::EMBEDDED;
use crate::error::FrictionError;
use crate::files::read_text;

use super::{Calibration, Errors, Example, Kernel, bad, is_known_length};

const SCHEMA: &str = "gripsight.friction_calibration/2";

/// What the file holds. The examples are the function's centres: all else follows from them, and stands there for whoever reads the file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    schema: String,
    track: String,
    features: Vec<String>,
    mean: Vec<f64>,
    scale: Vec<f64>,
    kernels: Vec<(f64, Kernel)>,
    sigma_factor: f64,
    new_distance: f64,
    errors: Errors,
    pictures: usize,
    examples: Vec<Example>,
    hash: String,
}

/// Names of the numbers, of which there are so many.
fn features(count: usize) -> Vec<String> {
    let named = APPEARANCE.map(str::to_owned).into_iter();
    named.chain((0..).map(|k| format!("embedding_{k}"))).take(count).collect()
}

fn hash(track: &str, examples: &[Example]) -> String {
    let mut hasher = Sha256::new();
    hasher.update(SCHEMA);
    hasher.update(track);
    for e in examples {
        hasher.update(&e.source);
        hasher.update(e.part.to_le_bytes());
        for x in e.appearance.iter().chain([&e.mu, &e.sigma, &e.network_mu.unwrap_or(-1.0)]) {
            hasher.update(x.to_le_bytes());
        }
    }
    hasher.finalize().iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}

impl Calibration {
    /// Names what was learned, from what: the first 16 digits of the SHA-256 of the examples and the track.
    #[must_use]
    pub fn hash(&self) -> String {
        hash(self.track(), self.examples())
    }

    /// The file's text.
    ///
    /// # Errors
    /// [`FrictionError::BadCalibration`] where a figure is not finite.
    pub fn to_json(&self) -> Result<String, FrictionError> {
        let content = Content {
            schema: SCHEMA.to_owned(),
            track: self.track.clone(),
            features: features(self.mean.len()),
            mean: self.mean.clone(),
            scale: self.scale.clone(),
            kernels: self.process.kernels().collect(),
            sigma_factor: self.sigma_factor,
            new_distance: self.new_distance,
            errors: self.errors,
            pictures: self.examples.len(),
            examples: self.examples.clone(),
            hash: self.hash(),
        };
        serde_json::to_string_pretty(&content).map(|text| text + "\n").map_err(|e| bad(e.to_string()))
    }

    /// Reads what [`Calibration::to_json`] wrote: learned anew from its examples, which gives the same bits.
    ///
    /// # Errors
    /// [`FrictionError::BadCalibration`] for another schema or other features, a text that does not parse, or a hash that is not that of the content.
    pub fn from_json(text: &str) -> Result<Self, FrictionError> {
        let content: Content = serde_json::from_str(text).map_err(|e| bad(e.to_string()))?;
        if content.schema != SCHEMA {
            return Err(bad(format!("schema {:.40?}: expected {SCHEMA}", content.schema)));
        }
        let count = content.features.len();
        if !is_known_length(count) || content.features != features(count) {
            return Err(bad(format!(
                "{count} features, or others than {APPEARANCE:?} and, at most, {EMBEDDED} of the embedding"
            )));
        }
        // First of all: learning takes its time, and what was changed is not worth it.
        if hash(&content.track, &content.examples) != content.hash {
            return Err(bad(format!(
                "hash {:.16} is not that of its examples: the file was changed",
                content.hash
            )));
        }
        Self::learn(&content.track, &content.examples)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`FrictionError::Read`], or as [`Calibration::from_json`].
    pub fn read_file(path: &Path) -> Result<Self, FrictionError> {
        Self::from_json(&read_text(path)?).map_err(|error| bad(format!("{}: {error}", path.display())))
    }

    /// Writes the file: to a temporary one beside it, which then takes its place.
    ///
    /// # Errors
    /// [`FrictionError::Write`], or as [`Calibration::to_json`].
    pub fn write_file(&self, path: &Path) -> Result<(), FrictionError> {
        let text = self.to_json()?;
        let failed = |source| FrictionError::Write { path: path.to_path_buf(), source };
        let beside = path.with_extension("json.new");
        std::fs::write(&beside, text).map_err(failed)?;
        std::fs::rename(&beside, path).map_err(failed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn learned() -> Calibration {
        let examples: Vec<Example> = (0..12)
            .map(|k| Example {
                appearance: (0..APPEARANCE.len()).map(|j| ((k * 7 + j * 3) % 11) as f64 / 3.0).collect(),
                mu: if k % 2 == 0 { 0.8 } else { 0.4 },
                sigma: 0.05,
                source: ["carpet", "tiles"][k % 2].to_owned(),
                part: k as u32 / 4,
                network_mu: None,
            })
            .collect();
        Calibration::learn("lab", &examples).unwrap()
    }

    #[test]
    fn a_file_read_back_says_the_same_to_the_bit() {
        let (first, folder) = (learned(), tempfile::tempdir().unwrap());
        let path = folder.path().join("lab.json");
        first.write_file(&path).unwrap();
        let second = Calibration::read_file(&path).unwrap();
        let x = vec![1.234; APPEARANCE.len()];
        assert_eq!((first.read(&x), first.hash()), (second.read(&x), second.hash()));
        assert_eq!(first.to_json().unwrap(), second.to_json().unwrap());
    }

    #[test]
    fn a_changed_or_foreign_file_is_refused() {
        let text = learned().to_json().unwrap();
        for (from, to) in
            [("\"mu\": 0.8", "\"mu\": 0.7"), ("calibration/2", "calibration/9"), ("\"luma\"", "\"lumen\"")]
        {
            assert!(text.contains(from));
            assert!(Calibration::from_json(&text.replacen(from, to, 1)).is_err(), "{from}");
        }
    }
}
