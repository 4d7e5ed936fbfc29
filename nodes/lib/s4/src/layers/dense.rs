//! `y = W x + b`, sample by sample. W has shape `(outputs, inputs)`.

use super::{Backward, BlockSpec, Layer, ParameterGroup, Pass, add_scaled, dot};
use crate::Error;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Affine map between widths.
pub(crate) struct Dense {
    inputs: usize,
    outputs: usize,
}

impl Dense {
    pub(crate) fn new(inputs: usize, outputs: usize) -> Self {
        Self { inputs, outputs }
    }
}

impl Layer for Dense {
    fn inputs(&self) -> usize {
        self.inputs
    }

    fn outputs(&self) -> usize {
        self.outputs
    }

    fn blocks(&self) -> Vec<BlockSpec> {
        vec![
            ("weight", vec![self.outputs, self.inputs], ParameterGroup::Ordinary),
            ("bias", vec![self.outputs], ParameterGroup::Ordinary),
        ]
    }

    /// Uniform in +-1/sqrt(inputs), weights and bias.
    fn initialize(&self, rng: &mut ChaCha8Rng, weights: &mut [f64]) {
        let bound = 1.0 / (self.inputs as f64).sqrt();
        for weight in weights {
            *weight = rng.random_range(-bound..bound);
        }
    }

    fn forward(&mut self, pass: &Pass, weights: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Error> {
        let length = pass.total();
        let (matrix, bias) = weights.split_at(self.inputs * self.outputs);
        for ((y, row), &bias) in y.chunks_exact_mut(length).zip(matrix.chunks_exact(self.inputs)).zip(bias) {
            y.fill(bias);
            for (&weight, x) in row.iter().zip(x.chunks_exact(length)) {
                add_scaled(y, weight, x);
            }
        }
        Ok(())
    }

    fn backward(&mut self, pass: &Pass, signals: Backward) -> Result<(), Error> {
        let length = pass.total();
        let Backward { weights, x, dy, dx, gradient, .. } = signals;
        let (matrix, _) = weights.split_at(self.inputs * self.outputs);
        let (matrix_gradient, bias_gradient) = gradient.split_at_mut(self.inputs * self.outputs);
        dx.fill(0.0);
        let rows = matrix.chunks_exact(self.inputs).zip(matrix_gradient.chunks_exact_mut(self.inputs));
        for (((row, row_gradient), bias), dy) in rows.zip(bias_gradient).zip(dy.chunks_exact(length)) {
            *bias = dy.iter().sum();
            let channels = x.chunks_exact(length).zip(dx.chunks_exact_mut(length));
            for ((&weight, gradient), (x, dx)) in row.iter().zip(row_gradient).zip(channels) {
                *gradient = dot(dy, x);
                add_scaled(dx, weight, dy);
            }
        }
        Ok(())
    }

    fn step(&self, weights: &[f64], _state: &mut [f64], x: &[f64], y: &mut [f64]) {
        let (matrix, bias) = weights.split_at(self.inputs * self.outputs);
        for ((y, row), &bias) in y.iter_mut().zip(matrix.chunks_exact(self.inputs)).zip(bias) {
            *y = bias;
            for (weight, x) in row.iter().zip(x) {
                *y += weight * x;
            }
        }
    }
}
