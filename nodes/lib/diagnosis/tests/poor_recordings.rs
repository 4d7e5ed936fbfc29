//! Recordings that are short, slow or broken: an answer that says what it rests on, or a refusal with the reason.

#![allow(clippy::unwrap_used)]

mod common;
#[path = "common/poor.rs"]
mod poor;

use std::sync::OnceLock;

use common::{drive, nominal, text};
use gripsight_diagnosis::{Diagnosis, GapError, Request, Verdict, diagnose};
use gripsight_reference_car::CarParameters;
use gripsight_signals::StateSequence;

/// The bias of v_y that is driven with.
const BIAS_MPS: f64 = 0.15;

fn recording() -> &'static StateSequence {
    static RECORDING: OnceLock<StateSequence> = OnceLock::new();
    RECORDING.get_or_init(|| {
        let car = CarParameters::by_name("f1tenth").unwrap();
        drive(&car, &[&format!("v_y_bias={BIAS_MPS}")], 24.0, 25).unwrap()
    })
}

fn picked(kept: impl Fn(usize, f32) -> bool) -> StateSequence {
    poor::picked(recording(), kept)
}

fn answer(sequence: &StateSequence) -> Result<Diagnosis, GapError> {
    let vehicle = nominal(&CarParameters::by_name("f1tenth").unwrap());
    let only = ["v_y_bias".to_owned(), "steering_offset".to_owned(), "gyro_bias".to_owned()];
    diagnose(&Request { only: &only, ..Request::new(sequence, &vehicle) }, &mut |_| {})
}

/// The bias leads the ranking with its size inside. So little data may leave it a candidate, and the verdict open.
fn finds_the_bias(d: &Diagnosis) {
    assert_eq!(d.effects[0].name, "v_y_bias", "{}", text(d));
    let bias = &d.effects[0].parameters["bias_mps"];
    assert!(bias.low < BIAS_MPS && BIAS_MPS < bias.high, "{bias:?}");
    assert!(d.effects[0].accepted || d.verdict == Verdict::NoneOfThese, "{}", text(d));
}

#[test]
fn ten_seconds_are_scored_on_what_was_fitted_and_say_so() {
    let d = answer(&picked(|_, t| t < 10.0)).unwrap();
    assert!(d.gap.scored_on.contains("too little data to hold any out"), "{}", d.gap.scored_on);
    assert!(text(&d).contains("too little data to hold any out"));
    let closed = d.gap_closed_fraction;
    let named = d.verdict == Verdict::Effects;
    assert!(if named { closed.low < closed.value || closed.value.is_nan() } else { closed.value == 0.0 });
}

#[test]
fn twenty_hertz_are_enough_for_a_bias() {
    let d = answer(&picked(|k, _| k % 5 == 0)).unwrap();
    assert!((d.data_health.rate_hz - 20.0).abs() < 0.1);
    finds_the_bias(&d);
}

#[test]
fn a_gap_is_stated_and_not_bridged() {
    let d = answer(&picked(|_, t| !(8.0..11.0).contains(&t))).unwrap();
    assert_eq!(d.data_health.gaps.len(), 1);
    assert!(text(&d).contains("1 gaps"));
    let inside = |p: &&gripsight_diagnosis::Prediction| (8.1..10.9).contains(&p.time_s);
    assert_eq!(d.series.predictions.iter().filter(inside).count(), 0);
    finds_the_bias(&d);
}

#[test]
fn a_stop_is_left_out() {
    let d = answer(&poor::stopped(recording(), BIAS_MPS)).unwrap();
    assert!(d.data_health.moving_share < 0.8, "{}", d.data_health.moving_share);
    let inside = |p: &&gripsight_diagnosis::Prediction| (9.6..14.4).contains(&p.time_s);
    assert_eq!(d.series.predictions.iter().filter(inside).count(), 0);
    finds_the_bias(&d);
}

#[test]
fn a_number_that_is_none_is_named_with_its_place() {
    let error = answer(&poor::with_nan(recording(), 700)).unwrap_err().to_string();
    assert!(error.contains("v_y_mps") && error.contains("700"), "{error}");
}

#[test]
fn a_straight_says_what_to_drive() {
    let d = answer(&poor::straight(recording())).unwrap();
    assert_eq!(d.verdict, Verdict::NotIdentifiable);
    assert!(d.reasons[0].contains("cornering says nothing"), "{}", d.reasons[0]);
    assert!(d.drive_next[0].contains("corners to both sides"), "{}", d.drive_next[0]);
}
