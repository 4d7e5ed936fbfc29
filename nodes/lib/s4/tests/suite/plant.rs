//! Signals that the tests share.

use gripsight_s4::{Architecture, NetworkConfig, Sequence, TrainingSet};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub(crate) const ARCHITECTURES: [Architecture; 3] = [Architecture::S4, Architecture::Mlp, Architecture::Rnn];

/// A small network of two hidden layers.
pub(crate) fn small(architecture: Architecture) -> NetworkConfig {
    NetworkConfig {
        architecture,
        inputs: 3,
        outputs: 2,
        d_model: 5,
        d_state: 6,
        layers: 2,
        ..NetworkConfig::default()
    }
}

/// Uniform noise in +-1.
pub(crate) fn noise(seed: u64, count: usize) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count).map(|_| rng.random_range(-1.0..1.0)).collect()
}

/// Noise in, noise out, some samples masked; lengths as given.
pub(crate) fn noise_set(seed: u64, (inputs, outputs): (usize, usize), lengths: &[usize]) -> TrainingSet {
    let sequences: Vec<Sequence> = lengths
        .iter()
        .enumerate()
        .map(|(index, &length)| Sequence {
            inputs: noise(seed + 3 * index as u64, inputs * length),
            targets: noise(seed + 3 * index as u64 + 1, outputs * length),
            weights: noise(seed + 3 * index as u64 + 2, length).iter().map(|value| value.max(0.0)).collect(),
        })
        .collect();
    TrainingSet::new(inputs, outputs, &sequences).unwrap()
}

/// A linear plant with memory: both outputs are the first input through a second-order lag (natural
/// frequency 0.25 rad a sample, damping 0.3), one its position, the other its rate. Inputs are slow random steps.
pub(crate) fn second_order_lag(seed: u64, inputs: usize, length: usize) -> Sequence {
    let (frequency, damping) = (0.25, 0.3);
    let levels = noise(seed, inputs * length);
    let mut u = vec![0.0; inputs * length];
    for (channel, row) in u.chunks_exact_mut(length).enumerate() {
        for (k, value) in row.iter_mut().enumerate() {
            *value = levels[channel * length + k / 20];
        }
    }
    let mut targets = vec![0.0; 2 * length];
    let (mut position, mut rate) = (0.0, 0.0);
    for k in 0..length {
        rate += frequency * frequency * (u[k] - position) - 2.0 * damping * frequency * rate;
        position += rate;
        targets[k] = position;
        targets[length + k] = rate;
    }
    Sequence { inputs: u, targets, weights: vec![1.0; length] }
}
