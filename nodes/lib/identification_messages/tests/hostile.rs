//! Damaged residual models and tires, as JSON: each is answered, in bounded memory, and what is taken can be run.

#![allow(clippy::unwrap_used)]

use gripsight_identification::{INPUTS, OUTPUTS, PerAxle, Range, ResidualKind, ResidualModel, RunKey};
use gripsight_identification_messages::{learned_model, own_tires, residual_model, tire_posterior};
use gripsight_msgs as msg;
use gripsight_mutants::{Mutants, bombs, peak_memory_mb};
use gripsight_vehicle::{OwnTires, PacejkaParameters, PosteriorParameter, TirePosterior};
use serde::de::DeserializeOwned;

const COUNT: usize = 3000;
const MOST_MB: f64 = 300.0;

fn key() -> RunKey {
    RunKey { run_id: "r".into(), sequence_id: 7, iteration: 2, vehicle_hash: "c0ffee".into(), seed: 5 }
}

fn tires() -> PacejkaParameters {
    PacejkaParameters::from_array([9.0, 1.5, 1.0, 0.1, 8.0, 1.4, 0.9, -0.2])
}

/// A network of two channels with as many weights as it needs.
fn model() -> ResidualModel {
    let range = Range { low: -0.1, high: 0.1 };
    let weights = (1..200).map(|count| vec![0.01; count]);
    let of = |weights: Vec<f64>| ResidualModel {
        key: key(),
        phi_p: tires(),
        architecture: ResidualKind::S4,
        d_model: 2,
        d_state: 2,
        layers: 1,
        dt_s: 0.02,
        horizon: 5,
        input_mean: vec![0.0; INPUTS.len()],
        input_scale: vec![1.0; INPUTS.len()],
        output_scale: vec![0.1; OUTPUTS.len()],
        weights,
        slip_range_rad: PerAxle { front: range, rear: range },
        v_x_range_mps: range,
        epochs: 10,
        samples: 1000,
        training_loss: 0.5,
        validation_loss: 0.6,
    };
    weights.map(of).find(|model| model.network().is_ok()).unwrap()
}

/// Hands over mutants of a JSON text; how many were taken.
fn mutated<T: DeserializeOwned>(text: &str, seed: u64, take: impl Fn(T) -> bool) -> usize {
    let (mut mutants, mut taken, mut parsed) = (Mutants::new(seed), 0, 0);
    let count = Mutants::count(COUNT);
    for mutant in (0..count).map(|_| mutants.text(text)).collect::<Vec<_>>().into_iter().chain(bombs()) {
        let Ok(value) = serde_json::from_str(&mutant) else { continue };
        parsed += 1;
        taken += usize::from(take(value));
    }
    println!("{count} mutants, {parsed} parsed, {taken} taken, held at most {:?} MB", peak_memory_mb());
    assert!(peak_memory_mb().is_none_or(|peak_mb| peak_mb < MOST_MB), "{:?}", peak_memory_mb());
    taken
}

/// Whether a model can be run; a model that is taken must answer, or say why not.
fn runs(model: &ResidualModel) -> bool {
    let Ok(Some(network)) = model.network() else { return false };
    let mut out = [0.0; OUTPUTS.len()];
    network.step(&mut network.stream_state(), &[1.0; INPUTS.len()], &mut out).is_ok()
        && network.forward_sequence(&[1.0; 50 * INPUTS.len()]).is_ok()
}

#[test]
fn mutated_residual_models_are_refused_or_run() {
    assert!(runs(&model()));
    let taken = mutated(&serde_json::to_string(&model()).unwrap(), 0x5d, |model: ResidualModel| runs(&model));
    assert!(taken > 0);
    let message = serde_json::to_string(&residual_model(&model(), 0.5)).unwrap();
    let taken = mutated(&message, 0x5e, |message: msg::ResidualModel| {
        learned_model(&message).is_ok_and(|model| runs(&model))
    });
    assert!(taken > 0);
}

/// Sizes that a message may state and no network has are refused before anything is made for them.
#[test]
fn a_model_that_asks_for_much_is_refused() {
    for size in [0, 1, 1024, 1 << 20, u32::MAX] {
        let asks = msg::ResidualModel {
            d_model: size,
            d_state: size,
            layers: size,
            ..residual_model(&model(), 0.5)
        };
        assert!(!runs(&learned_model(&asks).unwrap()), "{size}");
    }
    assert!(peak_memory_mb().is_none_or(|peak_mb| peak_mb < MOST_MB), "{:?}", peak_memory_mb());
}

#[test]
fn mutated_tires_are_refused_or_whole() {
    let parameters = PosteriorParameter::of_tires(&OwnTires::assumed(&tires()));
    let n = parameters.len();
    let posterior = TirePosterior {
        status: "accepted".into(),
        vehicle_hash: "c0ffee".into(),
        covariance: vec![vec![0.01; n]; n],
        parameters,
        data: vec!["a".into()],
    };
    let message = serde_json::to_string(&tire_posterior(&posterior, &key())).unwrap();
    let taken = mutated(&message, 0x5f, |message: msg::TirePosterior| {
        own_tires(&message).is_ok_and(|posterior| posterior.tires().is_ok_and(|tires| tires.is_finite()))
    });
    assert!(taken > 0);
}
