//! The extended model of a diagnosis, taken again.

#![allow(clippy::unwrap_used)]

mod common;

use std::collections::BTreeMap;

use common::{drive, nominal, text};
use gripsight_diagnosis::{Diagnosis, ExtendedModelFile, Request, Verdict, diagnose, without_effects};
use gripsight_reference_car::CarParameters;
use gripsight_signals::StateSequence;

fn car() -> CarParameters {
    CarParameters::by_name("formula_student").unwrap()
}

fn from_model(recording: &StateSequence, model: Option<&ExtendedModelFile>) -> Diagnosis {
    let vehicle = nominal(&car());
    diagnose(&Request { model, ..Request::new(recording, &vehicle) }, &mut |_| {}).unwrap()
}

fn named(d: &Diagnosis) -> Vec<&'static str> {
    d.effects.iter().filter(|e| e.accepted).map(|e| e.name).collect()
}

#[test]
fn a_drive_has_no_gap_to_its_own_extended_model_and_a_later_change_is_found_on_top() {
    let recording = drive(&car(), &["steering_delay=0.03"], 30.0, 26).unwrap();
    let first = from_model(&recording, None);
    assert_eq!(named(&first), ["steering_delay"], "{}", text(&first));
    // By way of the file.
    let model = ExtendedModelFile::from_yaml(&first.extended_model.to_yaml().unwrap()).unwrap();
    assert_eq!(model, first.extended_model);

    let second = from_model(&recording, Some(&model));
    assert!(matches!(second.verdict, Verdict::NoGap | Verdict::TireRetuneOnly), "{}", text(&second));
    assert_eq!(named(&second), Vec::<&str>::new());
    // It starts where the first ended, and what it hands on still has the delay.
    let (start, end) = (second.gap.nominal.value, first.gap.after.value);
    assert!((start - end).abs() < 0.05 * end, "starts at {start}, the first ended at {end}");
    let delay_s = |m: &ExtendedModelFile| m.effects["steering_delay"]["delay_s"];
    assert_eq!(delay_s(&second.extended_model), delay_s(&model));

    let changed = drive(&car(), &["steering_delay=0.03", "v_y_bias=0.2"], 22.0, 27).unwrap();
    let third = from_model(&changed, Some(&model));
    assert_eq!(named(&third), ["v_y_bias"], "{}", text(&third));
    assert_eq!(delay_s(&third.extended_model), delay_s(&model));
}

#[test]
fn effects_are_taken_out_of_the_signals() {
    let vehicle = nominal(&car());
    let recording = drive(&car(), &["v_y_bias=0.3", "steering_offset=0.02"], 12.0, 28).unwrap();
    let tires = from_model(&recording, None).extended_model.tires;
    let of = |name: &str, parameter: &str, value: f64| {
        (name.to_owned(), BTreeMap::from([(parameter.to_owned(), value)]))
    };
    let effects =
        BTreeMap::from([of("v_y_bias", "bias_mps", 0.3), of("steering_offset", "offset_rad", 0.02)]);
    let model = ExtendedModelFile { effects, ..ExtendedModelFile::of_tires(tires) };
    let corrected = without_effects(&recording, &vehicle, &model).unwrap();
    let none = ExtendedModelFile::of_tires(tires);
    assert_eq!(without_effects(&recording, &vehicle, &none).unwrap().v_y_mps, recording.v_y_mps);
    for k in 0..recording.len() {
        let (v_y, steering) = (
            corrected.v_y_mps[k] - recording.v_y_mps[k],
            corrected.steering_rad[k] - recording.steering_rad[k],
        );
        assert!((v_y + 0.3).abs() < 1e-3 && (steering - 0.02).abs() < 1e-5, "{k}: {v_y} {steering}");
    }
}
