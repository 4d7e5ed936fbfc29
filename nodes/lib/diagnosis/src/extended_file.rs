//! The extended model as a file: tires and effects with their parameters.
//!
//! ```yaml
//! tires:
//!   front: {b: 9.1, c: 1.5, d: 0.98, e: 0.1}
//!   rear: {b: 11.0, c: 1.4, d: 1.02, e: 0.0}
//! effects:
//!   tire_relaxation: {sigma_m: 0.45}
//! usual:
//!   yaw_inertia_error: {ratio: 1.02}
//! ```

use gripsight_model::EffectId;
use std::collections::BTreeMap;

use gripsight_vehicle::OwnTires;
use serde::{Deserialize, Serialize};

use crate::GapError;
use crate::engine::{Engine, Sized};
use crate::state::State;

/// Tires and effects with their parameters, under the names and in the form in which they are fitted
/// ([`EffectSpec::parameters`](gripsight_model::EffectSpec::parameters)).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExtendedModelFile {
    /// Tires fitted together with the effects.
    pub tires: OwnTires,
    /// Parameters of every effect by name: a diagnosis holds them at these sizes until it finds others.
    pub effects: BTreeMap<String, BTreeMap<String, f64>>,
    /// What was fitted beside them of the effects that every car has a little of: a diagnosis starts there.
    #[serde(default)]
    pub usual: BTreeMap<String, BTreeMap<String, f64>>,
}

impl ExtendedModelFile {
    /// Tires alone.
    #[must_use]
    pub fn of_tires(tires: OwnTires) -> Self {
        Self { tires, effects: BTreeMap::new(), usual: BTreeMap::new() }
    }

    /// A fitted model: what it claims and what it started from, and its background.
    pub(crate) fn of(engine: &Engine<'_>, state: &State) -> Self {
        let mut file = Self::of_tires(state.tires());
        for &effect in &state.effects {
            let Some(own) = state.of(effect) else { continue };
            let background = engine.usual(effect).is_some() && !state.named.contains(&effect);
            file.insert(effect, own, background);
        }
        file
    }

    /// Adds an effect with its parameters, in the order of the fit: a claim, or background.
    pub(crate) fn insert(&mut self, effect: EffectId, own: &[f64], background: bool) {
        let target = if background { &mut self.usual } else { &mut self.effects };
        let values = effect.spec().parameters.iter().zip(own).map(|(p, v)| (p.name.to_owned(), *v));
        target.insert(effect.name().to_owned(), values.collect());
    }

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
    /// [`GapError::ModelFile`] says what cannot be read, [`ModelError::UnknownEffect`](gripsight_model::ModelError::UnknownEffect) names an effect that the library lacks.
    pub fn from_yaml(text: &str) -> Result<Self, GapError> {
        let file: Self = serde_saphyr::from_str(text).map_err(|e| GapError::ModelFile(e.to_string()))?;
        file.parameters()?;
        Ok(file)
    }

    /// The effects and what is usual, with their parameters in the order of the fit.
    pub(crate) fn parameters(&self) -> Result<(Sized, Sized), GapError> {
        if !self.tires.is_finite() {
            return Err(GapError::ModelFile("the tires are not finite".to_owned()));
        }
        Ok((parameters(&self.effects)?, parameters(&self.usual)?))
    }
}

fn parameters(effects: &BTreeMap<String, BTreeMap<String, f64>>) -> Result<Sized, GapError> {
    effects
        .iter()
        .map(|(name, given)| {
            let effect = EffectId::known(name)?;
            let specs = effect.spec().parameters;
            if let Some(other) = given.keys().find(|key| specs.iter().all(|p| p.name != key.as_str())) {
                return Err(GapError::ModelFile(format!("{name} has no parameter `{other}`")));
            }
            let own = specs.iter().map(|p| {
                let value = given.get(p.name).copied().filter(|v| v.is_finite());
                value.ok_or_else(|| GapError::ModelFile(format!("{name} needs a number for `{}`", p.name)))
            });
            Ok((effect, own.collect::<Result<Vec<f64>, _>>()?))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_comes_back_and_what_is_wrong_with_it_is_named() {
        let of = |name: &str, parameter: &str, value: f64| {
            BTreeMap::from([(name.to_owned(), BTreeMap::from([(parameter.to_owned(), value)]))])
        };
        let file = ExtendedModelFile {
            tires: OwnTires::from_parameters(&[9.0, 1.5, 1.0, 0.1, 8.0, 1.4, 0.9, -0.2]),
            effects: of("tire_relaxation", "sigma_m", 0.45),
            usual: of("yaw_inertia_error", "ratio", 1.02),
        };
        let text = file.to_yaml().unwrap();
        assert_eq!(ExtendedModelFile::from_yaml(&text).unwrap(), file);
        for (from, to, reason) in [
            ("tire_relaxation", "magic", "unknown effect `magic`"),
            ("sigma_m", "sigma", "no parameter `sigma`"),
            ("0.45", ".nan", "needs a number for `sigma_m`"),
            ("usual", "other", "other"),
        ] {
            let error = ExtendedModelFile::from_yaml(&text.replace(from, to)).unwrap_err();
            assert!(error.to_string().contains(reason), "{error}");
        }
    }
}
