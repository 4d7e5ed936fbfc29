//! A residual network: configuration, normalisation and weights, with the two ways to run it.

use crate::error::{Error, require_finite, require_length};
use crate::layers::ParameterBlock;
use crate::pipeline::{Layers, Pipeline};
use crate::training::{TrainingSet, loss_and_gradient};
use crate::{NetworkConfig, Normalization};
use std::sync::Arc;

/// A network that predicts residuals from state and input sequences, of any [`Architecture`](crate::Architecture).
///
/// Cheap to clone but for its weights. Sequences are channel-major: `(inputs, L)` in, `(outputs, L)` out.
#[derive(Clone)]
pub struct ResidualNetwork {
    config: NetworkConfig,
    normalization: Normalization,
    weights: Vec<f64>,
    layers: Arc<Layers>,
}

/// Memory of a network that runs sample by sample; starts and restarts at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct StreamState {
    memory: Vec<f64>,
    signals: [Vec<f64>; 2],
}

impl StreamState {
    /// Forgets every sample seen.
    pub fn reset(&mut self) {
        self.memory.fill(0.0);
    }
}

/// Loss of a network on a set and its gradient by every weight.
#[derive(Debug, Clone, PartialEq)]
pub struct Gradients {
    /// Weighted mean squared error in units of the output scale.
    pub loss: f64,
    /// Gradient by the weights, in their order.
    pub values: Vec<f64>,
}

impl std::fmt::Debug for ResidualNetwork {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ResidualNetwork")
            .field("config", &self.config)
            .field("normalization", &self.normalization)
            .field("weights", &self.weights)
            .finish_non_exhaustive()
    }
}

impl ResidualNetwork {
    /// A network with initial weights drawn from `seed`.
    ///
    /// # Errors
    /// If the configuration or the normalisation is invalid.
    pub fn new(config: NetworkConfig, normalization: Normalization, seed: u64) -> Result<Self, Error> {
        config.validate()?;
        let weights = Layers::new(&config, 0.0, 0).initial_weights(seed);
        Self::from_weights(config, normalization, weights)
    }

    /// A network with given weights, such as those of a message.
    ///
    /// # Errors
    /// If the configuration or the normalisation is invalid, or the weights are not as many as it needs or
    /// not finite.
    pub fn from_weights(
        config: NetworkConfig,
        normalization: Normalization,
        weights: Vec<f64>,
    ) -> Result<Self, Error> {
        config.validate()?;
        normalization.validate(config.inputs, config.outputs)?;
        let mut layers = Layers::new(&config, 0.0, 0);
        require_length("weights", layers.weight_count(), weights.len())?;
        require_finite("weights", &weights)?;
        layers.prepare(&weights);
        Ok(Self { config, normalization, weights, layers: Arc::new(layers) })
    }

    /// Its shape.
    #[must_use]
    pub fn config(&self) -> &NetworkConfig {
        &self.config
    }

    /// Its input and output maps.
    #[must_use]
    pub fn normalization(&self) -> &Normalization {
        &self.normalization
    }

    /// All weights in one row, in the order of [`Self::parameter_blocks`].
    #[must_use]
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Names, shapes and places of the weights.
    #[must_use]
    pub fn parameter_blocks(&self) -> Vec<ParameterBlock> {
        self.layers.blocks()
    }

    /// Outputs for one whole sequence from rest: `inputs` has shape `(inputs, L)`, the result `(outputs, L)`, both
    /// in physical units. S4D layers convolve by FFT.
    ///
    /// # Errors
    /// If `inputs` is empty, not a multiple of the number of channels, or not finite; or if the output overflows.
    pub fn forward_sequence(&self, inputs: &[f64]) -> Result<Vec<f64>, Error> {
        if inputs.is_empty() {
            return Err(Error::Empty { what: "input sequence" });
        }
        let length = inputs.len() / self.config.inputs;
        require_length("input sequence", length * self.config.inputs, inputs.len())?;
        require_finite("input sequence", inputs)?;
        let mut pipeline = Pipeline::new(Layers::new(&self.config, 0.0, 0), &[length]);
        self.normalize_into(inputs, pipeline.input_mut());
        pipeline.forward(&self.weights, false)?;
        let mut outputs = pipeline.output().to_vec();
        for (row, scale) in outputs.chunks_exact_mut(length).zip(&self.normalization.output_scale) {
            row.iter_mut().for_each(|value| *value *= scale);
        }
        require_finite("output sequence", &outputs)?;
        Ok(outputs)
    }

    /// Memory at rest, for [`Self::step`].
    #[must_use]
    pub fn stream_state(&self) -> StreamState {
        let width = self.layers.width_max();
        StreamState {
            memory: vec![0.0; self.layers.state_len()],
            signals: [vec![0.0; width], vec![0.0; width]],
        }
    }

    /// One sample: the recurrence that [`Self::forward_sequence`] equals to rounding. Allocates nothing.
    ///
    /// # Errors
    /// If a slice or the state does not fit this network, or the input is not finite: the state is then unchanged. If the
    /// output overflows: the state is then of no more use.
    pub fn step(&self, state: &mut StreamState, input: &[f64], output: &mut [f64]) -> Result<(), Error> {
        require_length("input sample", self.config.inputs, input.len())?;
        require_length("output sample", self.config.outputs, output.len())?;
        require_length("stream state", self.layers.state_len(), state.memory.len())?;
        require_length("stream buffer", self.layers.width_max(), state.signals[0].len())?;
        require_finite("input sample", input)?;
        let Normalization { input_mean, input_scale, output_scale } = &self.normalization;
        for (((x, value), mean), scale) in
            state.signals[0].iter_mut().zip(input).zip(input_mean).zip(input_scale)
        {
            *x = (value - mean) / scale;
        }
        let result = self.layers.step(&self.weights, &mut state.memory, &mut state.signals);
        for ((output, value), scale) in output.iter_mut().zip(result).zip(output_scale) {
            *output = value * scale;
        }
        require_finite("output sample", output)
    }

    /// Loss on a set and its gradient by every weight, without dropout.
    ///
    /// # Errors
    /// If the set has other channels than this network.
    pub fn gradients(&self, set: &TrainingSet) -> Result<Gradients, Error> {
        loss_and_gradient(self, set)
    }

    /// Physical to network units, `(inputs, L)`.
    pub(crate) fn normalize_into(&self, inputs: &[f64], normalized: &mut [f64]) {
        let length = inputs.len() / self.config.inputs;
        let rows = inputs.chunks_exact(length).zip(normalized.chunks_exact_mut(length));
        let maps = self.normalization.input_mean.iter().zip(&self.normalization.input_scale);
        for ((row, normalized), (mean, scale)) in rows.zip(maps) {
            for (x, value) in normalized.iter_mut().zip(row) {
                *x = (value - mean) / scale;
            }
        }
    }
}
