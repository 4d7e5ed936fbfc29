//! The extended model as a file: tires and effects with their parameters.
//!
//! ```yaml
//! tires:
//!   front: {b: 9.1, c: 1.5, d: 0.98, e: 0.1}
//!   rear: {b: 11.0, c: 1.4, d: 1.02, e: 0.0}
//! effects:
//!   tire_relaxation: {sigma_m: 0.45}
//! ```

use std::collections::BTreeMap;

use gripsight_vehicle::PacejkaParameters;
use serde::{Deserialize, Serialize};

use crate::{Diagnosis, EffectId, GapError};

/// Tires and effects with their parameters, as the report states them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExtendedModelFile {
    /// Tires fitted together with the effects.
    pub tires: PacejkaParameters,
    /// Parameters of every effect by name.
    pub effects: BTreeMap<String, BTreeMap<String, f64>>,
}

impl ExtendedModelFile {
    /// As YAML.
    ///
    /// # Errors
    /// [`GapError::ModelFile`] where a number cannot be written.
    pub fn to_yaml(&self) -> Result<String, GapError> {
        serde_saphyr::to_string(self).map_err(|e| GapError::ModelFile(e.to_string()))
    }

    /// From YAML.
    ///
    /// # Errors
    /// [`GapError::ModelFile`] says what cannot be read, [`GapError::UnknownEffect`] names an effect that the library lacks.
    pub fn from_yaml(text: &str) -> Result<Self, GapError> {
        let file: Self = serde_saphyr::from_str(text).map_err(|e| GapError::ModelFile(e.to_string()))?;
        match file.effects.keys().find(|n| EffectId::by_name(n).is_none()) {
            Some(name) => Err(GapError::UnknownEffect {
                name: name.clone(),
                known: EffectId::ALL.iter().map(|e| e.name()).collect::<Vec<_>>().join(", "),
            }),
            None => Ok(file),
        }
    }
}

impl Diagnosis {
    /// The model that the verdict names.
    #[must_use]
    pub fn extended_model(&self) -> ExtendedModelFile {
        let effects = self
            .effects
            .iter()
            .filter(|e| e.accepted)
            .map(|e| {
                let values = e.parameters.iter().map(|(name, p)| ((*name).to_owned(), p.value)).collect();
                (e.name.to_owned(), values)
            })
            .collect();
        ExtendedModelFile { tires: self.tires.with_effect, effects }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_comes_back_and_unknown_effects_are_named() {
        let file = ExtendedModelFile {
            tires: PacejkaParameters::from_array([9.0, 1.5, 1.0, 0.1, 8.0, 1.4, 0.9, -0.2]),
            effects: BTreeMap::from([(
                "tire_relaxation".to_owned(),
                BTreeMap::from([("sigma_m".to_owned(), 0.45)]),
            )]),
        };
        let text = file.to_yaml().unwrap();
        assert_eq!(ExtendedModelFile::from_yaml(&text).unwrap(), file);
        let unknown = ExtendedModelFile::from_yaml(&text.replace("tire_relaxation", "magic")).unwrap_err();
        assert!(unknown.to_string().contains("magic"));
    }
}
