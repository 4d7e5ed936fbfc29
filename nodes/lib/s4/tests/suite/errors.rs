//! Bad input gives an error that says what and where, never a panic.

use crate::plant::{ARCHITECTURES, noise_set, small};
use gripsight_s4::{
    Architecture, Error, NetworkConfig, Normalization, ResidualNetwork, Sequence, TrainingConfig,
    TrainingSet, train,
};
use std::ops::ControlFlow;

fn network(architecture: Architecture) -> ResidualNetwork {
    ResidualNetwork::new(small(architecture), Normalization::identity(3, 2), 0).unwrap()
}

#[test]
fn sequences_must_be_whole_finite_and_not_empty() {
    for architecture in ARCHITECTURES {
        let network = network(architecture);
        assert_eq!(network.forward_sequence(&[]), Err(Error::Empty { what: "input sequence" }));
        assert!(matches!(
            network.forward_sequence(&[0.0; 7]),
            Err(Error::Length { expected: 6, actual: 7, .. })
        ));
        let inputs = [0.0, 0.0, 0.0, f64::NAN, 0.0, 0.0];
        assert!(matches!(network.forward_sequence(&inputs), Err(Error::NotFinite { index: 3, .. })));
    }
}

#[test]
fn a_refused_sample_leaves_the_state_as_it_was() {
    for architecture in ARCHITECTURES {
        let network = network(architecture);
        let mut state = network.stream_state();
        let mut output = [0.0; 2];
        network.step(&mut state, &[1.0, 2.0, 3.0], &mut output).unwrap();
        let before = state.clone();
        let infinite = [0.0, f64::INFINITY, 0.0];
        assert!(matches!(
            network.step(&mut state, &infinite, &mut output),
            Err(Error::NotFinite { index: 1, .. })
        ));
        assert!(matches!(network.step(&mut state, &[0.0; 2], &mut output), Err(Error::Length { .. })));
        assert!(matches!(network.step(&mut state, &[0.0; 3], &mut [0.0; 3]), Err(Error::Length { .. })));
        assert_eq!(state, before);
    }
}

#[test]
fn the_state_of_another_network_is_refused() {
    let network = network(Architecture::S4);
    let other = NetworkConfig { d_model: 2, ..small(Architecture::S4) };
    let mut state = ResidualNetwork::new(other, Normalization::identity(3, 2), 0).unwrap().stream_state();
    assert!(matches!(network.step(&mut state, &[0.0; 3], &mut [0.0; 2]), Err(Error::Length { .. })));
}

#[test]
fn weights_must_be_as_many_as_the_network_has() {
    let network = network(Architecture::S4);
    let rebuild = |weights| {
        ResidualNetwork::from_weights(network.config().clone(), network.normalization().clone(), weights)
    };
    let weights = network.weights().to_vec();
    assert_eq!(rebuild(weights.clone()).unwrap().weights(), weights);
    assert!(matches!(rebuild(weights[1..].to_vec()), Err(Error::Length { .. })));
    let mut poisoned = weights;
    poisoned[4] = f64::NAN;
    assert!(matches!(rebuild(poisoned), Err(Error::NotFinite { index: 4, .. })));
}

#[test]
fn shapes_that_cannot_be_built_are_refused() {
    let refused = |config: NetworkConfig| {
        let normalization = Normalization::identity(config.inputs.min(9), config.outputs);
        match ResidualNetwork::new(config, normalization, 0) {
            Err(Error::Setting { name, .. }) => name,
            other => panic!("accepted: {other:?}"),
        }
    };
    let base = NetworkConfig::default;
    assert_eq!(refused(NetworkConfig { inputs: 0, ..base() }), "inputs");
    assert_eq!(refused(NetworkConfig { d_model: usize::MAX, ..base() }), "d_model");
    assert_eq!(refused(NetworkConfig { layers: 0, ..base() }), "layers");
    assert_eq!(refused(NetworkConfig { d_state: 7, ..base() }), "d_state");
    assert_eq!(refused(NetworkConfig { step_min: f64::NAN, ..base() }), "step_min");
    assert_eq!(refused(NetworkConfig { step_max: 1e-4, ..base() }), "step_max");
}

#[test]
fn scales_must_be_positive() {
    let normalization = Normalization { input_scale: vec![1.0, 0.0, 1.0], ..Normalization::identity(3, 2) };
    let result = ResidualNetwork::new(small(Architecture::S4), normalization, 0);
    assert!(matches!(result, Err(Error::Setting { name: "input_scale", .. })));
}

#[test]
fn training_sets_are_checked() {
    let sequence = || Sequence { inputs: vec![0.5; 6], targets: vec![0.1; 4], weights: vec![1.0; 2] };
    let build = |sequence: Sequence| TrainingSet::new(3, 2, &[sequence]);
    assert!(build(sequence()).is_ok());
    assert!(matches!(TrainingSet::new(3, 2, &[]), Err(Error::Empty { .. })));
    assert!(matches!(build(Sequence { weights: vec![], ..sequence() }), Err(Error::Empty { .. })));
    assert!(matches!(build(Sequence { weights: vec![0.0; 2], ..sequence() }), Err(Error::Empty { .. })));
    assert!(matches!(build(Sequence { weights: vec![1.0, -1.0], ..sequence() }), Err(Error::Setting { .. })));
    assert!(matches!(
        build(Sequence { targets: vec![f64::NAN; 4], ..sequence() }),
        Err(Error::NotFinite { .. })
    ));
    assert!(matches!(build(Sequence { inputs: vec![0.0; 5], ..sequence() }), Err(Error::Length { .. })));
}

#[test]
fn training_refuses_bad_settings_and_foreign_sets() {
    let network = network(Architecture::S4);
    let mut ignore = |_| ControlFlow::Continue(());
    let set = noise_set(0, (3, 2), &[20]);
    let settings = TrainingConfig { dropout: 1.0, ..TrainingConfig::default() };
    let result = train(&network, &set, None, &settings, &mut ignore);
    assert!(matches!(result, Err(Error::Setting { name: "dropout", .. })));
    let foreign = noise_set(0, (4, 2), &[20]);
    let result = train(&network, &set, Some(&foreign), &TrainingConfig::default(), &mut ignore);
    assert!(matches!(result, Err(Error::Length { expected: 3, actual: 4, .. })));
}

#[test]
fn a_constant_channel_does_no_harm() {
    let sequence = Sequence { inputs: vec![3.0; 30], targets: vec![0.0; 20], weights: vec![1.0; 10] };
    let set = TrainingSet::new(3, 2, &[sequence]).unwrap();
    let normalization = Normalization::fit(&set);
    assert_eq!(normalization.input_scale, [1.0; 3]);
    assert_eq!(normalization.output_scale, [1.0; 2]);
}

#[test]
fn configurations_survive_json() {
    for architecture in ARCHITECTURES {
        let config = small(architecture);
        let text = serde_json::to_string(&config).unwrap();
        assert_eq!(serde_json::from_str::<NetworkConfig>(&text).unwrap(), config);
    }
    assert_eq!(serde_json::to_string(&Architecture::Mlp).unwrap(), "\"mlp\"");
}

#[test]
fn an_output_that_overflows_is_an_error() {
    for architecture in ARCHITECTURES {
        let network = network(architecture);
        let huge = |_| f64::MAX;
        let weights = network.weights().iter().map(huge).collect();
        let network =
            ResidualNetwork::from_weights(network.config().clone(), network.normalization().clone(), weights)
                .unwrap();
        let result = network.step(&mut network.stream_state(), &[1.0; 3], &mut [0.0; 2]);
        assert!(matches!(result, Err(Error::NotFinite { what: "output sample", .. })), "{architecture:?}");
        let result = network.forward_sequence(&[1.0; 9]);
        assert!(matches!(result, Err(Error::NotFinite { what: "output sequence", .. })), "{architecture:?}");
    }
}
