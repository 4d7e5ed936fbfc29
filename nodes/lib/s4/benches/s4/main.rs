//! Time of one training epoch, of one streaming step, and of convolution against recurrence.
//!
//! Setting of the project's target: 2 sequences of 1500 samples, 16 channels, 16 states, one layer, no validation.

#![allow(clippy::unwrap_used, reason = "a bench that fails should stop")]

mod scan;

use criterion::{Criterion, criterion_group, criterion_main};
use gripsight_s4::{
    Architecture, NetworkConfig, Normalization, ResidualNetwork, Sequence, TrainingConfig, TrainingSet, train,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

const LENGTH: usize = 1500;

fn noise(seed: u64, count: usize) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count).map(|_| rng.random_range(-1.0..1.0)).collect()
}

fn training_set() -> TrainingSet {
    let sequence = |seed| Sequence {
        inputs: noise(seed, 4 * LENGTH),
        targets: noise(seed + 10, 2 * LENGTH),
        weights: vec![1.0; LENGTH],
    };
    TrainingSet::new(4, 2, &[sequence(1), sequence(2)]).unwrap()
}

fn network(config: NetworkConfig, set: &TrainingSet) -> ResidualNetwork {
    ResidualNetwork::new(config, Normalization::fit(set), 0).unwrap()
}

/// Time of `epochs` epochs of forward, backward and update, set-up included.
fn time_of_training(network: &ResidualNetwork, set: &TrainingSet, epochs: u64, dropout: f64) -> Duration {
    let epochs_max = epochs as usize;
    let settings = TrainingConfig { epochs_max, patience: epochs_max, dropout, ..TrainingConfig::default() };
    let start = Instant::now();
    black_box(train(network, set, None, &settings, &mut |_| ControlFlow::Continue(())).unwrap());
    start.elapsed()
}

fn epoch(criterion: &mut Criterion) {
    let set = training_set();
    let mut group = criterion.benchmark_group("epoch");
    let base = NetworkConfig::default;
    let cases = [
        ("s4", base(), 0.0),
        ("s4_dropout", base(), 0.1),
        ("s4_two_layers", NetworkConfig { layers: 2, ..base() }, 0.0),
        ("mlp", NetworkConfig { architecture: Architecture::Mlp, ..base() }, 0.0),
        ("rnn", NetworkConfig { architecture: Architecture::Rnn, ..base() }, 0.0),
    ];
    for (name, config, dropout) in cases {
        let network = network(config, &set);
        group.bench_function(name, |bencher| {
            bencher.iter_custom(|epochs| time_of_training(&network, &set, epochs, dropout));
        });
    }
    group.finish();
}

fn step(criterion: &mut Criterion) {
    let set = training_set();
    let mut group = criterion.benchmark_group("step");
    for (name, architecture) in
        [("s4", Architecture::S4), ("mlp", Architecture::Mlp), ("rnn", Architecture::Rnn)]
    {
        let network = network(NetworkConfig { architecture, ..NetworkConfig::default() }, &set);
        let mut state = network.stream_state();
        let mut output = [0.0; 2];
        group.bench_function(name, |bencher| {
            bencher
                .iter(|| network.step(&mut state, black_box(&[3.0, 0.1, 0.5, 0.05]), &mut output).unwrap());
        });
    }
    group.finish();
}

/// The S4D layer of the target, forward and backward, by the direct recurrence (see [`scan`]); and the whole
/// network's forward pass both ways. The layer by FFT costs at most `epoch/s4_two_layers - epoch/s4`, which
/// includes a dense layer and a GELU.
fn convolution_or_recurrence(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("recurrence");
    let layer = scan::Layer::new(16, 8);
    let (x, dy) = (noise(1, 16 * LENGTH), noise(2, 16 * LENGTH));
    group.bench_function("s4d_forward_backward_2x1500", |bencher| {
        bencher.iter(|| {
            for _ in 0..2 {
                black_box(layer.forward(black_box(&x)));
                black_box(layer.backward(black_box(&x), black_box(&dy)));
            }
        });
    });
    let network = network(NetworkConfig::default(), &training_set());
    let inputs = noise(3, 4 * LENGTH);
    group.bench_function("network_by_fft_1500", |bencher| {
        bencher.iter(|| network.forward_sequence(black_box(&inputs)).unwrap());
    });
    group.bench_function("network_by_step_1500", |bencher| {
        bencher.iter(|| {
            let mut state = network.stream_state();
            let mut output = [0.0; 2];
            for k in 0..LENGTH {
                let sample = [0, 1, 2, 3].map(|channel| inputs[channel * LENGTH + k]);
                network.step(&mut state, &sample, &mut output).unwrap();
            }
            output
        });
    });
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().warm_up_time(Duration::from_secs(1)).measurement_time(Duration::from_secs(3));
    targets = epoch, step, convolution_or_recurrence
}
criterion_main!(benches);
