//! The diagnosis on the reference car, which shares no model with it.

#![allow(clippy::unwrap_used)]

mod common;

use common::{drive, nominal};
use gripsight_gap::{Diagnosis, GapError, Request, Verdict, diagnose};
use gripsight_reference_car::CarParameters;
use gripsight_signals::StateSequence;

const DURATION_S: f64 = 30.0;

fn car() -> CarParameters {
    CarParameters::by_name("formula_student").unwrap()
}

fn diagnosed(recording: &StateSequence, without: &[String]) -> Diagnosis {
    let vehicle = nominal(&car());
    let request = Request {
        sequence: recording,
        held_out: None,
        reference: None,
        vehicle: &vehicle,
        tires: None,
        without,
        only: &[],
    };
    diagnose(&request, &mut |_| {}).unwrap()
}

fn named(d: &Diagnosis) -> Vec<&'static str> {
    d.effects.iter().filter(|e| e.accepted).map(|e| e.name).collect()
}

#[test]
fn a_clear_effect_is_named_with_its_size_and_closes_the_gap() {
    let recording = drive(&car(), Some("tire_relaxation=0.45"), DURATION_S, 21).unwrap();
    let d = diagnosed(&recording, &[]);
    assert_eq!((d.verdict, named(&d)[0]), (Verdict::Effects, "tire_relaxation"), "{}", d.text());
    let sigma_m = d.effects[0].parameters["sigma_m"].value;
    assert!((sigma_m - 0.45).abs() < 0.05, "sigma {sigma_m} m, true 0.45 m");
    assert!(d.gap_closed_fraction.value > 0.7, "{}", d.text());
    assert!(d.gap.noise_floor.value <= d.gap.after.value && d.gap.after.value < d.gap.retuned.value);
    assert!(d.gap.unstructured_ceiling.value <= d.gap.after.value);

    // The same bytes for the same input.
    let again = diagnosed(&recording, &[]);
    assert_eq!(serde_json::to_string(&d).unwrap(), serde_json::to_string(&again).unwrap());
}

#[test]
fn without_an_effect_nothing_is_named() {
    let recording = drive(&car(), None, DURATION_S, 22).unwrap();
    let d = diagnosed(&recording, &[]);
    assert!(matches!(d.verdict, Verdict::NoGap | Verdict::TireRetuneOnly), "{}", d.text());
    assert_eq!(named(&d), Vec::<&str>::new());
}

#[test]
fn an_effect_left_out_is_not_named_and_unknown_names_are_refused() {
    let recording = drive(&car(), Some("v_y_bias=0.15"), DURATION_S, 23).unwrap();
    let d = diagnosed(&recording, &["v_y_bias".to_owned()]);
    assert!(d.effects.iter().all(|e| e.name != "v_y_bias"));
    let vehicle = nominal(&car());
    let request = Request {
        sequence: &recording,
        held_out: None,
        reference: None,
        vehicle: &vehicle,
        tires: None,
        without: &["magic".to_owned()],
        only: &[],
    };
    let error = diagnose(&request, &mut |_| {}).unwrap_err();
    assert!(matches!(error, GapError::UnknownEffect { .. }), "{error}");
}

#[test]
fn recordings_that_say_nothing_are_refused_with_the_reason() {
    let n = 2000;
    let straight = StateSequence {
        time_s: (0..n).map(|k| k as f32 * 0.01).collect(),
        v_x_mps: (0..n).map(|k| 10.0 + (k % 7) as f32 * 0.01).collect(),
        v_y_mps: (0..n).map(|k| (k % 5) as f32 * 0.001).collect(),
        yaw_rate_radps: (0..n).map(|k| (k % 3) as f32 * 0.001).collect(),
        steering_rad: vec![0.0; n],
        ..StateSequence::default()
    };
    let vehicle = nominal(&car());
    let refused = |sequence: &StateSequence| {
        let request = Request {
            sequence,
            held_out: None,
            reference: None,
            vehicle: &vehicle,
            tires: None,
            without: &[],
            only: &[],
        };
        diagnose(&request, &mut |_| {}).unwrap_err()
    };
    assert!(matches!(refused(&straight), GapError::NoInformation { what: "cornering", .. }));
    let parked = StateSequence { v_x_mps: vec![0.0; n], ..straight.clone() };
    assert!(matches!(refused(&parked), GapError::TooLittle { .. }));
    let slow = StateSequence { time_s: (0..n).map(|k| k as f32 * 0.1).collect(), ..straight };
    assert!(matches!(refused(&slow), GapError::TooCoarse { .. }));
}
