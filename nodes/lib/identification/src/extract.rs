//! Tires from the forces of the virtual test: Nelder-Mead on B, C, D, E of each axle.

use gripsight_vehicle::MagicFormula;

use crate::IdentificationError;
use crate::nelder_mead::{Minimum, NelderMeadConfig, minimize};
use crate::sweep::Point;
use crate::tires::{BOUNDS, C_PRIOR, E_PRIOR};

/// Result for one axle.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Extraction {
    pub(crate) axle: MagicFormula,
    /// Root mean square error of F_y/F_z.
    pub(crate) rmse: f64,
    pub(crate) evaluations: usize,
}

/// How much the curve may miss the points to keep C or E one sigma nearer to what is likely: their ridge is flat.
const SHAPE_TRUST: f64 = 2e-3;

/// Fits one axle. `d_range` keeps D within it: the data do not reach the peak. `shaped` holds C and E softly at what is likely; the paper does not.
pub(crate) fn extract(
    points: &[Point],
    start: &MagicFormula,
    d_range: Option<(f64, f64)>,
    shaped: bool,
) -> Result<Extraction, IdentificationError> {
    let mean_square = |axle: &MagicFormula| -> f64 {
        let errors = points.iter().map(|p| (axle.normalized_force(p.slip_rad) - p.force).powi(2));
        errors.sum::<f64>() / points.len().max(1) as f64
    };
    let axle_of = |x: &[f64]| MagicFormula { b: x[0], c: x[1], d: x[2], e: x[3] };
    let cost = |x: &[f64]| {
        let shape =
            ((x[1] - C_PRIOR.mean) / C_PRIOR.sigma).powi(2) + ((x[3] - E_PRIOR.mean) / E_PRIOR.sigma).powi(2);
        mean_square(&axle_of(x)) + if shaped { SHAPE_TRUST.powi(2) * shape } else { 0.0 }
    };
    let mut bounds = BOUNDS;
    if let Some((low, high)) = d_range {
        bounds[2] = (low.max(bounds[2].0), high.min(bounds[2].1));
    }
    let x = [start.b, start.c, start.d.clamp(bounds[2].0, bounds[2].1), start.e];
    let config = NelderMeadConfig { tolerance_x: 1e-4, tolerance_cost: 1e-10, ..NelderMeadConfig::default() };
    let Minimum { x, evaluations, .. } = minimize(cost, &x, &bounds, &config)?;
    let axle = axle_of(&x);
    Ok(Extraction { axle, rmse: mean_square(&axle).sqrt(), evaluations })
}
