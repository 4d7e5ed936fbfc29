//! The diagnosis on the reference car, which shares no model with it.

#![allow(clippy::unwrap_used)]

mod common;

use common::{drive, drive_at, nominal, text};
use gripsight_diagnosis::{Diagnosis, Earlier, GapError, Request, Together, Verdict, diagnose, own_tires};
use gripsight_model::ModelError;
use gripsight_reference_car::CarParameters;
use gripsight_signals::{Joined, StateSequence};
use gripsight_vehicle::TirePosterior;

const DURATION_S: f64 = 30.0;

fn car() -> CarParameters {
    CarParameters::by_name("formula_student").unwrap()
}

fn diagnosed(recording: &StateSequence, without: &[String]) -> Diagnosis {
    let vehicle = nominal(&car());
    let request = Request { without, ..Request::new(recording, &vehicle) };
    diagnose(&request, &mut |_| {}).unwrap()
}

fn named(d: &Diagnosis) -> Vec<&'static str> {
    d.effects.iter().filter(|e| e.accepted).map(|e| e.name).collect()
}

#[test]
fn a_clear_effect_is_named_with_its_size_and_closes_the_gap() {
    let recording = drive(&car(), &["tire_relaxation=0.45"], DURATION_S, 21).unwrap();
    let d = diagnosed(&recording, &[]);
    assert_eq!((d.verdict, named(&d)[0]), (Verdict::Effects, "tire_relaxation"), "{}", text(&d));
    let sigma_m = d.effects[0].parameters["sigma_m"].value;
    assert!((sigma_m - 0.45).abs() < 0.05, "sigma {sigma_m} m, true 0.45 m");
    assert!(d.gap_closed_fraction.value > 0.7, "{}", text(&d));
    assert!(d.gap.noise_floor.value <= d.gap.after.value && d.gap.after.value < d.gap.retuned.value);
    assert!(d.gap.unstructured_ceiling.value <= d.gap.after.value);

    // The same bytes for the same input.
    let again = diagnosed(&recording, &[]);
    assert_eq!(serde_json::to_string(&d).unwrap(), serde_json::to_string(&again).unwrap());
}

#[test]
fn of_two_that_do_nearly_the_same_the_likelier_is_named_and_they_share_the_chance() {
    /// What may be stated of an effect that nothing needs.
    const NEEDLESS: f64 = 0.05;
    let car = CarParameters::by_name("f1tenth").unwrap();
    let vehicle = nominal(&car);
    for (effect, rival) in [("steering_delay", "steering_lag"), ("steering_lag", "steering_delay")] {
        // Few quick movements: hard to tell.
        let recording = drive_at(&car, &[&format!("{effect}=0.04")], 0.6, DURATION_S, 31).unwrap();
        let d = diagnose(&Request::new(&recording, &vehicle), &mut |_| {}).unwrap();
        let chance = |name: &str| d.effects.iter().find(|e| e.name == name).map_or(0.0, |e| e.confidence);
        assert_eq!(named(&d), [effect], "{}", text(&d));
        assert!(chance(rival) <= (1.0 - chance(effect)).max(NEEDLESS), "{}", text(&d));
    }
}

#[test]
fn without_an_effect_nothing_is_named() {
    let recording = drive(&car(), &[], DURATION_S, 22).unwrap();
    let d = diagnosed(&recording, &[]);
    assert!(matches!(d.verdict, Verdict::NoGap | Verdict::TireRetuneOnly), "{}", text(&d));
    assert_eq!(named(&d), Vec::<&str>::new());
    // No figure speaks of a candidate, and none is listed that is not there at all.
    assert_eq!((d.gap.after, d.tires.with_effect), (d.gap.retuned, d.tires.without_effect));
    assert_eq!(d.gap_closed_fraction.value, 0.0);
    assert!(d.effects.iter().all(|e| e.parameters.values().all(|p| p.value.is_finite())), "{}", text(&d));
}

#[test]
fn an_effect_left_out_is_not_named_and_unknown_names_are_refused() {
    let recording = drive(&car(), &["v_y_bias=0.15"], DURATION_S, 23).unwrap();
    let d = diagnosed(&recording, &["v_y_bias".to_owned()]);
    assert!(d.effects.iter().all(|e| e.name != "v_y_bias"));
    // Its site is named, closes what there is to close, and by nothing that has a name.
    let site = &d.sites[0];
    assert_eq!(site.name, "v_y", "{}", text(&d));
    let shares = [site.closed_fraction.value, site.unexplained_fraction];
    assert!(shares.iter().all(|s| *s > 0.5) && site.other_probability > 0.5, "{}", text(&d));
    let vehicle = nominal(&car());
    let request = Request { without: &["magic".to_owned()], ..Request::new(&recording, &vehicle) };
    let error = diagnose(&request, &mut |_| {}).unwrap_err();
    assert!(matches!(error, GapError::Model(ModelError::UnknownEffect { .. })), "{error}");
}

#[test]
fn what_neither_effects_nor_free_terms_explain_is_no_matter_of_other_tires() {
    let recording = drive(&car(), &["gusts"], DURATION_S, 27).unwrap();
    let d = diagnosed(&recording, &[]);
    assert_eq!((d.verdict, named(&d)), (Verdict::NoneOfThese, Vec::new()), "{}", text(&d));
    assert!(d.reasons.iter().any(|r| r.contains("times the noise is left")), "{}", text(&d));
}

#[test]
fn data_that_cannot_tell_get_that_verdict_and_malformed_data_an_error() {
    let n = 2000;
    let series = |f: &dyn Fn(usize) -> f32| (0..n).map(f).collect::<Vec<f32>>();
    let straight = StateSequence {
        time_s: series(&|k| k as f32 * 0.01),
        v_x_mps: series(&|k| 10.0 + (k % 7) as f32 * 0.01),
        v_y_mps: series(&|k| (k % 5) as f32 * 0.001),
        yaw_rate_radps: series(&|k| (k % 3) as f32 * 0.001),
        steering_rad: vec![0.0; n],
        ..StateSequence::default()
    };
    let cornering = StateSequence {
        yaw_rate_radps: series(&|k| (k as f32 * 0.02).sin()),
        steering_rad: series(&|k| 0.1 * (k as f32 * 0.02).sin()),
        ..straight.clone()
    };
    let cut = |sequence: &StateSequence, len: usize| StateSequence {
        time_s: sequence.time_s[..len].to_vec(),
        v_x_mps: sequence.v_x_mps[..len].to_vec(),
        v_y_mps: sequence.v_y_mps[..len].to_vec(),
        yaw_rate_radps: sequence.yaw_rate_radps[..len].to_vec(),
        steering_rad: sequence.steering_rad[..len].to_vec(),
        ..StateSequence::default()
    };
    let vehicle = nominal(&car());
    let answer = |sequence: &StateSequence| diagnose(&Request::new(sequence, &vehicle), &mut |_| {});
    for (name, sequence, reason) in [
        ("straight only", straight.clone(), "cornering says nothing"),
        ("stopped", StateSequence { v_x_mps: vec![0.0; n], ..cornering.clone() }, "can be used"),
        ("short", cut(&cornering, 500), "at least 8 s are needed"),
        ("shorter than a stretch", cut(&cornering, 100), "at least 8 s are needed"),
        ("10 Hz", StateSequence { time_s: series(&|k| k as f32 * 0.1), ..cornering.clone() }, "too slow"),
        ("no v_y", StateSequence { v_y_mps: vec![0.0; n], ..cornering.clone() }, "v_y says nothing"),
        ("constant v_y", StateSequence { v_y_mps: vec![0.3; n], ..cornering.clone() }, "v_y says nothing"),
        (
            "frozen v_y",
            StateSequence {
                v_y_mps: series(&|k| if k < 300 { k as f32 * 1e-3 } else { 0.3 }),
                ..cornering.clone()
            },
            "stands still",
        ),
    ] {
        let d = answer(&sequence).unwrap();
        assert_eq!(d.verdict, Verdict::NotIdentifiable, "{name}");
        assert!(d.reasons[0].contains(reason), "{name}: {}", d.reasons[0]);
        assert!(text(&d).contains(reason) && !d.drive_next.is_empty(), "{name}");
        let json: serde_json::Value = serde_json::to_value(&d).unwrap();
        assert_eq!(json["verdict"], "not_identifiable", "{name}");
        assert!(json["gap"]["nominal"]["value"].is_null(), "{name}");
    }
    let broken = StateSequence { v_y_mps: vec![f32::NAN; n], ..cornering.clone() };
    assert!(matches!(answer(&broken).unwrap_err(), GapError::Signal(_)));
    let uneven = StateSequence { steering_rad: vec![0.0; 3], ..cornering };
    assert!(matches!(answer(&uneven).unwrap_err(), GapError::Signal(_)));
}

#[test]
fn one_lap_hides_what_needs_a_second() {
    let recording = drive(&car(), &[], 12.0, 24).unwrap();
    let d = diagnosed(&recording, &[]);
    let patch = d.invisible.iter().find(|i| i.name == "low_grip_patch").unwrap();
    assert!(patch.reason.contains("lap") || patch.reason.contains("pass"), "{}", patch.reason);
    assert!(d.effects.iter().all(|e| e.name != "low_grip_patch"));
}

#[test]
fn of_two_drives_only_what_has_changed_is_told() {
    const DELAY: &str = "steering_delay=0.04";
    let small = CarParameters::by_name("f1tenth").unwrap();
    let vehicle = nominal(&small);
    let [late, late_too, prompt] = [(DELAY, 26), (DELAY, 27), ("", 28)].map(|(effect, seed)| {
        let effects: Vec<&str> = Some(effect).filter(|e| !e.is_empty()).into_iter().collect();
        drive_at(&small, &effects, 0.8, DURATION_S, seed).unwrap()
    });
    let earlier = Earlier::diagnosed(&Request::new(&late, &vehicle), &mut |_| {}).unwrap();
    assert_eq!(named(&earlier.diagnosis), ["steering_delay"], "{}", text(&earlier.diagnosis));
    let since = |recording: &StateSequence| {
        let request = Request { earlier: Some(&earlier), ..Request::new(recording, &vehicle) };
        diagnose(&request, &mut |_| {}).unwrap()
    };
    let itself = since(&late);
    assert!(itself.verdict == Verdict::NoGap && itself.changes.is_empty(), "{}", text(&itself));
    // The same motion with a signal of which a driver's update makes something else: sample by sample nothing hides that.
    let biased = StateSequence { v_y_mps: late.v_y_mps.iter().map(|v| v + 0.03).collect(), ..late.clone() };
    let biased = since(&biased);
    assert_eq!(named(&biased), ["v_y_bias"], "{}", text(&biased));
    let [change] = &biased.changes[..] else { panic!("{}", text(&biased)) };
    assert!((change.difference.value - 0.03).abs() < 0.001, "{}", text(&biased));
    let same = since(&late_too);
    assert!(matches!(same.verdict, Verdict::NoGap | Verdict::TireRetuneOnly), "{}", text(&same));
    // What only one of them records is left out of both.
    let (a_x_mps2, a_y_mps2) = (Vec::new(), Vec::new());
    let without_imu = since(&StateSequence { a_x_mps2, a_y_mps2, ..late_too });
    assert!(without_imu.effects.iter().all(|e| !e.accepted), "{}", text(&without_imu));
    let gone = since(&prompt);
    assert_eq!(named(&gone), ["steering_delay"], "{}", text(&gone));
    let delay_s = gone.effects[0].parameters["delay_s"].clone();
    assert!(delay_s.low <= 0.0 && delay_s.high < 0.01 && delay_s.before.unwrap() > 0.035, "{delay_s:?}");
}

#[test]
fn less_grip_since_the_drive_before_is_named_though_no_tires_were_given() {
    let small = CarParameters::by_name("f1tenth").unwrap();
    let vehicle = nominal(&small);
    let [before, slippery] = [(&[][..], 1.0, 41), (&["grip_scale=-0.25"], 0.7, 42)]
        .map(|(effects, pace, seed)| drive_at(&small, effects, pace, DURATION_S, seed).unwrap());
    let earlier = Earlier::diagnosed(&Request::new(&before, &vehicle), &mut |_| {}).unwrap();
    assert!(earlier.diagnosis.invisible.iter().any(|i| i.name == "grip_scale"));
    let request = Request { earlier: Some(&earlier), ..Request::new(&slippery, &vehicle) };
    let d = diagnose(&request, &mut |_| {}).unwrap();
    assert_eq!(named(&d), ["grip_scale"], "{}", text(&d));
    let m = &d.effects[0].parameters["m"];
    assert!(m.low < -0.25 && m.high > -0.25, "{m:?}");
}

#[test]
fn a_large_constant_change_and_one_of_a_later_parameter_are_named() {
    let car = CarParameters::by_name("formula_student").unwrap();
    let vehicle = nominal(&car);
    let [before, tilted] = [(&[][..], 93), (&["imu_tilt=0.06"], 94)]
        .map(|(effects, seed)| drive_at(&car, effects, 0.8, 60.0, seed).unwrap());
    let earlier = Earlier::diagnosed(&Request::new(&before, &vehicle), &mut |_| {}).unwrap();
    let since = |drive: &StateSequence| {
        let request = Request { earlier: Some(&earlier), ..Request::new(drive, &vehicle) };
        diagnose(&request, &mut |_| {}).unwrap()
    };
    let d = since(&tilted);
    assert_eq!(named(&d), ["imu_tilt"], "{}", text(&d));
    let change = d.changes.iter().find(|c| c.name == "imu_tilt").unwrap();
    assert_eq!(change.parameter, Some("roll_rad"), "{}", text(&d));
    assert!((change.difference.low..=change.difference.high).contains(&0.06), "{}", text(&d));
    // The slope's mean stays, its sine does not.
    let d = since(&drive_at(&car, &["road_slope=0.03"], 0.8, 60.0, 94).unwrap());
    assert_eq!(named(&d), ["road_slope"], "{}", text(&d));
    let change = d.changes.iter().find(|c| c.name == "road_slope").unwrap();
    assert_eq!(change.parameter, Some("angle_rad"), "{}", text(&d));
}

#[test]
fn drives_in_one_state_are_explained_together_and_one_in_another_contradicts() {
    const LAG: &str = "steering_lag=0.08";
    let small = CarParameters::by_name("f1tenth").unwrap();
    let vehicle = nominal(&small);
    let alone = [(&[LAG][..], 36), (&[LAG], 37), (&[], 38)]
        .map(|(effects, seed)| drive_at(&small, effects, 0.8, 20.0, seed).unwrap());
    let explained = |alone: &[StateSequence]| {
        let joined = Joined::of(alone).unwrap();
        let together = Together { alone, spans_s: &joined.spans_s };
        let request = Request { together: Some(together), ..Request::new(&joined.sequence, &vehicle) };
        diagnose(&request, &mut |_| {}).unwrap()
    };
    let differs = |d: &Diagnosis| -> Vec<Vec<&str>> {
        d.drives.iter().map(|d| d.contradicts.as_ref().unwrap().iter().map(|c| c.name).collect()).collect()
    };
    let alike = explained(&alone[..2]);
    assert_eq!(named(&alike), ["steering_lag"], "{}", text(&alike));
    let nothing: Vec<Vec<&str>> = vec![Vec::new(); 2];
    assert_eq!(nothing, differs(&alike), "{}", text(&alike));
    for drive in &alike.drives {
        assert!(
            (drive.duration_s - 20.0).abs() < 0.5 && drive.after.value < drive.retuned.value,
            "{drive:?}"
        );
    }
    // One that is too short by itself is part of all of them, and no more is said of it.
    let short = drive_at(&small, &[LAG], 0.8, 4.0, 39).unwrap();
    let beside = explained(&[alone[0].clone(), short]);
    let compared: Vec<bool> = beside.drives.iter().map(|d| d.contradicts.is_some()).collect();
    assert_eq!(compared, [true, false], "{}", text(&beside));
    let mixed = explained(&alone);
    // What they give together is the state of none: the two that agree are explained, and the third is told by what differs in it.
    assert_eq!(named(&mixed), ["steering_lag"], "{}", text(&mixed));
    assert_eq!(differs(&mixed)[..2], nothing, "{}", text(&mixed));
    let odd = &mixed.drives[2].contradicts.as_ref().unwrap()[0];
    assert!(odd.name == "steering_lag" && odd.probability > 0.9, "{}", text(&mixed));
    assert!((-0.09..-0.07).contains(&odd.difference.value), "{}", text(&mixed));
    assert!(mixed.drives[2].after.value.is_nan() && mixed.drives[1].after.value.is_finite());
    assert!(mixed.reasons[0].contains("not in one state"), "{}", mixed.reasons[0]);
}

#[test]
fn a_car_s_own_tires_cost_no_name_on_their_own_drive_and_show_grip_on_another() {
    let car = car();
    let vehicle = nominal(&car);
    let lag = ["steering_lag=0.03"];
    let recording = drive(&car, &lag, DURATION_S, 31).unwrap();
    let of = |sequence: &StateSequence, posterior: &TirePosterior| {
        let request = Request { posterior: Some(posterior), ..Request::new(sequence, &vehicle) };
        diagnose(&request, &mut |_| {}).unwrap()
    };
    let posterior = own_tires(&recording, &vehicle, None, ("accepted", "0")).unwrap();
    let json = serde_json::to_string(&posterior).unwrap();
    let posterior = serde_json::from_str::<TirePosterior>(&json).unwrap().checked().unwrap();
    assert_eq!(named(&of(&recording, &posterior)), named(&diagnosed(&recording, &[])));
    // On the drive that they were fitted on they say nothing of grip; on another they do.
    let invisible = |d: &Diagnosis| d.invisible.iter().any(|i| i.name == "grip_scale");
    assert!(invisible(&of(&recording, &posterior)));
    let before = drive(&car, &[], DURATION_S, 32).unwrap();
    let own = |status| own_tires(&before, &vehicle, None, (status, "0")).unwrap();
    let clean = own("accepted");
    let later = of(&drive(&car, &lag, DURATION_S, 33).unwrap(), &clean);
    assert!(!invisible(&later));
    assert_eq!(named(&later)[0], "steering_lag", "{}", text(&later));
    // Of a peak that the drive did not reach nothing is known, however well the formula fits, and the stiffness as well as from a file at best.
    let within = own("accepted_within");
    let relative_sigma = |name: &str| {
        let place = within.place(name).unwrap();
        within.covariance[place][place].sqrt() / within.parameters[place].mean
    };
    assert!(relative_sigma("front.d") >= 0.4 && relative_sigma("rear.d") >= 0.4);
    assert!(
        (0.05..0.1).contains(&relative_sigma("front.stiffness")),
        "{}",
        relative_sigma("front.stiffness")
    );
    assert_eq!(within.parameters, clean.parameters);
}
