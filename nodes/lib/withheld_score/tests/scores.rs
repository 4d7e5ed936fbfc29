//! Verdicts that are known to be right or wrong, scored.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;

use gripsight_withheld_make::{CaseLabel, Family, Kind, OracleFit, SealedEffect};
use gripsight_withheld_score::{
    Answer, Figure, Line, OtherDrive, PairScores, Said, SaidChange, SaidEffect, SaidGap, SaidParameter,
    SaidPatch, Scores, Targets, excuse_what_drives_have,
};

fn effect(name: &str, severity: f64, excess: f64) -> SealedEffect {
    SealedEffect {
        name: name.to_owned(),
        parameters: [("size".to_owned(), 1.0)].into(),
        library_parameters: [("size".to_owned(), 1.1)].into(),
        oracle: Some(OracleFit {
            severity,
            size_ratio: 1.1,
            chi2_per_residual: 1.0,
            excess_without: Some(excess),
        }),
    }
}

fn named(name: &str, confidence: f64, confused_with: &[&str]) -> SaidEffect {
    let size = SaidParameter { value: Some(1.12), low: Some(1.0), high: Some(1.2) };
    SaidEffect {
        name: name.to_owned(),
        accepted: true,
        parameters: [("size".to_owned(), size)].into(),
        confidence: Some(confidence),
        confused_with: confused_with.iter().map(|n| (*n).to_owned()).collect(),
    }
}

fn answer(kind: Kind, effects: Vec<SealedEffect>, verdict: &str, said: Vec<SaidEffect>) -> Answer {
    let figure = |value| Figure { value: Some(value) };
    let gap = SaidGap {
        nominal: figure(11.0),
        after: figure(3.0),
        s4_residual: figure(6.0),
        noise_floor: figure(1.0),
        ..SaidGap::default()
    };
    let label = CaseLabel {
        case: "case".to_owned(),
        family: Family::Reference,
        compared: false,
        kind,
        effects,
        without: Vec::new(),
        race_pace: true,
        contained: Vec::new(),
        circumstances: BTreeMap::new(),
    };
    let said = Said {
        verdict: verdict.to_owned(),
        effects: said,
        changes: Vec::new(),
        sites: Vec::new(),
        gap,
        other_drive: None,
        patch: None,
    };
    Answer { label, said, oracle: None, baselines: BTreeMap::new(), time_s: 1.0 }
}

fn line<'a>(scores: &'a Scores, start: &str) -> &'a Line {
    scores.families[0].lines.iter().find(|l| l.what.starts_with(start)).unwrap()
}

#[test]
fn a_comparison_is_judged_by_what_has_changed() {
    let compared = |kind, effects, verdict: &str, changes: Vec<SaidChange>| {
        let said = changes.iter().map(|c| named(&c.name, 0.9, &[])).collect();
        let mut out = answer(kind, effects, verdict, said);
        out.label.compared = true;
        out.said.changes = changes;
        out
    };
    let change = |value: f64| SaidChange {
        site: "yaw_rate".to_owned(),
        name: "gyro_bias".to_owned(),
        parameter: Some("bias_radps".to_owned()),
        difference: SaidParameter { value: Some(value), low: Some(value - 0.01), high: Some(value + 0.01) },
        probability: Some(0.9),
    };
    let bias = || SealedEffect {
        name: "gyro_bias".to_owned(),
        parameters: [("bias_radps".to_owned(), 0.02)].into(),
        library_parameters: [("bias_radps".to_owned(), 0.02)].into(),
        oracle: None,
    };
    let answers = [
        // Other tires, and what nobody can name, are changes, too.
        compared(Kind::None, vec![], "tire_retune_only", vec![]),
        compared(Kind::None, vec![], "none_of_these", vec![]),
        compared(Kind::None, vec![], "no_gap", vec![]),
        compared(Kind::Single, vec![bias()], "effects", vec![change(0.025)]),
        compared(Kind::Single, vec![bias()], "effects", vec![change(0.05)]),
        compared(Kind::Single, vec![bias()], "no_gap", vec![]),
        // A figure of another parameter is not held against the true size.
        compared(
            Kind::Single,
            vec![bias()],
            "effects",
            vec![SaidChange { parameter: Some("other".to_owned()), ..change(0.5) }],
        ),
    ];
    let scores = Scores::of(&answers, BTreeMap::new(), Targets::fixed().unwrap());
    let rate = |start: &str| {
        let rate = line(&scores, start).rate.unwrap();
        (rate.hits, rate.of)
    };
    assert_eq!(rate("no effect"), (2, 3));
    assert_eq!(rate("one effect: its site"), (3, 4));
    assert_eq!(rate("one effect: first name exact"), (3, 4));
    // The difference, not the size of the later drive.
    assert_eq!(rate("90 % intervals"), (1, 2));
}

#[test]
fn every_kind_is_judged_by_its_own_rule() {
    let one = |severity| vec![effect("gyro_bias", severity, 1.0)];
    let two = || vec![effect("gyro_bias", 3.0, 1.0), effect("steering_gain", 3.0, 1.0)];
    let mut answers = vec![
        answer(Kind::None, vec![], "tire_retune_only", vec![]),
        answer(Kind::None, vec![], "effects", vec![named("gyro_bias", 0.9, &[])]),
        answer(Kind::Single, one(3.0), "effects", vec![named("gyro_bias", 0.9, &[])]),
        answer(Kind::Single, one(3.0), "effects", vec![named("imu_tilt", 0.9, &["gyro_bias"])]),
        // A ranking without a verdict names nothing.
        answer(Kind::Single, one(3.0), "none_of_these", vec![named("gyro_bias", 0.9, &[])]),
        // Below the limit: counted and shown, outside the targets.
        answer(Kind::Single, one(0.5), "no_gap", vec![]),
        answer(Kind::Single, vec![effect("grip_scale", 3.0, 1.0)], "tire_retune_only", vec![]),
        answer(Kind::Deleted, one(3.0), "none_of_these", vec![]),
        answer(
            Kind::Deleted,
            vec![effect("gyro_bias", 3.0, 0.01)],
            "effects",
            vec![named("imu_tilt", 0.9, &[])],
        ),
        answer(Kind::OutOfLibrary, vec![effect("gusts", 3.0, 1.0)], "none_of_these", vec![]),
        answer(
            Kind::Pair,
            two(),
            "effects",
            vec![named("steering_gain", 0.9, &[]), named("gyro_bias", 0.9, &[])],
        ),
        answer(Kind::Pair, two(), "effects", vec![named("steering_gain", 0.9, &[])]),
    ];
    answers[2].oracle = Some(Said {
        gap: SaidGap { after: Figure { value: Some(1.0) }, ..answers[2].said.gap },
        ..answers[2].said.clone()
    });
    let scores = Scores::of(&answers, BTreeMap::new(), Targets::fixed().unwrap());
    let rate = |start: &str| {
        let rate = line(&scores, start).rate.unwrap();
        (rate.hits, rate.of)
    };
    assert_eq!(rate("one effect: first name exact"), (1, 4));
    assert_eq!(rate("one effect: first name within"), (3, 4));
    assert_eq!(rate("no effect"), (1, 2));
    assert_eq!(rate("not in the library"), (1, 1));
    assert_eq!(rate("left out: confident"), (1, 2));
    assert_eq!(rate("left out, with an excess"), (1, 1));
    assert_eq!(rate("two effects"), (1, 2));
    // The truth in the library's terms, 1.1, lies in every stated interval; the mechanism's constant is another number.
    assert_eq!(rate("90 % intervals"), (4, 4));
    assert_eq!(rate("causes named, all cases"), (4, 9));
    assert_eq!(rate("a name for no cause, all cases"), (3, 12));
    assert_eq!(rate("no effect: none of these"), (0, 2));
    assert!((line(&scores, "held-out").value.unwrap() - 0.8).abs() < 1e-12);
    assert!((line(&scores, "the same of an S4 residual").value.unwrap() - 0.5).abs() < 1e-12);
    let shown: usize = scores.effects.iter().flat_map(|e| &e.by_severity).map(|r| r.of).sum();
    assert_eq!(shown, 9);
    let missed: Vec<Kind> = scores.misses.iter().map(|m| m.kind).collect();
    assert_eq!(missed.iter().filter(|k| **k == Kind::Single).count(), 3);
    assert!(scores.text().contains("MISSED"));
}

#[test]
fn what_a_recorded_drive_has_is_excused() {
    let mut bare = answer(Kind::None, vec![], "effects", vec![named("steering_delay", 0.9, &[])]);
    let mut injected = answer(
        Kind::Single,
        vec![effect("gyro_bias", 3.0, 1.0)],
        "effects",
        vec![named("steering_delay", 0.9, &[]), named("gyro_bias", 0.9, &[])],
    );
    let mut other = injected.clone();
    for (answer, car) in [(&mut bare, "a"), (&mut injected, "a"), (&mut other, "b")] {
        answer.label.family = Family::Recorded;
        answer.label.circumstances.insert("car".to_owned(), car.into());
    }
    let mut answers = [bare, injected, other];
    assert!(!answers[1].exact());
    excuse_what_drives_have(&mut answers);
    assert!(!answers[0].false_alarm() && answers[1].exact() && !answers[2].exact());
}

#[test]
fn pairs_are_scored_by_what_was_changed_and_by_another_drive() {
    let pair = |kind, effects, verdict: &str, said, after| {
        let mut answer = answer(kind, effects, verdict, said);
        answer.label.family = Family::Simulator;
        answer.label.circumstances.insert("simulator".to_owned(), "slipx".into());
        answer.said.other_drive = Some(OtherDrive { before: Some(8.0), after: Some(after) });
        answer.said.patch = Some(SaidPatch { written: kind == Kind::Single });
        answer
    };
    let change = |name| vec![effect(name, 3.0, 0.0)];
    let answers = [
        // Named as what it is; by its group; not at all; one of two; and one name too many, with a patch that harms.
        pair(Kind::Single, change("a"), "effects", vec![named("a", 0.9, &[])], 1.1),
        pair(Kind::Single, change("a"), "effects", vec![named("b", 0.5, &["a"])], 1.2),
        pair(Kind::Single, change("a"), "no_gap", Vec::new(), 8.0),
        pair(Kind::Pair, [change("a"), change("c")].concat(), "effects", vec![named("c", 0.9, &[])], 4.0),
        pair(Kind::Single, change("a"), "effects", vec![named("a", 0.9, &[]), named("d", 0.9, &[])], 9.0),
        pair(Kind::OutOfLibrary, Vec::new(), "missing_structure", vec![named("a", 0.9, &[])], 5.0),
        pair(Kind::OutOfLibrary, Vec::new(), "effects", vec![named("a", 0.9, &[])], 5.0),
        pair(Kind::None, Vec::new(), "no_gap", Vec::new(), 1.0),
        pair(Kind::None, Vec::new(), "missing_structure", Vec::new(), 1.0),
    ];
    let scores = PairScores::of(&answers);
    let line = |start: &str| -> &Line { scores.lines.iter().find(|l| l.what.starts_with(start)).unwrap() };
    let rate = |start: &str| line(start).rate.map(|r| (r.hits, r.of)).unwrap();
    assert_eq!(rate("one change: first name right"), (3, 4));
    assert_eq!(rate("changes named"), (4, 6));
    assert_eq!(rate("something named beside"), (1, 5));
    // The mechanism's constant is 1, the interval goes from 1 on.
    assert_eq!(rate("90 % intervals"), (3, 3));
    assert_eq!(rate("missing structure"), (1, 2));
    assert_eq!(rate("false alarms"), (1, 2));
    assert_eq!(rate("patches that help"), (2, 4));
    assert_eq!(line("error left on another drive").value, Some(4.0));
    assert_eq!(scores.rows.len(), 9);
    assert!(scores.text().contains("right, slipx: 4/9"));
}

#[test]
fn the_library_has_what_the_makers_say_it_has() {
    let has = |name: &&str| gripsight_model::EffectId::by_name(name).is_some();
    let [inside, outside] = [true, false].map(gripsight_withheld_make::effect_names);
    assert!(inside.len() == 34 && inside.iter().all(has), "{inside:?}");
    assert!(outside.len() == 6 && !outside.iter().any(has), "{outside:?}");
}
