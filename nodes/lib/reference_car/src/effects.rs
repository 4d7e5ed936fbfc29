//! An effect asked for: a canonical name with its parameters, from words or from a file.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::effect_table::{EffectSpec, effect_spec, parameter_spec};
use crate::error::ReferenceCarError;

/// An effect with its size, by canonical name. Parameters left out take their typical value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectSetting {
    /// Canonical name.
    pub name: String,
    /// Parameters by name.
    #[serde(default)]
    pub parameters: BTreeMap<String, f64>,
}

impl EffectSetting {
    /// An effect with its parameters in the table's order; those left out take their typical value.
    ///
    /// # Errors
    /// `UnknownName` for a name outside the table, `UnreadableEffect` for more values than parameters.
    pub fn new(name: &str, values: &[f64]) -> Result<Self, ReferenceCarError> {
        let spec = effect_spec(name)?;
        if values.len() > spec.parameters.len() {
            return Err(ReferenceCarError::UnreadableEffect {
                text: format!("{name}={values:?}"),
                reason: format!("expected at most {} values", spec.parameters.len()),
            });
        }
        let parameters = spec.parameters.iter().zip(values).map(|(p, v)| (p.name.to_owned(), *v)).collect();
        Ok(Self { name: name.to_owned(), parameters })
    }

    /// Reads `NAME`, `NAME=VALUE`, `NAME=VALUE,VALUE` or `NAME=PARAMETER:VALUE,PARAMETER:VALUE`.
    ///
    /// # Errors
    /// `UnknownName` for a name outside the table, `UnreadableEffect` for a value that is not a number.
    pub fn parse(text: &str) -> Result<Self, ReferenceCarError> {
        let unreadable =
            |reason: String| ReferenceCarError::UnreadableEffect { text: text.to_owned(), reason };
        let (name, values) = text.split_once('=').map_or((text, None), |(name, values)| (name, Some(values)));
        let spec = effect_spec(name)?;
        let mut setting = Self { name: name.to_owned(), parameters: BTreeMap::new() };
        for (index, item) in values.into_iter().flat_map(|v| v.split(',')).enumerate() {
            let (key, number) = match item.split_once(':') {
                Some((key, number)) => (parameter_spec(spec, key)?.name, number),
                None => match spec.parameters.get(index) {
                    Some(parameter) => (parameter.name, item),
                    None => {
                        return Err(unreadable(format!("expected at most {} values", spec.parameters.len())));
                    }
                },
            };
            let value: f64 =
                number.trim().parse().map_err(|_| unreadable(format!("{number:?} is not a number")))?;
            setting.parameters.insert(key.to_owned(), value);
        }
        Ok(setting)
    }

    /// Its values in the table's order; `small` picks the typical sizes of a 1:10 car.
    pub(crate) fn values(
        &self,
        spec: &'static EffectSpec,
        small: bool,
    ) -> Result<Vec<f64>, ReferenceCarError> {
        for key in self.parameters.keys() {
            parameter_spec(spec, key)?;
        }
        spec.parameters
            .iter()
            .map(|p| {
                let typical = if small { p.typical_small } else { p.typical };
                let value = self.parameters.get(p.name).copied().unwrap_or(typical);
                if value.is_finite() {
                    Ok(value)
                } else {
                    Err(ReferenceCarError::InvalidParameter {
                        name: format!("effect {}.{}", spec.name, p.name),
                        value,
                        expected: "a finite number",
                    })
                }
            })
            .collect()
    }
}
