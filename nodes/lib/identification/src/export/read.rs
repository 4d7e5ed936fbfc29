//! Either tire file, back.

use std::collections::BTreeMap;

use gripsight_vehicle::{MagicFormula, PacejkaParameters};
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::ExportError;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case)]
struct Mpc {
    friction_coeff: f64,
    Bf: f64,
    Cf: f64,
    Df: f64,
    Ef: f64,
    Br: f64,
    Cr: f64,
    Dr: f64,
    Er: f64,
    /// The surface's name says nothing about the tires.
    #[serde(rename = "floor")]
    _floor: IgnoredAny,
}

/// Other keys of such files (drive train, limits) are other tools' business.
#[derive(Deserialize)]
struct Controller {
    #[serde(rename = "C_Pf")]
    front: [f64; 4],
    #[serde(rename = "C_Pr")]
    rear: [f64; 4],
}

/// Reads the MPC's YAML or a controller's `_pacejka.txt`; which of them, its keys say.
///
/// # Errors
/// [`ExportError`] names what cannot be read, is missing or no number to compute with.
pub fn read_tires(text: &str) -> Result<PacejkaParameters, ExportError> {
    let yaml = |e: serde_saphyr::Error| ExportError::Yaml(e.to_string());
    let keys: BTreeMap<String, IgnoredAny> = serde_saphyr::from_str(text).map_err(yaml)?;
    let tires = if keys.contains_key("C_Pf") {
        let file: Controller = serde_saphyr::from_str(text).map_err(yaml)?;
        let axle = |[b, c, d, e]: [f64; 4]| MagicFormula { b, c, d, e };
        PacejkaParameters { front: axle(file.front), rear: axle(file.rear) }
    } else if keys.contains_key("Bf") {
        let file: Mpc = serde_saphyr::from_str(text).map_err(yaml)?;
        let mu = file.friction_coeff;
        PacejkaParameters {
            front: MagicFormula { b: file.Bf, c: file.Cf, d: mu * file.Df, e: file.Ef },
            rear: MagicFormula { b: file.Br, c: file.Cr, d: mu * file.Dr, e: file.Er },
        }
    } else {
        let found = keys.into_keys().collect::<Vec<_>>().join(", ");
        return Err(ExportError::UnknownFormat {
            found: if found.is_empty() { "none".into() } else { found },
        });
    };
    checked_tires(tires)
}

/// Tires of a file, where they are such as can be computed with.
///
/// # Errors
/// [`ExportError::Parameter`] names what is no number, or not positive; E may have either sign.
pub fn checked_tires(tires: PacejkaParameters) -> Result<PacejkaParameters, ExportError> {
    if let Some((name, got)) =
        [("E front", tires.front.e), ("E rear", tires.rear.e)].into_iter().find(|(_, e)| !e.is_finite())
    {
        return Err(ExportError::Parameter { name, got, must: "finite" });
    }
    let numbers = [
        ("B front", tires.front.b),
        ("C front", tires.front.c),
        ("D front", tires.front.d),
        ("B rear", tires.rear.b),
        ("C rear", tires.rear.c),
        ("D rear", tires.rear.d),
    ];
    match numbers.into_iter().find(|(_, got)| !(got.is_finite() && *got > 0.0)) {
        Some((name, got)) => Err(ExportError::Parameter { name, got, must: "positive and finite" }),
        None => Ok(tires),
    }
}
