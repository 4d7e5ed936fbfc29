//! Adam with decoupled weight decay (Kingma and Ba, arXiv 1412.6980; Loshchilov and Hutter, arXiv 1711.05101).

use crate::layers::{ParameterBlock, ParameterGroup};

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
const EPSILON: f64 = 1e-8;

/// Rate and decay of each weight's group.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rates {
    pub(crate) ordinary: f64,
    pub(crate) state_space: f64,
    pub(crate) decay: f64,
}

/// Moments of the gradient.
pub(crate) struct Adam {
    mean: Vec<f64>,
    square: Vec<f64>,
    steps: i32,
}

impl Adam {
    pub(crate) fn new(weights: usize) -> Self {
        Self { mean: vec![0.0; weights], square: vec![0.0; weights], steps: 0 }
    }

    /// One update. `rates` are those of this step; `decay` shrinks ordinary weights by `rate * decay`.
    pub(crate) fn step(
        &mut self,
        blocks: &[ParameterBlock],
        rates: Rates,
        weights: &mut [f64],
        gradient: &[f64],
    ) {
        self.steps = self.steps.saturating_add(1);
        let mean_bias = 1.0 - BETA_1.powi(self.steps);
        let square_bias = 1.0 - BETA_2.powi(self.steps);
        for block in blocks {
            let (rate, decay) = match block.group {
                ParameterGroup::Ordinary => (rates.ordinary, rates.decay),
                ParameterGroup::StateSpace => (rates.state_space, 0.0),
            };
            for i in block.offset..block.offset + block.len() {
                self.mean[i] = BETA_1 * self.mean[i] + (1.0 - BETA_1) * gradient[i];
                self.square[i] = BETA_2 * self.square[i] + (1.0 - BETA_2) * gradient[i] * gradient[i];
                let direction = self.mean[i] / mean_bias / ((self.square[i] / square_bias).sqrt() + EPSILON);
                weights[i] -= rate * (direction + decay * weights[i]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(group: ParameterGroup) -> Vec<ParameterBlock> {
        vec![ParameterBlock { name: "w".to_owned(), shape: vec![2], offset: 0, group }]
    }

    #[test]
    fn the_first_step_has_the_size_of_the_rate_whatever_the_gradient() {
        let rates = Rates { ordinary: 0.1, state_space: 0.01, decay: 0.0 };
        for (group, rate) in [(ParameterGroup::Ordinary, 0.1), (ParameterGroup::StateSpace, 0.01)] {
            let mut weights = [1.0, 1.0];
            Adam::new(2).step(&block(group), rates, &mut weights, &[1e-3, -40.0]);
            approx::assert_relative_eq!(weights[0], 1.0 - rate, epsilon = 1e-5);
            approx::assert_relative_eq!(weights[1], 1.0 + rate, epsilon = 1e-5);
        }
    }

    #[test]
    fn only_ordinary_weights_decay() {
        let rates = Rates { ordinary: 0.1, state_space: 0.1, decay: 0.5 };
        for (group, expected) in [(ParameterGroup::Ordinary, 0.95), (ParameterGroup::StateSpace, 1.0)] {
            let mut weights = [1.0, 1.0];
            Adam::new(2).step(&block(group), rates, &mut weights, &[0.0, 0.0]);
            approx::assert_relative_eq!(weights[0], expected);
        }
    }
}
