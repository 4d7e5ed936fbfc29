//! The layers that a network is a list of.
//!
//! Sequences are channel-major: channel `i` of a width-`n` signal over `L` samples is the contiguous
//! row `[i * L .. (i + 1) * L]`. Several sequences of one set lie one after the other along the
//! time axis; only layers with memory look at where each begins.

mod dense;
mod dropout;
mod elman;
mod gelu;
pub(crate) mod s4d;

pub(crate) use dense::Dense;
pub(crate) use dropout::Dropout;
pub(crate) use elman::Elman;
pub(crate) use gelu::Gelu;
pub(crate) use s4d::S4d;

use crate::Error;
use rand_chacha::ChaCha8Rng;

/// How the optimiser treats a block of weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterGroup {
    /// Ordinary weights: the learning rate, and weight decay.
    Ordinary,
    /// `log_dt, log_a_real, a_imag`: their own rate, no decay.
    StateSpace,
}

/// One named block of the flat weight vector, row-major.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ParameterBlock {
    /// Name: the layer's position in the network and its parameter's name, such as `1.log_dt`.
    pub name: String,
    /// Shape, slowest dimension first.
    pub shape: Vec<usize>,
    /// Index of its first value in the flat vector.
    pub offset: usize,
    /// How the optimiser treats it.
    pub group: ParameterGroup,
}

impl ParameterBlock {
    /// Number of values.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Whether the block holds nothing; never so in a valid network.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A block as a layer declares it: name, shape, group.
pub(crate) type BlockSpec = (&'static str, Vec<usize>, ParameterGroup);

/// What a pass over sequences is about.
pub(crate) struct Pass<'a> {
    /// Lengths of the sequences, in order.
    pub(crate) lengths: &'a [usize],
    /// Whether `backward` follows and dropout is active.
    pub(crate) training: bool,
}

impl Pass<'_> {
    /// Samples over all sequences.
    pub(crate) fn total(&self) -> usize {
        self.lengths.iter().sum()
    }

    /// First sample and length of every sequence.
    pub(crate) fn segments(&self) -> impl Iterator<Item = (usize, usize)> {
        self.lengths.iter().scan(0, |next, &length| {
            let start = *next;
            *next += length;
            Some((start, length))
        })
    }
}

/// Signals and gradients of one layer in a backward pass; shapes `(width, L)`.
pub(crate) struct Backward<'a> {
    /// The layer's weights.
    pub(crate) weights: &'a [f64],
    /// Its input in the forward pass.
    pub(crate) x: &'a [f64],
    /// Its output in the forward pass.
    pub(crate) y: &'a [f64],
    /// Gradient of the loss by the output.
    pub(crate) dy: &'a [f64],
    /// Gradient by the input, to be overwritten.
    pub(crate) dx: &'a mut [f64],
    /// Gradient by the weights, to be overwritten.
    pub(crate) gradient: &'a mut [f64],
}

/// A layer: sequence to sequence with gradients, and the same map one sample at a time.
pub(crate) trait Layer: Send + Sync {
    /// Number of input channels.
    fn inputs(&self) -> usize;

    /// Number of output channels.
    fn outputs(&self) -> usize {
        self.inputs()
    }

    /// The weights, in the order in which they lie.
    fn blocks(&self) -> Vec<BlockSpec> {
        Vec::new()
    }

    /// Draws initial weights.
    fn initialize(&self, _rng: &mut ChaCha8Rng, _weights: &mut [f64]) {}

    /// Output for whole sequences from rest; keeps what `backward` needs.
    fn forward(&mut self, pass: &Pass, weights: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Error>;

    /// Gradients for the sequences of the last training `forward`.
    fn backward(&mut self, pass: &Pass, signals: Backward) -> Result<(), Error>;

    /// Numbers of state that streaming carries.
    fn state_len(&self) -> usize {
        0
    }

    /// Computes once what `step` needs of the weights.
    fn prepare(&mut self, _weights: &[f64]) {}

    /// One sample; allocates nothing. Needs `prepare`.
    fn step(&self, weights: &[f64], state: &mut [f64], x: &[f64], y: &mut [f64]);
}

/// Sum of products, in eight interleaved partial sums so that it can run in vector registers.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a_blocks, a_rest) = a.as_chunks::<8>();
    let (b_blocks, b_rest) = b.as_chunks::<8>();
    for (x, y) in a_blocks.iter().zip(b_blocks) {
        for ((sum, x), y) in sums.iter_mut().zip(x).zip(y) {
            *sum += x * y;
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    sums.iter().sum::<f64>() + rest
}

/// `y += factor * x`.
pub(crate) fn add_scaled(y: &mut [f64], factor: f64, x: &[f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += factor * x;
    }
}
