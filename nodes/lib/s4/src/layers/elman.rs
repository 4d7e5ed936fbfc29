//! Elman recurrence: `h_k = tanh(x_k + W h_{k-1})`, `y_k = h_k`, `h` zero before the first sample.
//! The input matrix and the bias are those of the dense layer before it. Gradients through time, in full.

use super::{Backward, BlockSpec, Layer, ParameterGroup, Pass};
use crate::Error;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Recurrence of one hidden vector of `width` numbers.
pub(crate) struct Elman {
    width: usize,
}

impl Elman {
    pub(crate) fn new(width: usize) -> Self {
        Self { width }
    }
}

impl Layer for Elman {
    fn inputs(&self) -> usize {
        self.width
    }

    fn blocks(&self) -> Vec<BlockSpec> {
        vec![("recurrent", vec![self.width, self.width], ParameterGroup::Ordinary)]
    }

    /// Uniform in +-1/sqrt(width).
    fn initialize(&self, rng: &mut ChaCha8Rng, weights: &mut [f64]) {
        let bound = 1.0 / (self.width as f64).sqrt();
        for weight in weights {
            *weight = rng.random_range(-bound..bound);
        }
    }

    fn forward(&mut self, pass: &Pass, weights: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Error> {
        let total = pass.total();
        let mut state = vec![0.0; self.state_len()];
        let (mut sample, mut hidden) = (vec![0.0; self.width], vec![0.0; self.width]);
        for (start, length) in pass.segments() {
            state.fill(0.0);
            for k in start..start + length {
                for (i, value) in sample.iter_mut().enumerate() {
                    *value = x[i * total + k];
                }
                self.step(weights, &mut state, &sample, &mut hidden);
                for (i, value) in hidden.iter().enumerate() {
                    y[i * total + k] = *value;
                }
            }
        }
        Ok(())
    }

    /// With `g_k` the gradient by the sum inside the tanh: `g_k = (1 - h_k^2)(dy_k + W^T g_{k+1})`,
    /// `dx_k = g_k`, `dW = sum_k g_k h_{k-1}^T`.
    fn backward(&mut self, pass: &Pass, signals: Backward) -> Result<(), Error> {
        let total = pass.total();
        let width = self.width;
        let Backward { weights, y, dy, dx, gradient, .. } = signals;
        gradient.fill(0.0);
        let (mut carried, mut inner, mut before) = (vec![0.0; width], vec![0.0; width], vec![0.0; width]);
        for (start, length) in pass.segments() {
            carried.fill(0.0);
            for k in (start..start + length).rev() {
                for i in 0..width {
                    let at = i * total + k;
                    inner[i] = (1.0 - y[at] * y[at]) * (dy[at] + carried[i]);
                    dx[at] = inner[i];
                    before[i] = if k > start { y[at - 1] } else { 0.0 };
                }
                carried.fill(0.0);
                let rows = weights.chunks_exact(width).zip(gradient.chunks_exact_mut(width));
                for ((row, row_gradient), &inner) in rows.zip(&inner) {
                    super::add_scaled(&mut carried, inner, row);
                    super::add_scaled(row_gradient, inner, &before);
                }
            }
        }
        Ok(())
    }

    fn state_len(&self) -> usize {
        self.width
    }

    fn step(&self, weights: &[f64], state: &mut [f64], x: &[f64], y: &mut [f64]) {
        for ((y, row), x) in y.iter_mut().zip(weights.chunks_exact(self.width)).zip(x) {
            *y = (x + super::dot(row, state)).tanh();
        }
        state.copy_from_slice(y);
    }
}
