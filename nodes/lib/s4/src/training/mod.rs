//! Training: full-batch Adam on the weighted squared error, early stopping on held-out samples.

mod adam;
mod loss;
mod set;

pub use loss::Evaluation;
pub(crate) use loss::loss_and_gradient;
pub use set::{Sequence, TrainingSet};

use crate::pipeline::{Layers, Pipeline};
use crate::{Error, ResidualNetwork};
use adam::{Adam, Rates};
use loss::{HeldOut, Objective};
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// How the learning rate changes over the epochs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Schedule {
    /// The same in every epoch.
    Constant,
    /// Half a cosine from the full rate to zero at the last epoch allowed.
    Cosine,
}

/// Settings of the trainer.
///
/// The paper leaves them open. The defaults were chosen on a simulated car that no result is published on (example
/// `defaults`, three levels of noise): an epoch is one update, and in 300 of them the rates of the S4D authors' example, 0.01 and
/// 0.001, leave 1.1 to 2.4 times the error. Dropout, which the paper has at a rate that it does not tell, is off: at
/// 0.1 it leaves 1.03 to 2.5 times the error, early stopping being regularisation enough.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainingConfig {
    /// Epochs at most; one epoch is one update on the whole set.
    pub epochs_max: usize,
    /// Learning rate of ordinary weights.
    pub learning_rate: f64,
    /// Learning rate of `log_dt, log_a_real, a_imag`, which have no weight decay.
    pub state_space_learning_rate: f64,
    /// Course of both rates.
    pub schedule: Schedule,
    /// Decoupled weight decay of ordinary weights.
    pub weight_decay: f64,
    /// Probability with which a hidden value is dropped while training.
    pub dropout: f64,
    /// Bound on the Euclidean norm of the gradient.
    pub gradient_norm_max: f64,
    /// Epochs without a better validation loss after which training stops.
    pub patience: usize,
    /// Fraction by which a validation loss must be below the best one to count as better.
    pub improvement_min: f64,
    /// Seed of dropout.
    pub seed: u64,
}

impl Default for TrainingConfig {
    fn default() -> Self {
        Self {
            epochs_max: 300,
            learning_rate: 3e-2,
            state_space_learning_rate: 1e-2,
            schedule: Schedule::Cosine,
            weight_decay: 1e-2,
            dropout: 0.0,
            gradient_norm_max: 1.0,
            patience: 40,
            improvement_min: 1e-4,
            seed: 0,
        }
    }
}

impl TrainingConfig {
    /// Refuses settings that make no sense.
    ///
    /// # Errors
    /// [`Error::Setting`] names the first field that is out of range.
    pub fn validate(&self) -> Result<(), Error> {
        let positive = [
            ("epochs_max", self.epochs_max as f64),
            ("learning_rate", self.learning_rate),
            ("gradient_norm_max", self.gradient_norm_max),
            ("patience", self.patience as f64),
        ];
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::Setting { name, value, expected: "positive" });
            }
        }
        let not_negative = [
            ("state_space_learning_rate", self.state_space_learning_rate),
            ("weight_decay", self.weight_decay),
            ("improvement_min", self.improvement_min),
        ];
        for (name, value) in not_negative {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::Setting { name, value, expected: "at least 0" });
            }
        }
        if !(0.0..1.0).contains(&self.dropout) {
            let value = self.dropout;
            return Err(Error::Setting { name: "dropout", value, expected: "at least 0 and below 1" });
        }
        Ok(())
    }

    /// Rates in epoch `epoch`, counted from 0.
    fn rates(&self, epoch: usize) -> Rates {
        let factor = match self.schedule {
            Schedule::Constant => 1.0,
            Schedule::Cosine => {
                0.5 * (1.0 + (std::f64::consts::PI * epoch as f64 / self.epochs_max as f64).cos())
            }
        };
        Rates {
            ordinary: self.learning_rate * factor,
            state_space: self.state_space_learning_rate * factor,
            decay: self.weight_decay,
        }
    }
}

/// Why training ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// The epochs allowed are used up.
    EpochLimit,
    /// The validation loss has not improved for the patience given.
    EarlyStopping,
    /// A loss or gradient was not finite; the weights are the best before it.
    Diverged,
    /// The caller's progress function asked for it.
    Interrupted,
}

/// State of training after an epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Epochs done.
    pub epoch: usize,
    /// Loss on the training set in this epoch, dropout included, before its update.
    pub training_loss: f64,
    /// Loss on the validation set after the update; that of training where there is none.
    pub validation_loss: f64,
}

/// Course and end of a training run. Losses are weighted mean squared errors in units of the output scale.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrainingReport {
    /// Epochs done.
    pub epochs: usize,
    /// Epoch after which the weights kept were reached; 0 if the initial ones were never beaten.
    pub best_epoch: usize,
    /// Loss of the initial weights on the validation set, or on the training set where there is none.
    pub initial_loss: f64,
    /// Loss of the weights kept on the same set.
    pub best_loss: f64,
    /// Training loss of each epoch, dropout included, before its update.
    pub training_losses: Vec<f64>,
    /// Validation loss after each epoch; empty without a validation set.
    pub validation_losses: Vec<f64>,
    /// Why training ended.
    pub stop_reason: StopReason,
}

/// Trains a network, starting from the weights that it has: new ones, or those of an earlier run (warm start).
/// The normalisation stays as it is.
///
/// With a validation set, the weights kept are those with the lowest validation loss, the initial ones included;
/// without, the last ones with a finite loss. The same inputs give the same bits on the same build and machine.
/// `progress` is called after each epoch and may end the run.
///
/// # Errors
/// If a setting is out of range or a set has other channels than the network.
pub fn train(
    network: &ResidualNetwork,
    training: &TrainingSet,
    validation: Option<&TrainingSet>,
    config: &TrainingConfig,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<(ResidualNetwork, TrainingReport), Error> {
    config.validate()?;
    let mut objective = Objective::new(network, training, config.dropout, config.seed)?;
    let mut held_out =
        validation.map(|set| HeldOut::new(network, training, set, config.dropout)).transpose()?;
    let blocks = network.parameter_blocks();
    let mut weights = network.weights().to_vec();
    let mut gradient = vec![0.0; weights.len()];
    let mut adam = Adam::new(weights.len());

    let initial_loss = match &mut held_out {
        Some(held_out) => held_out.loss(&mut objective, &weights)?,
        None => objective.loss(&weights)?,
    };
    let mut kept = weights.clone();
    let mut report = TrainingReport {
        epochs: 0,
        best_epoch: 0,
        initial_loss,
        best_loss: initial_loss,
        training_losses: Vec::new(),
        validation_losses: Vec::new(),
        stop_reason: StopReason::EpochLimit,
    };
    // What the epoch before has looked ahead.
    let mut ahead = None;
    for epoch in 0..config.epochs_max {
        let training_loss = match ahead.take() {
            Some(loss) => loss,
            None => objective.loss_and_gradient(&weights, &mut gradient)?,
        };
        if !clip(&mut gradient, config.gradient_norm_max) || !training_loss.is_finite() {
            report.stop_reason = StopReason::Diverged;
            break;
        }
        if held_out.is_none() {
            report.best_epoch = epoch;
            kept.copy_from_slice(&weights);
        }
        adam.step(&blocks, config.rates(epoch), &mut weights, &gradient);
        report.epochs = epoch + 1;
        report.training_losses.push(training_loss);

        let mut validation_loss = training_loss;
        if let Some(held_out) = &mut held_out {
            // The next epoch's gradient is of the same weights.
            if epoch + 1 < config.epochs_max {
                let (loss, next) = held_out.loss_beside(&mut objective, &weights, &mut gradient)?;
                (validation_loss, ahead) = (loss, Some(next));
            } else {
                validation_loss = held_out.loss(&mut objective, &weights)?;
            }
            report.validation_losses.push(validation_loss);
            if validation_loss < report.best_loss * (1.0 - config.improvement_min) {
                report.best_loss = validation_loss;
                report.best_epoch = report.epochs;
                kept.copy_from_slice(&weights);
            }
        }
        if progress(Progress { epoch: report.epochs, training_loss, validation_loss }).is_break() {
            report.stop_reason = StopReason::Interrupted;
            break;
        }
        if held_out.is_some() && report.epochs - report.best_epoch >= config.patience {
            report.stop_reason = StopReason::EarlyStopping;
            break;
        }
    }
    if held_out.is_none() {
        report.best_loss = objective.loss(&weights)?;
        if report.best_loss.is_finite() {
            report.best_epoch = report.epochs;
            kept = weights;
        } else {
            report.stop_reason = StopReason::Diverged;
            report.best_loss = objective.loss(&kept)?;
        }
    }
    let trained =
        ResidualNetwork::from_weights(network.config().clone(), network.normalization().clone(), kept)?;
    Ok((trained, report))
}

/// Shortens a gradient to at most `norm_max`; false if it is not finite.
fn clip(gradient: &mut [f64], norm_max: f64) -> bool {
    let norm = gradient.iter().map(|value| value * value).sum::<f64>().sqrt();
    if norm > norm_max {
        gradient.iter_mut().for_each(|value| *value *= norm_max / norm);
    }
    norm.is_finite()
}

/// Pipeline of a network's layers on a set, with its input normalised.
fn pipeline(network: &ResidualNetwork, set: &TrainingSet, dropout: f64, seed: u64) -> Pipeline {
    let mut pipeline = Pipeline::new(Layers::new(network.config(), dropout, seed), set.lengths());
    network.normalize_into(set.inputs(), pipeline.input_mut());
    pipeline
}
