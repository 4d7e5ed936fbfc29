//! Prints as CSV what training and streaming cost over sequence length, width and states.
//!
//!     cargo run --release -p gripsight_s4 --example cost

use gripsight_s4::{
    Architecture, Error, NetworkConfig, Normalization, ResidualNetwork, Sequence, TrainingConfig,
    TrainingSet, train,
};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

const EPOCHS: usize = 41;
const STEPS: usize = 20_000;

/// Two sequences of `length` samples of a few incommensurable sines.
fn training_set(length: usize) -> Result<TrainingSet, Error> {
    let wave = |count: usize, frequency: f64| (0..count).map(|k| (frequency * k as f64).sin()).collect();
    let sequence = |frequency: f64| Sequence {
        inputs: wave(4 * length, frequency),
        targets: wave(2 * length, 1.7 * frequency),
        weights: vec![1.0; length],
    };
    TrainingSet::new(4, 2, &[sequence(0.11), sequence(0.17)])
}

/// Median milliseconds of an epoch (forward, backward, update), the first one left out.
fn epoch_ms(network: &ResidualNetwork, set: &TrainingSet) -> Result<f64, Error> {
    let settings = TrainingConfig { epochs_max: EPOCHS, patience: EPOCHS, ..TrainingConfig::default() };
    let mut times: Vec<Duration> = Vec::new();
    let mut last = Instant::now();
    train(network, set, None, &settings, &mut |_| {
        times.push(last.elapsed());
        last = Instant::now();
        ControlFlow::Continue(())
    })?;
    let mut times = times.split_off(1);
    times.sort();
    Ok(times[times.len() / 2].as_secs_f64() * 1e3)
}

/// Mean microseconds of a streaming step.
fn step_us(network: &ResidualNetwork) -> Result<f64, Error> {
    let mut state = network.stream_state();
    let mut output = [0.0; 2];
    let start = Instant::now();
    for k in 0..STEPS {
        network.step(&mut state, &[3.0, 0.1, 0.5, 0.01 * (k % 7) as f64], &mut output)?;
    }
    Ok(start.elapsed().as_secs_f64() * 1e6 / STEPS as f64)
}

fn main() -> Result<(), Error> {
    println!("curve,architecture,samples,d_model,d_state,layers,weights,epoch_ms,step_us");
    let base = NetworkConfig::default;
    let mut rows: Vec<(&str, usize, NetworkConfig)> = Vec::new();
    for architecture in [Architecture::S4, Architecture::Mlp, Architecture::Rnn] {
        for length in [250, 500, 1000, 1500, 2000, 4000, 8000, 16_000] {
            rows.push(("length", length, NetworkConfig { architecture, ..base() }));
        }
        for d_model in [4, 8, 16, 32, 64] {
            rows.push(("d_model", 1500, NetworkConfig { architecture, d_model, ..base() }));
        }
    }
    for d_state in [4, 8, 16, 32, 64] {
        rows.push(("d_state", 1500, NetworkConfig { d_state, ..base() }));
    }
    for (curve, length, config) in rows {
        let set = training_set(length)?;
        let network = ResidualNetwork::new(config, Normalization::fit(&set), 0)?;
        let NetworkConfig { architecture, d_model, d_state, layers, .. } = network.config();
        let (weights, epoch, step) = (network.weights().len(), epoch_ms(&network, &set)?, step_us(&network)?);
        let samples = set.total_length();
        println!(
            "{curve},{architecture:?},{samples},{d_model},{d_state},{layers},{weights},{epoch:.3},{step:.3}"
        );
    }
    Ok(())
}
