//! The layers of a network in a row, with the buffers of a forward and a backward pass.

use crate::layers::{Backward, BlockSpec, Dense, Dropout, Elman, Gelu, Layer, Pass, S4d};
use crate::{Architecture, Error, NetworkConfig, ParameterBlock};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Random stream of the initial weights; dropout layers use the streams after it.
const INITIAL_STREAM: u64 = 0;

/// Builds the list of layers that an architecture stands for.
///
/// - S4: `dense, (s4d, gelu, dropout), dense, ..., dense`: the paper's encoder, S4D, GELU, dropout and decoder;
///   between two S4D layers a dense one mixes the channels.
/// - MLP: `dense, gelu, (dense, gelu, dropout), dense`.
/// - RNN: `dense, (elman, dropout), dense, ..., dense`.
fn build(config: &NetworkConfig, dropout: f64, seed: u64) -> Vec<Box<dyn Layer>> {
    let width = config.d_model;
    let mut layers: Vec<Box<dyn Layer>> = vec![Box::new(Dense::new(config.inputs, width))];
    for number in 0..config.layers {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(INITIAL_STREAM + 1 + number as u64);
        let dropout = Box::new(Dropout::new(width, dropout, rng));
        match config.architecture {
            Architecture::S4 => {
                if number > 0 {
                    layers.push(Box::new(Dense::new(width, width)));
                }
                layers.push(Box::new(S4d::new(width, config.d_state, [config.step_min, config.step_max])));
                layers.push(Box::new(Gelu::new(width)));
            }
            Architecture::Mlp => {
                if number == 0 {
                    layers.push(Box::new(Gelu::new(width)));
                }
                layers.push(Box::new(Dense::new(width, width)));
                layers.push(Box::new(Gelu::new(width)));
            }
            Architecture::Rnn => {
                if number > 0 {
                    layers.push(Box::new(Dense::new(width, width)));
                }
                layers.push(Box::new(Elman::new(width)));
            }
        }
        layers.push(dropout);
    }
    layers.push(Box::new(Dense::new(width, config.outputs)));
    layers
}

/// Number of values in a layer's weights.
fn weight_count(layer: &dyn Layer) -> usize {
    layer.blocks().iter().map(|(_, shape, _)| shape.iter().product::<usize>()).sum()
}

/// Layers and, per layer, the number of its weights.
pub(crate) struct Layers {
    layers: Vec<Box<dyn Layer>>,
    counts: Vec<usize>,
}

impl Layers {
    /// Layers of a network; `seed` drives dropout.
    pub(crate) fn new(config: &NetworkConfig, dropout: f64, seed: u64) -> Self {
        let layers = build(config, dropout, seed);
        let counts = layers.iter().map(|layer| weight_count(&**layer)).collect();
        Self { layers, counts }
    }

    /// Names, shapes and places of all weights.
    pub(crate) fn blocks(&self) -> Vec<ParameterBlock> {
        let mut offset = 0;
        let mut blocks = Vec::new();
        for (position, layer) in self.layers.iter().enumerate() {
            for (name, shape, group) in layer.blocks() as Vec<BlockSpec> {
                let block = ParameterBlock { name: format!("{position}.{name}"), shape, offset, group };
                offset += block.len();
                blocks.push(block);
            }
        }
        blocks
    }

    /// Number of weights in all.
    pub(crate) fn weight_count(&self) -> usize {
        self.counts.iter().sum()
    }

    /// Weights drawn from a seed.
    pub(crate) fn initial_weights(&self, seed: u64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(INITIAL_STREAM);
        let mut weights = vec![0.0; self.weight_count()];
        let mut rest = weights.as_mut_slice();
        for (layer, &count) in self.layers.iter().zip(&self.counts) {
            let (own, others) = rest.split_at_mut(count);
            layer.initialize(&mut rng, own);
            rest = others;
        }
        weights
    }

    /// Widest signal between two layers.
    pub(crate) fn width_max(&self) -> usize {
        self.layers.iter().map(|layer| layer.inputs().max(layer.outputs())).max().unwrap_or(0)
    }

    /// Streaming state of all layers.
    pub(crate) fn state_len(&self) -> usize {
        self.layers.iter().map(|layer| layer.state_len()).sum()
    }

    /// Readies all layers for [`Self::step`].
    pub(crate) fn prepare(&mut self, weights: &[f64]) {
        let mut rest = weights;
        for (layer, &count) in self.layers.iter_mut().zip(&self.counts) {
            let (own, others) = rest.split_at(count);
            layer.prepare(own);
            rest = others;
        }
    }

    /// One sample through all layers. `signals` are two buffers of [`Self::width_max`]; the input lies in the
    /// first, the output is returned.
    pub(crate) fn step<'a>(
        &self,
        weights: &[f64],
        state: &mut [f64],
        signals: &'a mut [Vec<f64>; 2],
    ) -> &'a [f64] {
        let (mut weights, mut state) = (weights, state);
        let [mut input, mut output] = signals.each_mut();
        let mut width = 0;
        for (layer, &count) in self.layers.iter().zip(&self.counts) {
            let (own, others) = weights.split_at(count);
            let (memory, memories) = state.split_at_mut(layer.state_len());
            width = layer.outputs();
            layer.step(own, memory, &input[..layer.inputs()], &mut output[..width]);
            (weights, state) = (others, memories);
            std::mem::swap(&mut input, &mut output);
        }
        &input[..width]
    }
}

/// Layers with buffers for a set of sequences.
pub(crate) struct Pipeline {
    layers: Layers,
    lengths: Vec<usize>,
    /// Input of layer `i` at `i`; the network's output last. Shapes `(width, L)`.
    signals: Vec<Vec<f64>>,
    /// Gradients by the same.
    gradients: Vec<Vec<f64>>,
}

impl Pipeline {
    /// Buffers for sequences of these lengths.
    pub(crate) fn new(layers: Layers, lengths: &[usize]) -> Self {
        let total: usize = lengths.iter().sum();
        let widths: Vec<usize> = std::iter::once(layers.layers[0].inputs())
            .chain(layers.layers.iter().map(|layer| layer.outputs()))
            .collect();
        Self {
            layers,
            lengths: lengths.to_vec(),
            signals: widths.iter().map(|width| vec![0.0; width * total]).collect(),
            gradients: widths.iter().map(|width| vec![0.0; width * total]).collect(),
        }
    }

    /// The network's input, to be filled before [`Self::forward`].
    pub(crate) fn input_mut(&mut self) -> &mut [f64] {
        &mut self.signals[0]
    }

    /// The network's output of the last [`Self::forward`].
    pub(crate) fn output(&self) -> &[f64] {
        &self.signals[self.signals.len() - 1]
    }

    /// The output's gradient, to be filled before [`Self::backward`], and the output.
    pub(crate) fn output_and_gradient_mut(&mut self) -> (&[f64], &mut [f64]) {
        let last = self.signals.len() - 1;
        (&self.signals[last], &mut self.gradients[last])
    }

    /// All layers over all sequences.
    pub(crate) fn forward(&mut self, weights: &[f64], training: bool) -> Result<(), Error> {
        let pass = Pass { lengths: &self.lengths, training };
        let mut rest = weights;
        for (index, (layer, &count)) in self.layers.layers.iter_mut().zip(&self.layers.counts).enumerate() {
            let (own, others) = rest.split_at(count);
            let (before, after) = self.signals.split_at_mut(index + 1);
            layer.forward(&pass, own, &before[index], &mut after[0])?;
            rest = others;
        }
        Ok(())
    }

    /// Gradient by the weights of what [`Self::output_and_gradient_mut`] was given.
    pub(crate) fn backward(&mut self, weights: &[f64], gradient: &mut [f64]) -> Result<(), Error> {
        let pass = Pass { lengths: &self.lengths, training: true };
        let (mut weights, mut gradient) = (weights, gradient);
        for (index, (layer, &count)) in
            self.layers.layers.iter_mut().zip(&self.layers.counts).enumerate().rev()
        {
            let (others, own) = weights.split_at(weights.len() - count);
            let (other_gradients, own_gradient) = gradient.split_at_mut(others.len());
            let (before, after) = self.gradients.split_at_mut(index + 1);
            layer.backward(
                &pass,
                Backward {
                    weights: own,
                    x: &self.signals[index],
                    y: &self.signals[index + 1],
                    dy: &after[0],
                    dx: &mut before[index],
                    gradient: own_gradient,
                },
            )?;
            (weights, gradient) = (others, other_gradients);
        }
        Ok(())
    }
}
