//! A car with its tires and effects as a file: what a simulator needs of it.

use std::collections::BTreeMap;

use gripsight_vehicle::{OwnTires, VehicleParameters};
use serde::{Deserialize, Serialize};

use crate::effects::EffectId;
use crate::{DrivenCar, ModelError};

/// Longest step of the integration.
const SUBSTEP_S: f64 = 0.001;

/// The car, its tires, and its effects with their parameters by name, in the form in which they are fitted
/// ([`EffectSpec::parameters`](crate::EffectSpec::parameters)).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CarFile {
    /// The car as its file states it.
    pub vehicle: VehicleParameters,
    /// The car's own tires.
    pub tires: OwnTires,
    /// Parameters of every effect by name.
    pub effects: BTreeMap<String, BTreeMap<String, f64>>,
}

impl CarFile {
    /// The effects with their parameters in the order of the fit.
    ///
    /// # Errors
    /// [`ModelError::UnknownEffect`] names an effect that the library lacks, [`ModelError::NoParameter`] one that lacks a number.
    pub fn effects(&self) -> Result<Vec<(EffectId, Vec<f64>)>, ModelError> {
        let effect = |(name, given): (&String, &BTreeMap<String, f64>)| {
            let effect = EffectId::known(name)?;
            let own = effect.spec().parameters.iter().map(|p| {
                let value = given.get(p.name).copied().filter(|v| v.is_finite());
                value.ok_or(ModelError::NoParameter { effect: effect.name(), parameter: p.name })
            });
            Ok((effect, own.collect::<Result<Vec<f64>, ModelError>>()?))
        };
        self.effects.iter().map(effect).collect()
    }

    /// The car, to be driven by its force.
    ///
    /// # Errors
    /// As for [`Self::effects`].
    pub fn driven(&self) -> Result<DrivenCar, ModelError> {
        Ok(DrivenCar {
            vehicle: self.vehicle.clone(),
            tires: self.tires,
            effects: self.effects()?,
            substep_s: SUBSTEP_S,
            force_known: true,
            on_course: false,
        })
    }
}
