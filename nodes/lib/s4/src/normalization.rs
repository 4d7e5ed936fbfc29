//! Input mean and scale, output scale: part of the model, beside its weights.

use crate::error::{Error, require_finite, require_length};
use crate::training::TrainingSet;
use serde::{Deserialize, Serialize};

/// Affine maps between physical channels and the network's own.
///
/// The network sees `(u - input_mean) / input_scale` and answers in units of `output_scale`.
/// Outputs have no mean: a residual of zero stays zero, and the decoder's bias learns an offset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Normalization {
    /// Mean of each input, in its unit.
    pub input_mean: Vec<f64>,
    /// Standard deviation of each input, in its unit; positive.
    pub input_scale: Vec<f64>,
    /// Root mean square of each target, in its unit; positive.
    pub output_scale: Vec<f64>,
}

impl Normalization {
    /// The maps that change nothing.
    #[must_use]
    pub fn identity(inputs: usize, outputs: usize) -> Self {
        Self {
            input_mean: vec![0.0; inputs],
            input_scale: vec![1.0; inputs],
            output_scale: vec![1.0; outputs],
        }
    }

    /// Mean and scale of a training set, each sample counting by its weight.
    /// A channel that does not vary gets the scale 1.
    #[must_use]
    pub fn fit(set: &TrainingSet) -> Self {
        let length = set.total_length();
        let rows = |values: &[f64]| -> Vec<(f64, f64)> {
            values.chunks_exact(length).map(|row| weighted_moments(row, set.weights())).collect()
        };
        let inputs = rows(set.inputs());
        Self {
            input_mean: inputs.iter().map(|&(mean, _)| mean).collect(),
            input_scale: inputs
                .iter()
                .map(|&(mean, square)| scale_or_one((square - mean * mean).max(0.0).sqrt(), mean.abs()))
                .collect(),
            output_scale: rows(set.targets())
                .iter()
                .map(|&(_, square)| scale_or_one(square.sqrt(), 0.0))
                .collect(),
        }
    }

    /// Refuses lengths that do not fit, values that are not finite and scales that are not positive.
    pub(crate) fn validate(&self, inputs: usize, outputs: usize) -> Result<(), Error> {
        require_length("input_mean", inputs, self.input_mean.len())?;
        require_length("input_scale", inputs, self.input_scale.len())?;
        require_length("output_scale", outputs, self.output_scale.len())?;
        require_finite("input_mean", &self.input_mean)?;
        for (name, scales) in [("input_scale", &self.input_scale), ("output_scale", &self.output_scale)] {
            require_finite(name, scales)?;
            if let Some(&value) = scales.iter().find(|&&scale| scale <= 0.0) {
                return Err(Error::Setting { name, value, expected: "positive" });
            }
        }
        Ok(())
    }
}

/// Weighted mean and mean square of a row.
fn weighted_moments(row: &[f64], weights: &[f64]) -> (f64, f64) {
    let (mut sum, mut square, mut total) = (0.0, 0.0, 0.0);
    for (&value, &weight) in row.iter().zip(weights) {
        sum += weight * value;
        square += weight * value * value;
        total += weight;
    }
    (sum / total, square / total)
}

/// A scale, or 1 where the channel varies by rounding only.
fn scale_or_one(scale: f64, magnitude: f64) -> f64 {
    if scale > 1e-9 * magnitude && scale > f64::MIN_POSITIVE { scale } else { 1.0 }
}
