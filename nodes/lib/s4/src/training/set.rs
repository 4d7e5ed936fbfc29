//! What a network is trained on.

use crate::error::{Error, require_finite, require_length};

/// One uninterrupted sequence, channel-major. A network starts at rest at its first sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Sequence {
    /// Inputs, shape `(inputs, L)`, in physical units.
    pub inputs: Vec<f64>,
    /// Residuals to learn, shape `(outputs, L)`, in physical units.
    pub targets: Vec<f64>,
    /// Weight of each sample in the loss, shape `(L)`, not negative: 0 masks gaps, warm-up and samples held out.
    pub weights: Vec<f64>,
}

/// Several sequences, checked and laid out for training: channel-major, one sequence after the other in time.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainingSet {
    inputs: Vec<f64>,
    targets: Vec<f64>,
    weights: Vec<f64>,
    lengths: Vec<usize>,
    channels: (usize, usize),
}

impl TrainingSet {
    /// Checks and joins sequences of `inputs` and `outputs` channels.
    ///
    /// # Errors
    /// If there is no sequence, one is empty, a length does not fit its number of weights, a value is not finite, a
    /// weight is negative, or all weights are zero.
    pub fn new(inputs: usize, outputs: usize, sequences: &[Sequence]) -> Result<Self, Error> {
        if sequences.is_empty() {
            return Err(Error::Empty { what: "training set" });
        }
        for sequence in sequences {
            let length = sequence.weights.len();
            if length == 0 {
                return Err(Error::Empty { what: "training sequence" });
            }
            require_length("sequence inputs", inputs * length, sequence.inputs.len())?;
            require_length("sequence targets", outputs * length, sequence.targets.len())?;
            require_finite("sequence inputs", &sequence.inputs)?;
            require_finite("sequence targets", &sequence.targets)?;
            require_finite("sequence weights", &sequence.weights)?;
            if let Some(&value) = sequence.weights.iter().find(|&&weight| weight < 0.0) {
                return Err(Error::Setting { name: "sequence weight", value, expected: "at least 0" });
            }
        }
        let weights: Vec<f64> =
            sequences.iter().flat_map(|sequence| sequence.weights.iter().copied()).collect();
        if weights.iter().all(|&weight| weight == 0.0) {
            return Err(Error::Empty { what: "training set: every weight is 0" });
        }
        Ok(Self {
            inputs: join(sequences, inputs, |sequence| &sequence.inputs),
            targets: join(sequences, outputs, |sequence| &sequence.targets),
            weights,
            lengths: sequences.iter().map(|sequence| sequence.weights.len()).collect(),
            channels: (inputs, outputs),
        })
    }

    /// Samples over all sequences.
    #[must_use]
    pub fn total_length(&self) -> usize {
        self.weights.len()
    }

    /// Length of each sequence, in samples.
    #[must_use]
    pub fn lengths(&self) -> &[usize] {
        &self.lengths
    }

    /// Whether it differs from another set in weights alone.
    pub(super) fn has_samples_of(&self, other: &Self) -> bool {
        self.channels == other.channels
            && self.lengths == other.lengths
            && self.inputs == other.inputs
            && self.targets == other.targets
    }

    /// Number of input and of output channels.
    #[must_use]
    pub fn channels(&self) -> (usize, usize) {
        self.channels
    }

    /// Inputs, shape `(inputs, total length)`.
    #[must_use]
    pub fn inputs(&self) -> &[f64] {
        &self.inputs
    }

    /// Targets, shape `(outputs, total length)`.
    #[must_use]
    pub fn targets(&self) -> &[f64] {
        &self.targets
    }

    /// Weight of each sample, shape `(total length)`.
    #[must_use]
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }
}

/// Row `i` of the result is row `i` of every sequence, one after the other.
fn join(sequences: &[Sequence], channels: usize, rows: impl Fn(&Sequence) -> &[f64]) -> Vec<f64> {
    let mut joined = Vec::new();
    for channel in 0..channels {
        for sequence in sequences {
            let length = sequence.weights.len();
            joined.extend_from_slice(&rows(sequence)[channel * length..][..length]);
        }
    }
    joined
}
