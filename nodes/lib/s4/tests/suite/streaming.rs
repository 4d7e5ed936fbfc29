//! Sample by sample equals the whole sequence at once.

use crate::plant::{ARCHITECTURES, noise, small};
use gripsight_s4::{Architecture, NetworkConfig, Normalization, ResidualNetwork};
use proptest::prelude::*;

/// Outputs of `step` over a channel-major sequence, channel-major.
fn streamed(network: &ResidualNetwork, inputs: &[f64]) -> Vec<f64> {
    let (n, m) = (network.config().inputs, network.config().outputs);
    let length = inputs.len() / n;
    let mut state = network.stream_state();
    let (mut sample, mut output) = (vec![0.0; n], vec![0.0; m]);
    let mut outputs = vec![0.0; m * length];
    for k in 0..length {
        for channel in 0..n {
            sample[channel] = inputs[channel * length + k];
        }
        network.step(&mut state, &sample, &mut output).unwrap();
        for channel in 0..m {
            outputs[channel * length + k] = output[channel];
        }
    }
    outputs
}

fn normalization(inputs: usize, outputs: usize) -> Normalization {
    Normalization {
        input_mean: (0..inputs).map(|i| 0.1 * i as f64).collect(),
        input_scale: (0..inputs).map(|i| 0.5 + i as f64).collect(),
        output_scale: (0..outputs).map(|i| 2.0 + i as f64).collect(),
    }
}

fn assert_equal_to_rounding(network: &ResidualNetwork, inputs: &[f64]) {
    let whole = network.forward_sequence(inputs).unwrap();
    let scale = whole.iter().fold(1e-3_f64, |largest, value| largest.max(value.abs()));
    for (index, (whole, step)) in whole.iter().zip(streamed(network, inputs)).enumerate() {
        assert!((whole - step).abs() <= 1e-11 * scale, "value {index}: {whole} at once, {step} streamed");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn convolution_equals_recurrence(
        d_model in 1_usize..7,
        pairs in 1_usize..7,
        layers in 1_usize..3,
        length in 1_usize..500,
        log_step in -8.0_f64..-0.5,
        seed in any::<u64>(),
    ) {
        let step = log_step.exp();
        let config = NetworkConfig {
            architecture: Architecture::S4,
            d_model,
            d_state: 2 * pairs,
            layers,
            step_min: step,
            step_max: 1.5 * step,
            ..NetworkConfig::default()
        };
        let network = ResidualNetwork::new(config, normalization(4, 2), seed).unwrap();
        assert_equal_to_rounding(&network, &noise(seed, 4 * length));
    }

    #[test]
    fn s4d_is_causal(cut in 1_usize..200, seed in any::<u64>()) {
        let config = NetworkConfig { inputs: 1, outputs: 1, d_model: 4, ..NetworkConfig::default() };
        let network = ResidualNetwork::new(config, normalization(1, 1), seed).unwrap();
        let inputs = noise(seed, 200);
        let mut changed = inputs.clone();
        changed[cut..].iter_mut().for_each(|value| *value += 1.0);
        let (before, after) =
            (network.forward_sequence(&inputs).unwrap(), network.forward_sequence(&changed).unwrap());
        for k in 0..cut {
            prop_assert!((before[k] - after[k]).abs() < 1e-11);
        }
    }
}

#[test]
fn every_architecture_streams_what_it_computes_at_once() {
    for architecture in ARCHITECTURES {
        let config = small(architecture);
        let network =
            ResidualNetwork::new(config.clone(), normalization(config.inputs, config.outputs), 3).unwrap();
        assert_equal_to_rounding(&network, &noise(4, config.inputs * 300));
    }
}

#[test]
fn a_reset_state_is_a_new_one() {
    for architecture in ARCHITECTURES {
        let network = ResidualNetwork::new(small(architecture), normalization(3, 2), 3).unwrap();
        let mut state = network.stream_state();
        let (mut first, mut again) = ([0.0; 2], [0.0; 2]);
        network.step(&mut state, &[1.0, -1.0, 0.5], &mut first).unwrap();
        network.step(&mut state, &[0.3, 0.2, 0.1], &mut again).unwrap();
        state.reset();
        network.step(&mut state, &[1.0, -1.0, 0.5], &mut again).unwrap();
        assert_eq!(first, again);
    }
}

#[test]
fn a_step_allocates_nothing() {
    for architecture in ARCHITECTURES {
        let network = ResidualNetwork::new(small(architecture), normalization(3, 2), 3).unwrap();
        let mut state = network.stream_state();
        let mut output = [0.0; 2];
        let counted = allocation_counter::measure(|| {
            for _ in 0..10 {
                network.step(&mut state, &[1.0, -1.0, 0.5], &mut output).unwrap();
            }
        });
        assert_eq!(counted.count_total, 0, "{architecture:?}");
    }
}
