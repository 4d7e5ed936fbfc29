//! Inverted dropout: while training, each value is zeroed with probability `rate` and the others
//! are scaled by `1/(1 - rate)`; otherwise the identity.

use super::{Backward, Layer, Pass};
use crate::Error;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Dropout with its own random stream.
pub(crate) struct Dropout {
    width: usize,
    rate: f64,
    rng: ChaCha8Rng,
    factors: Vec<f64>,
}

impl Dropout {
    pub(crate) fn new(width: usize, rate: f64, rng: ChaCha8Rng) -> Self {
        Self { width, rate, rng, factors: Vec::new() }
    }
}

impl Layer for Dropout {
    fn inputs(&self) -> usize {
        self.width
    }

    fn forward(&mut self, pass: &Pass, _weights: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Error> {
        y.copy_from_slice(x);
        if pass.training && self.rate > 0.0 {
            let threshold = (self.rate * f64::from(u32::MAX)) as u32;
            let kept = 1.0 / (1.0 - self.rate);
            self.factors.resize(x.len(), 0.0);
            for (y, factor) in y.iter_mut().zip(&mut self.factors) {
                *factor = if self.rng.next_u32() < threshold { 0.0 } else { kept };
                *y *= *factor;
            }
        }
        Ok(())
    }

    fn backward(&mut self, _pass: &Pass, signals: Backward) -> Result<(), Error> {
        signals.dx.copy_from_slice(signals.dy);
        for (dx, factor) in signals.dx.iter_mut().zip(&self.factors) {
            *dx *= factor;
        }
        Ok(())
    }

    fn step(&self, _weights: &[f64], _state: &mut [f64], x: &[f64], y: &mut [f64]) {
        y.copy_from_slice(x);
    }
}
