//! What simpler methods name on the same cases: one-step residuals of the model on the tires handed over, and what they look like.
//!
//! e_k = (x_{k+1} - x_{k-1})/(2 dt) - f(x_k, u_k) is compared with the [`signatures`] of effects. They see v_y, yaw rate, steering and
//! longitudinal command; effects that show elsewhere they cannot name.

mod signatures;

use std::collections::BTreeMap;

use gripsight_signals::{SignalError, StateSequence, segments};
use gripsight_vehicle::{PacejkaParameters, VehicleParameters};
use nalgebra::{DMatrix, DVector};

use signatures::Stretch;

/// Share of the residual's variance below which nothing is named.
const LEAST_SHARE: f64 = 0.01;
/// Rounds of sparse regression, and the coefficients that each throws out, over the largest.
const SPARSE_ROUNDS: usize = 10;
const SPARSE_SHARE: f64 = 0.3;
/// Stretches shorter than this are left out.
const LEAST_STRETCH_S: f64 = 1.0;

/// The first name by method: the best correlated signature, the largest coefficient of a sparse regression (sequentially thresholded
/// least squares, as SINDy's), and the effect that stepwise selection by BIC can least do without.
///
/// # Errors
/// [`SignalError`] for telemetry that cannot be used.
pub fn baselines(
    sequence: &StateSequence,
    vehicle: &VehicleParameters,
    tires: &PacejkaParameters,
) -> Result<BTreeMap<String, String>, SignalError> {
    let stretches: Vec<Stretch> = segments(sequence, LEAST_STRETCH_S)?
        .iter()
        .map(|segment| Stretch::new(segment, vehicle, tires))
        .collect();
    let regression = Regression::new(&stretches);
    let names = signatures::NAMES;
    let said = |place: Option<usize>| place.map_or("no_gap", |k| names[k]).to_owned();
    Ok([
        ("one-step residual correlation", regression.correlation()),
        ("one-step sparse regression", regression.sparse()),
        ("stepwise BIC, tires as handed over", regression.stepwise()),
    ]
    .map(|(method, place)| (method.to_owned(), said(place)))
    .into())
}

/// Signatures of unit length, and the residuals.
struct Regression {
    signatures: DMatrix<f64>,
    residuals: DVector<f64>,
}

impl Regression {
    fn new(stretches: &[Stretch]) -> Self {
        let residuals: Vec<[f64; 2]> = stretches.iter().flat_map(Stretch::residuals).collect();
        // Each channel counts by its own scatter.
        let scale = [0, 1].map(|c| {
            let square: f64 = residuals.iter().map(|r| r[c] * r[c]).sum();
            (square / residuals.len().max(1) as f64).sqrt().max(1e-12)
        });
        let flat = |pairs: Vec<[f64; 2]>| -> Vec<f64> {
            pairs.iter().flat_map(|p| [p[0] / scale[0], p[1] / scale[1]]).collect()
        };
        let columns: Vec<DVector<f64>> = (0..signatures::NAMES.len())
            .map(|k| {
                let column = DVector::from_vec(flat(stretches.iter().flat_map(|s| s.signature(k)).collect()));
                column.try_normalize(1e-12).unwrap_or_else(|| DVector::zeros(2 * residuals.len()))
            })
            .collect();
        Self { signatures: DMatrix::from_columns(&columns), residuals: DVector::from_vec(flat(residuals)) }
    }

    fn correlation(&self) -> Option<usize> {
        let products = self.signatures.tr_mul(&self.residuals);
        let (best, most) = products.argmax_by(f64::abs)?;
        (most.powi(2) > LEAST_SHARE * self.residuals.norm_squared()).then_some(best)
    }

    fn sparse(&self) -> Option<usize> {
        let mut kept: Vec<usize> = (0..self.signatures.ncols()).collect();
        for _ in 0..SPARSE_ROUNDS {
            let (coefficients, _) = self.fit(&kept)?;
            let most = coefficients.amax();
            let next: Vec<usize> = kept
                .iter()
                .zip(coefficients.iter())
                .filter(|(_, c)| c.abs() >= SPARSE_SHARE * most)
                .map(|(k, _)| *k)
                .collect();
            if next.len() == kept.len() {
                break;
            }
            kept = next;
        }
        let (coefficients, left) = self.fit(&kept)?;
        let whole = self.residuals.norm_squared();
        let (place, _) = coefficients.argmax_by(f64::abs)?;
        (whole - left > LEAST_SHARE * whole).then(|| kept[place])
    }

    fn stepwise(&self) -> Option<usize> {
        let count = self.residuals.len() as f64;
        let bic =
            |left: f64, terms: usize| count * (left / count).max(1e-300).ln() + terms as f64 * count.ln();
        let mut kept: Vec<usize> = Vec::new();
        let mut now = bic(self.residuals.norm_squared(), 0);
        loop {
            let next = (0..self.signatures.ncols())
                .filter(|k| !kept.contains(k))
                .filter_map(|k| {
                    let more: Vec<usize> = kept.iter().copied().chain([k]).collect();
                    Some((bic(self.fit(&more)?.1, more.len()), more))
                })
                .min_by(|a, b| a.0.total_cmp(&b.0));
            match next {
                Some((better, more)) if better < now => (now, kept) = (better, more),
                _ => break,
            }
        }
        let without = |k: usize| {
            let rest: Vec<usize> = kept.iter().copied().filter(|other| *other != k).collect();
            self.fit(&rest).map_or(f64::NEG_INFINITY, |(_, left)| left)
        };
        kept.iter().copied().max_by(|a, b| without(*a).total_cmp(&without(*b)))
    }

    /// Least squares on some signatures: coefficients, squares left.
    fn fit(&self, kept: &[usize]) -> Option<(DVector<f64>, f64)> {
        let columns = self.signatures.select_columns(kept);
        let ridge = DMatrix::identity(kept.len(), kept.len()) * 1e-6;
        let inverse = (columns.tr_mul(&columns) + ridge).try_inverse()?;
        let coefficients = inverse * columns.tr_mul(&self.residuals);
        let left = (&self.residuals - columns * &coefficients).norm_squared();
        Some((coefficients, left))
    }
}

/// The place of the largest entry by some measure, and the entry.
trait ArgMax {
    fn argmax_by(&self, measure: fn(f64) -> f64) -> Option<(usize, f64)>;
}

impl ArgMax for DVector<f64> {
    fn argmax_by(&self, measure: fn(f64) -> f64) -> Option<(usize, f64)> {
        self.iter().copied().enumerate().max_by(|a, b| measure(a.1).total_cmp(&measure(b.1)))
    }
}
