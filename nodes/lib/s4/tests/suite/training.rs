//! What training achieves, and that it does so again.

use crate::plant::{ARCHITECTURES, noise_set, second_order_lag, small};
use gripsight_s4::{
    Architecture, NetworkConfig, Normalization, ResidualNetwork, StopReason, TrainingConfig, TrainingReport,
    TrainingSet, train,
};
use std::ops::ControlFlow;

fn lag_sets(inputs: usize) -> (TrainingSet, TrainingSet) {
    let set = |seeds: &[u64]| {
        let sequences: Vec<_> = seeds.iter().map(|&seed| second_order_lag(seed, inputs, 400)).collect();
        TrainingSet::new(inputs, 2, &sequences).unwrap()
    };
    (set(&[1, 2]), set(&[3]))
}

fn run(
    config: NetworkConfig,
    (training, validation): (&TrainingSet, Option<&TrainingSet>),
    settings: &TrainingConfig,
) -> (ResidualNetwork, TrainingReport) {
    let network = ResidualNetwork::new(config, Normalization::fit(training), 11).unwrap();
    train(&network, training, validation, settings, &mut |_| ControlFlow::Continue(())).unwrap()
}

#[test]
fn s4_learns_a_second_order_lag_that_no_memoryless_network_can() {
    let (training, held_out) = lag_sets(2);
    let settings = TrainingConfig { epochs_max: 400, weight_decay: 0.0, ..TrainingConfig::default() };
    let loss = |architecture| {
        let config = NetworkConfig { architecture, inputs: 2, ..NetworkConfig::default() };
        let (network, report) = run(config, (&training, Some(&held_out)), &settings);
        let loss = network.evaluate(&held_out).unwrap().loss;
        approx::assert_relative_eq!(loss, report.best_loss, max_relative = 1e-9);
        loss
    };
    let (s4, mlp) = (loss(Architecture::S4), loss(Architecture::Mlp));
    assert!(s4 < 0.01, "S4 leaves {s4} of the variance");
    assert!(mlp > 0.3, "the lag cannot be known without memory, yet the MLP leaves only {mlp}");
    assert!(s4 < 0.03 * mlp, "S4 {s4}, MLP {mlp}");
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_does_not() {
    for architecture in ARCHITECTURES {
        let set = noise_set(9, (3, 2), &[80, 50]);
        let settings = TrainingConfig { epochs_max: 20, dropout: 0.1, ..TrainingConfig::default() };
        let weights = |seed| {
            let settings = TrainingConfig { seed, ..settings.clone() };
            run(small(architecture), (&set, None), &settings).0.weights().to_vec()
        };
        let bits = |weights: Vec<f64>| weights.into_iter().map(f64::to_bits).collect::<Vec<_>>();
        let first = bits(weights(5));
        assert_eq!(first, bits(weights(5)), "{architecture:?}");
        assert_ne!(first, bits(weights(6)), "{architecture:?}: dropout ignores the seed");
    }
}

#[test]
fn early_stopping_keeps_the_best_weights_and_never_worse_than_the_start() {
    // Noise cannot be learned: the training loss falls while that of other noise rises.
    let (training, validation) = (noise_set(1, (3, 2), &[60]), noise_set(50, (3, 2), &[60]));
    let settings = TrainingConfig { patience: 15, weight_decay: 0.0, ..TrainingConfig::default() };
    let (network, report) = run(small(Architecture::S4), (&training, Some(&validation)), &settings);
    assert_eq!(report.stop_reason, StopReason::EarlyStopping);
    assert_eq!(report.epochs, report.best_epoch + 15);
    assert!(report.best_loss <= report.initial_loss);
    approx::assert_relative_eq!(network.evaluate(&validation).unwrap().loss, report.best_loss);
    let last = report.validation_losses.last().copied().unwrap();
    assert!(last > report.best_loss, "the last loss {last} should be above the best {}", report.best_loss);
}

#[test]
fn samples_held_out_of_the_same_sequences_are_judged_as_those_of_others() {
    let sequence = second_order_lag(1, 2, 300);
    let part = |held_out: bool| {
        let weights = (0..300).map(|k| f64::from(u8::from((k / 50 % 2 == 1) == held_out))).collect();
        TrainingSet::new(2, 2, &[gripsight_s4::Sequence { weights, ..sequence.clone() }]).unwrap()
    };
    let (training, beside) = (part(false), part(true));
    // What a sample of no weight should have been tells nothing, and makes the two sets differ.
    let mut other = sequence.clone();
    other.targets[0] += 1.0;
    let apart =
        TrainingSet::new(2, 2, &[gripsight_s4::Sequence { weights: beside.weights().to_vec(), ..other }]);
    let config = NetworkConfig { inputs: 2, ..NetworkConfig::default() };
    let settings = TrainingConfig { epochs_max: 12, ..TrainingConfig::default() };
    let trained = |held_out: &TrainingSet| run(config.clone(), (&training, Some(held_out)), &settings);
    let ((one, of_one), (two, of_two)) = (trained(&beside), trained(&apart.unwrap()));
    assert_eq!((one.weights(), of_one), (two.weights(), of_two));
}

#[test]
fn a_warm_start_goes_on_where_training_ended() {
    let (training, held_out) = lag_sets(1);
    let config = NetworkConfig { inputs: 1, d_model: 8, ..NetworkConfig::default() };
    let settings = TrainingConfig { epochs_max: 150, ..TrainingConfig::default() };
    let (network, cold) = run(config, (&training, Some(&held_out)), &settings);
    let (_, warm) =
        train(&network, &training, Some(&held_out), &settings, &mut |_| ControlFlow::Continue(())).unwrap();
    approx::assert_relative_eq!(warm.initial_loss, cold.best_loss, max_relative = 1e-12);
    assert!(warm.best_loss <= cold.best_loss);
}

#[test]
fn samples_of_weight_zero_have_no_influence() {
    let mut sequence = second_order_lag(1, 2, 200);
    sequence.weights[..60].fill(0.0);
    sequence.weights[150..170].fill(0.0);
    let settings = TrainingConfig { epochs_max: 5, ..TrainingConfig::default() };
    let weights = |sequence| {
        let set = TrainingSet::new(2, 2, &[sequence]).unwrap();
        let network = ResidualNetwork::new(
            NetworkConfig { inputs: 2, ..NetworkConfig::default() },
            Normalization::identity(2, 2),
            0,
        );
        train(&network.unwrap(), &set, None, &settings, &mut |_| ControlFlow::Continue(()))
            .unwrap()
            .0
            .weights()
            .to_vec()
    };
    let mut changed = sequence.clone();
    for k in (0..60).chain(150..170) {
        changed.targets[k] = 1e3;
        changed.targets[200 + k] = -1e3;
    }
    assert_eq!(weights(sequence), weights(changed));
}

#[test]
fn progress_is_reported_and_can_stop_the_run() {
    let set = noise_set(1, (3, 2), &[60]);
    let network = ResidualNetwork::new(small(Architecture::S4), Normalization::fit(&set), 0).unwrap();
    let mut seen = Vec::new();
    let (_, report) = train(&network, &set, None, &TrainingConfig::default(), &mut |progress| {
        seen.push(progress.epoch);
        if progress.epoch == 4 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
    .unwrap();
    assert_eq!(seen, [1, 2, 3, 4]);
    assert_eq!((report.epochs, report.stop_reason), (4, StopReason::Interrupted));
    assert_eq!(report.training_losses.len(), 4);
}

#[test]
fn divergence_is_told_and_leaves_finite_weights() {
    let set = noise_set(1, (3, 2), &[60]);
    for architecture in ARCHITECTURES {
        for (validation, epochs_max) in [(Some(&set), 300), (None, 300), (None, 1)] {
            let settings = TrainingConfig {
                learning_rate: 1e300,
                state_space_learning_rate: 1e300,
                epochs_max,
                ..TrainingConfig::default()
            };
            let (network, report) = run(small(architecture), (&set, validation), &settings);
            assert_eq!(report.stop_reason, StopReason::Diverged, "{architecture:?}");
            assert!(network.weights().iter().all(|weight| weight.is_finite()));
            assert!(network.evaluate(&set).unwrap().loss.is_finite());
        }
    }
}
