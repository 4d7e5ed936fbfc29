//! The S4 network against NumPy (`tests/golden/make_golden.py`).

use gripsight_s4::{Architecture, NetworkConfig, Normalization, ResidualNetwork};
use serde_json::Value;

fn golden() -> Value {
    serde_json::from_str(include_str!("../golden/golden.json")).unwrap()
}

fn numbers(golden: &Value, key: &str) -> Vec<f64> {
    golden[key].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
}

/// The golden network with its own normalisation.
fn network(golden: &Value) -> ResidualNetwork {
    let config = NetworkConfig {
        architecture: Architecture::S4,
        d_model: golden["width"].as_u64().unwrap() as usize,
        d_state: 2 * golden["pairs"].as_u64().unwrap() as usize,
        ..NetworkConfig::default()
    };
    let normalization = Normalization {
        input_mean: numbers(golden, "input_mean"),
        input_scale: numbers(golden, "input_scale"),
        output_scale: numbers(golden, "output_scale"),
    };
    ResidualNetwork::from_weights(config, normalization, numbers(golden, "network_weights")).unwrap()
}

#[test]
fn the_whole_network_equals_numpy_at_once_and_streamed() {
    let golden = golden();
    let network = network(&golden);
    let (inputs, expected) = (numbers(&golden, "inputs"), numbers(&golden, "outputs"));
    let outputs = network.forward_sequence(&inputs).unwrap();
    for (output, expected) in outputs.iter().zip(&expected) {
        approx::assert_relative_eq!(output, expected, max_relative = 1e-11, epsilon = 1e-11);
    }
    let length = inputs.len() / 4;
    let mut state = network.stream_state();
    for k in 0..length {
        let sample = [0, 1, 2, 3].map(|channel| inputs[channel * length + k]);
        let mut output = [0.0; 2];
        network.step(&mut state, &sample, &mut output).unwrap();
        for channel in 0..2 {
            let expected = expected[channel * length + k];
            approx::assert_relative_eq!(output[channel], expected, max_relative = 1e-11, epsilon = 1e-11);
        }
    }
}

#[test]
fn the_weights_lie_in_the_order_that_the_message_documents() {
    let golden = golden();
    let network = network(&golden);
    let names: Vec<String> = network.parameter_blocks().into_iter().map(|block| block.name).collect();
    let expected =
        ["0.weight", "0.bias", "1.log_dt", "1.log_a_real", "1.a_imag", "1.c", "1.d", "4.weight", "4.bias"];
    assert_eq!(names, expected);
    let blocks = network.parameter_blocks();
    let end = blocks.last().map(|block| block.offset + block.len());
    assert_eq!(end, Some(network.weights().len()));
}
