//! The layer alone against NumPy (`tests/golden/make_golden.py`).

use super::*;
use serde_json::Value;

fn numbers(golden: &Value, key: &str) -> Vec<f64> {
    golden[key].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
}

fn assert_close(actual: &[f64], expected: &[f64]) {
    assert_eq!(actual.len(), expected.len());
    for (actual, expected) in actual.iter().zip(expected) {
        approx::assert_relative_eq!(actual, expected, max_relative = 1e-11, epsilon = 1e-12);
    }
}

/// Layer, weights and length of the golden file.
fn golden() -> (Value, S4d, Vec<f64>) {
    let golden: Value = serde_json::from_str(include_str!("../../../tests/golden/golden.json")).unwrap();
    let size = |key: &str| golden[key].as_u64().unwrap() as usize;
    let layer = S4d::new(size("width"), 2 * size("pairs"), [0.1, 1.0]);
    let weights = numbers(&golden, "s4d_weights");
    (golden, layer, weights)
}

#[test]
fn the_kernel_equals_numpy() {
    let (golden, mut layer, weights) = golden();
    layer.prepare(&weights);
    let expected = numbers(&golden, "kernel");
    let length = expected.len() / layer.channels;
    for (channel, expected) in expected.chunks_exact(length).enumerate() {
        let states = channel * layer.pairs..(channel + 1) * layer.pairs;
        let mut kernel = vec![0.0; length];
        kernel::fill(&mut kernel, &layer.discrete.a_bar[states.clone()], &layer.discrete.c_bar[states]);
        assert_close(&kernel, expected);
    }
}

#[test]
fn the_layer_equals_numpy() {
    let (golden, mut layer, weights) = golden();
    let x = numbers(&golden, "s4d_input");
    let mut y = vec![0.0; x.len()];
    let lengths = [x.len() / layer.channels];
    layer.forward(&Pass { lengths: &lengths, training: false }, &weights, &x, &mut y).unwrap();
    assert_close(&y, &numbers(&golden, "s4d_output"));
}

#[test]
fn sequences_do_not_see_each_other() {
    let (golden, mut layer, weights) = golden();
    let x = numbers(&golden, "s4d_input");
    let length = x.len() / layer.channels;
    let mut y = vec![0.0; x.len()];
    layer.forward(&Pass { lengths: &[20, length - 20], training: false }, &weights, &x, &mut y).unwrap();
    for (row, expected) in y.chunks_exact(length).zip(numbers(&golden, "s4d_output").chunks_exact(length)) {
        assert_close(&row[..20], &expected[..20]);
        assert!(
            (row[20] - expected[20]).abs() > 1e-3,
            "the second sequence starts with the first one's memory"
        );
    }
}

#[test]
fn the_start_is_s4d_lin() {
    use rand::SeedableRng;
    let layer = S4d::new(3, 8, [0.1, 1.0]);
    let count = layer.blocks().iter().map(|(_, shape, _)| shape.iter().product::<usize>()).sum();
    let mut weights = vec![0.0; count];
    layer.initialize(&mut ChaCha8Rng::seed_from_u64(1), &mut weights);
    let parameters = layer.parameters(&weights);
    assert!(parameters.log_dt.iter().all(|log_dt| (0.1..=1.0).contains(&log_dt.exp())));
    for (_, index) in parameters.states() {
        approx::assert_relative_eq!(-parameters.log_a_real[index].exp(), -0.5);
        approx::assert_relative_eq!(parameters.a_imag[index], PI * (index % 4) as f64);
    }
}
