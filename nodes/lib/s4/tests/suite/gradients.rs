//! Every analytic gradient against central differences of the loss.

use crate::plant::{ARCHITECTURES, noise_set, small};
use gripsight_s4::{Architecture, NetworkConfig, Normalization, ResidualNetwork, TrainingSet};

/// Largest difference to the central difference, relative to the largest gradient of the same block.
fn check(config: NetworkConfig, set: &TrainingSet) {
    let network = ResidualNetwork::new(config, Normalization::fit(set), 7).unwrap();
    let analytic = network.gradients(set).unwrap().values;
    let loss = |weights: Vec<f64>| {
        ResidualNetwork::from_weights(network.config().clone(), network.normalization().clone(), weights)
            .unwrap()
            .evaluate(set)
            .unwrap()
            .loss
    };
    for block in network.parameter_blocks() {
        let range = block.offset..block.offset + block.len();
        let largest = analytic[range.clone()].iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        assert!(largest > 1e-12, "{:?} {}: no gradient at all", network.config().architecture, block.name);
        for index in range {
            let h = 1e-5;
            let shifted = |by: f64| {
                let mut weights = network.weights().to_vec();
                weights[index] += by;
                loss(weights)
            };
            let numeric = (shifted(h) - shifted(-h)) / (2.0 * h);
            let difference = (numeric - analytic[index]).abs();
            assert!(
                difference <= 1e-6 * largest + 1e-10,
                "{:?} {}[{}]: analytic {}, central difference {numeric}",
                network.config().architecture,
                block.name,
                index - block.offset,
                analytic[index],
            );
        }
    }
}

#[test]
fn every_weight_of_every_architecture_has_its_central_difference() {
    for architecture in ARCHITECTURES {
        let config = small(architecture);
        check(config.clone(), &noise_set(1, (config.inputs, config.outputs), &[90, 37, 64]));
    }
}

#[test]
fn sequences_of_one_sample_and_single_channels_have_right_gradients() {
    for architecture in ARCHITECTURES {
        let config = NetworkConfig {
            architecture,
            inputs: 1,
            outputs: 1,
            d_model: 2,
            d_state: 2,
            ..NetworkConfig::default()
        };
        check(config, &noise_set(20, (1, 1), &[1, 9, 2]));
    }
}

#[test]
fn long_memory_has_right_gradients() {
    let config = NetworkConfig {
        architecture: Architecture::S4,
        d_model: 3,
        d_state: 8,
        step_min: 1e-3,
        step_max: 1e-3,
        ..NetworkConfig::default()
    };
    check(config, &noise_set(5, (4, 2), &[700]));
}
