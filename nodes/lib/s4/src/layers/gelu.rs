//! Gaussian error linear unit in its logistic form (Hendrycks and Gimpel, arXiv 1606.08415):
//! `gelu(x) = x s(q)`, `q = 2 sqrt(2/pi) (x + 0.044715 x^3)`, `s(q) = 1/(1 + exp(-q))`,
//! which is the usual tanh approximation written with one exponential.

use super::{Backward, Layer, Pass};
use crate::Error;

/// `2 sqrt(2/pi)`.
const SLOPE: f64 = 1.595_769_121_605_731;
/// Coefficient of the cube.
const CUBE: f64 = 0.044_715;

/// Elementwise GELU.
pub(crate) struct Gelu {
    width: usize,
    derivative: Vec<f64>,
}

impl Gelu {
    pub(crate) fn new(width: usize) -> Self {
        Self { width, derivative: Vec::new() }
    }
}

/// The function and its derivative.
fn gelu(x: f64) -> (f64, f64) {
    let square = x * x;
    let sigmoid = 1.0 / (1.0 + (-SLOPE * x * (1.0 + CUBE * square)).exp());
    let slope = SLOPE * (1.0 + 3.0 * CUBE * square);
    (x * sigmoid, sigmoid + x * sigmoid * (1.0 - sigmoid) * slope)
}

impl Layer for Gelu {
    fn inputs(&self) -> usize {
        self.width
    }

    fn forward(&mut self, pass: &Pass, _weights: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Error> {
        if !pass.training {
            self.step(&[], &mut [], x, y);
            return Ok(());
        }
        self.derivative.resize(x.len(), 0.0);
        for ((y, derivative), &x) in y.iter_mut().zip(&mut self.derivative).zip(x) {
            (*y, *derivative) = gelu(x);
        }
        Ok(())
    }

    fn backward(&mut self, _pass: &Pass, signals: Backward) -> Result<(), Error> {
        for ((dx, dy), derivative) in signals.dx.iter_mut().zip(signals.dy).zip(&self.derivative) {
            *dx = dy * derivative;
        }
        Ok(())
    }

    fn step(&self, _weights: &[f64], _state: &mut [f64], x: &[f64], y: &mut [f64]) {
        for (y, &x) in y.iter_mut().zip(x) {
            *y = gelu(x).0;
        }
    }
}
