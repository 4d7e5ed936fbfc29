//! The loss: `sum_k w_k sum_o (y_ko - t_ko)^2 / (O sum_k w_k)`, outputs and targets in units of the output scale.

use super::{TrainingSet, pipeline};
use crate::error::{Error, require_length};
use crate::network::Gradients;
use crate::pipeline::Pipeline;
use crate::{Normalization, ResidualNetwork};

/// A network's layers on one set.
pub(super) struct Objective {
    pipeline: Pipeline,
    /// Targets in units of the output scale, `(outputs, L)`.
    targets: Vec<f64>,
    /// Weight of each sample over the sum of all times the number of outputs, `(L)`.
    weights: Vec<f64>,
}

impl Objective {
    /// `dropout` and `seed` act in [`Self::loss_and_gradient`] only.
    pub(super) fn new(
        network: &ResidualNetwork,
        set: &TrainingSet,
        dropout: f64,
        seed: u64,
    ) -> Result<Self, Error> {
        let (inputs, outputs) = set.channels();
        require_length("channels of the set's inputs", network.config().inputs, inputs)?;
        require_length("channels of the set's targets", network.config().outputs, outputs)?;
        Ok(Self {
            pipeline: pipeline(network, set, dropout, seed),
            targets: scaled_targets(set, network.normalization()),
            weights: shares(set),
        })
    }

    /// Loss without dropout.
    pub(super) fn loss(&mut self, weights: &[f64]) -> Result<f64, Error> {
        self.pipeline.forward(weights, false)?;
        Ok(self.passed(&self.weights))
    }

    /// Loss of the last pass, its samples weighed by `sample_weights` (`(L)`; over their sum times the number of outputs).
    fn passed(&self, sample_weights: &[f64]) -> f64 {
        let length = sample_weights.len();
        let rows = self.pipeline.output().chunks_exact(length).zip(self.targets.chunks_exact(length));
        rows.map(|(outputs, targets)| squared_error(outputs, targets, sample_weights)).sum()
    }

    /// Loss with dropout, and its gradient.
    pub(super) fn loss_and_gradient(&mut self, weights: &[f64], gradient: &mut [f64]) -> Result<f64, Error> {
        self.pipeline.forward(weights, true)?;
        let length = self.weights.len();
        let (outputs, by_outputs) = self.pipeline.output_and_gradient_mut();
        let rows = outputs.chunks_exact(length).zip(self.targets.chunks_exact(length));
        let mut loss = 0.0;
        for ((outputs, targets), by_outputs) in rows.zip(by_outputs.chunks_exact_mut(length)) {
            loss += squared_error(outputs, targets, &self.weights);
            for (((by_output, output), target), weight) in
                by_outputs.iter_mut().zip(outputs).zip(targets).zip(&self.weights)
            {
                *by_output = 2.0 * weight * (output - target);
            }
        }
        self.pipeline.backward(weights, gradient)?;
        Ok(loss)
    }
}

/// What is held out of training, to say when to stop.
pub(super) enum HeldOut {
    /// Samples of their own.
    Apart(Objective),
    /// Other weights for the samples that are trained on, `(L)`: the pass that training takes anyway tells their loss, too.
    Beside(Vec<f64>),
}

impl HeldOut {
    pub(super) fn new(
        network: &ResidualNetwork,
        training: &TrainingSet,
        held_out: &TrainingSet,
        dropout: f64,
    ) -> Result<Self, Error> {
        if dropout == 0.0 && held_out.has_samples_of(training) {
            return Ok(Self::Beside(shares(held_out)));
        }
        Objective::new(network, held_out, 0.0, 0).map(Self::Apart)
    }

    pub(super) fn loss(&mut self, objective: &mut Objective, weights: &[f64]) -> Result<f64, Error> {
        match self {
            Self::Apart(own) => own.loss(weights),
            Self::Beside(sample_weights) => {
                objective.pipeline.forward(weights, false)?;
                Ok(objective.passed(sample_weights))
            }
        }
    }

    /// The loss, and what `objective` has of [`Objective::loss_and_gradient`] at the same weights.
    pub(super) fn loss_beside(
        &mut self,
        objective: &mut Objective,
        weights: &[f64],
        gradient: &mut [f64],
    ) -> Result<(f64, f64), Error> {
        match self {
            Self::Apart(own) => {
                let (held_out, training) =
                    rayon::join(|| own.loss(weights), || objective.loss_and_gradient(weights, gradient));
                Ok((held_out?, training?))
            }
            Self::Beside(sample_weights) => {
                let training = objective.loss_and_gradient(weights, gradient)?;
                Ok((objective.passed(sample_weights), training))
            }
        }
    }
}

/// Weights of a set's samples over the sum of all times the number of outputs.
fn shares(set: &TrainingSet) -> Vec<f64> {
    let total: f64 = set.weights().iter().sum::<f64>() * set.channels().1 as f64;
    set.weights().iter().map(|weight| weight / total).collect()
}

/// Weighted sum of squared differences.
fn squared_error(outputs: &[f64], targets: &[f64], weights: &[f64]) -> f64 {
    let differences = outputs.iter().zip(targets).map(|(output, target)| output - target);
    differences.zip(weights).map(|(difference, weight)| weight * difference * difference).sum()
}

/// Targets in units of the output scale.
fn scaled_targets(set: &TrainingSet, normalization: &Normalization) -> Vec<f64> {
    let rows = set.targets().chunks_exact(set.total_length()).zip(&normalization.output_scale);
    rows.flat_map(|(row, scale)| row.iter().map(move |value| value / scale)).collect()
}

/// Loss and gradient without dropout.
pub(crate) fn loss_and_gradient(network: &ResidualNetwork, set: &TrainingSet) -> Result<Gradients, Error> {
    let mut values = vec![0.0; network.weights().len()];
    let loss = Objective::new(network, set, 0.0, 0)?.loss_and_gradient(network.weights(), &mut values)?;
    Ok(Gradients { loss, values })
}

/// How well a network predicts a set.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// Weighted mean squared error in units of the output scale.
    pub loss: f64,
    /// Weighted root mean square error of each output, in its unit.
    pub rmse: Vec<f64>,
}

impl ResidualNetwork {
    /// Predicts a set and compares.
    ///
    /// # Errors
    /// If the set has other channels than this network.
    pub fn evaluate(&self, set: &TrainingSet) -> Result<Evaluation, Error> {
        let mut objective = Objective::new(self, set, 0.0, 0)?;
        let loss = objective.loss(self.weights())?;
        let length = set.total_length();
        let rows =
            objective.pipeline.output().chunks_exact(length).zip(objective.targets.chunks_exact(length));
        let outputs = set.channels().1 as f64;
        let rmse = rows
            .zip(&self.normalization().output_scale)
            .map(|((y, t), scale)| scale * (outputs * squared_error(y, t, &objective.weights)).sqrt())
            .collect();
        Ok(Evaluation { loss, rmse })
    }
}
