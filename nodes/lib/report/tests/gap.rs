//! The gap page on a made-up diagnosis.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;

use gripsight_gap::{
    Diagnosis, EffectParameter, Estimate, ExtendedModelFile, GapBudget, Identity, Invisible, Need, Place,
    Prediction, RankedEffect, Series, TirePair, Unexplained, Verdict, Where,
};
use gripsight_report::{GapInput, Header, gap_page};
use gripsight_signals::DataHealth;
use gripsight_vehicle::PacejkaParameters;

fn estimate(value: f64, half: f64) -> Estimate {
    Estimate { value, low: value - half, high: value + half }
}

fn diagnosis() -> Diagnosis {
    let tires = PacejkaParameters::from_array([7.0, 1.6, 0.48, 0.1, 9.0, 1.5, 0.5, -0.2]);
    let effect =
        |name: &'static str, accepted: bool, parameter: &'static str, value: f64, unit: &'static str| {
            RankedEffect {
                name,
                accepted,
                parameters: BTreeMap::from([(
                    parameter,
                    EffectParameter { value, low: 0.9 * value, high: 1.1 * value, unit, before: None },
                )]),
                gap_closed_fraction: estimate(0.62, 0.1),
                confidence: if accepted { 0.93 } else { 0.0 },
                confused_with: if accepted { vec!["steering_lag"] } else { Vec::new() },
            }
        };
    let place = |low: f64, unit: &'static str, chi2_per_dof: f64| Place {
        low,
        high: low + 5.0,
        unit,
        channel: "all",
        chi2_per_dof,
        share: chi2_per_dof / 40.0,
    };
    let waves = |k: usize| (0.3 * (k as f64 * 0.02).sin(), 2.0 * (k as f64 * 0.02).cos());
    let curve = |grip: f64| {
        (0..60)
            .map(|k| f64::from(k) * 0.004)
            .map(move |s| [s, grip * (9.0 * s).tanh(), 1.1 * grip * (8.0 * s).tanh()])
    };
    Diagnosis {
        verdict: Verdict::Effects,
        reasons: vec!["the named effects explain 84 % of what could be explained".into()],
        effects: vec![
            effect("steering_delay", true, "delay_s", 0.047, "s"),
            effect("tire_relaxation", false, "sigma_m", 0.08, "m"),
        ],
        invisible: vec![Invisible {
            need: Need::LongitudinalCommand,
            name: "aero_drag",
            reason: "needs a longitudinal command".into(),
        }],
        detection_limits: Vec::new(),
        places: Where {
            channel: vec![Place {
                low: 0.0,
                high: 0.0,
                unit: "1",
                channel: "yaw_rate",
                chi2_per_dof: 9.0,
                share: 0.7,
            }],
            speed: vec![place(0.0, "m/s", 4.0), place(5.0, "m/s", 12.0)],
            track_position: (0..12).map(|k| place(5.0 * f64::from(k), "m", 2.0 + f64::from(k % 4))).collect(),
            ..Where::default()
        },
        identities: vec![Identity {
            name: "a_y = v_y' + v_x r",
            informative: false,
            offset: 0.0,
            scale: 0.0,
            rms_over_noise: 1.0,
            finding: "a_y was derived from the other signals: says nothing".into(),
        }],
        gap: GapBudget {
            nominal: estimate(14.0, 2.0),
            retuned: estimate(8.0, 1.5),
            after: estimate(3.1, 0.5),
            unstructured_ceiling: estimate(2.4, 0.4),
            s4_residual: estimate(4.2, 0.6),
            noise_floor: estimate(1.0, 0.0),
            horizon_s: 0.5,
            channel_noise: BTreeMap::from([("v_y", 0.01), ("yaw_rate", 0.03)]),
            scored_on: "held-out blocks",
        },
        gap_closed_fraction: estimate(0.7, 0.1),
        extended_model: ExtendedModelFile::of_tires(tires),
        tires: TirePair { without_effect: tires, with_effect: tires },
        data_health: DataHealth {
            samples: 6000,
            duration_s: 60.0,
            rate_hz: 100.0,
            jitter_s: 0.0,
            gaps: Vec::new(),
            frozen: Vec::new(),
            moving_share: 1.0,
            recorded: vec!["x_m"],
        },
        drive_next: vec!["to tell steering_delay from steering_lag: steering to 3 Hz".into()],
        looks: Vec::new(),
        search_costs: Vec::new(),
        unexplained: Unexplained::default(),
        series: Series {
            tire_curves: [curve(0.5).collect(), curve(0.45).collect()],
            slip_driven_rad: [0.16, 0.12],
            worst: (0..500)
                .map(|k| (k as f64 * 0.01, waves(k)))
                .map(|(time_s, (v, r))| Prediction {
                    time_s,
                    begins: false,
                    v_x_mps: 3.0,
                    v_y_mps: [v, 1.3 * v, 1.05 * v],
                    yaw_rate_radps: [r, 0.8 * r, 0.98 * r],
                })
                .collect(),
            predictions: Vec::new(),
            heat: (0..64)
                .filter(|k| (k / 8 + k % 8) < 10)
                .map(|k| (f64::from(k / 8), f64::from(k % 8)))
                .map(|(i, j)| [(i + 0.5) * 0.6, (j + 0.5) * 0.7, 1.0 + i * j])
                .collect(),
            g_g: (0..1500)
                .map(|k| f64::from(k) * 0.37)
                .map(|k| [2.0 * k.sin(), 4.0 * (1.3 * k).cos()])
                .collect(),
            horizon: [0.1, 0.2, 0.5, 1.0, 2.0]
                .iter()
                .map(|h| [*h, 2.0 + 10.0 * h, 2.0 + 5.0 * h, 1.5 + 2.0 * h])
                .collect(),
        },
    }
}

fn page(diagnosis: &Diagnosis) -> String {
    page_since(diagnosis, None)
}

fn page_since(diagnosis: &Diagnosis, earlier: Option<&str>) -> String {
    let header = Header {
        car: "car".into(),
        bag: "laps.mcap".into(),
        data_stamp: "2023-11-14T22:13:34.271Z".into(),
        tool_version: "0.1.0".into(),
        vehicle_hash: "00ab".into(),
        seed: None,
        command: "gripsight diagnose laps.mcap --out DIR".into(),
    };
    gap_page(&GapInput { diagnosis, header: &header, earlier, data_notes: &[] }).unwrap()
}

#[test]
fn the_page_stands_alone_and_repeats() {
    let html = page(&diagnosis());
    assert_eq!(html, page(&diagnosis()));
    for outside in ["<script", "<link", "<img", "src=", "url(", "@import", "NaN"] {
        assert!(!html.contains(outside), "{outside}");
    }
    std::fs::write(concat!(env!("CARGO_TARGET_TMPDIR"), "/gap.html"), html).unwrap();
}

#[test]
fn every_verdict_has_its_sentence() {
    let headline = |d: &Diagnosis| {
        let html = page(d);
        let start = html.find("<h1").unwrap();
        html[start..html.find("</h1>").unwrap()].to_owned()
    };
    let mut d = diagnosis();
    let text = headline(&d);
    assert!(
        text.contains("steering delay (delay 0.0470 s): 70 % of what other tires leave closes (60 … 80 %)"),
        "{text}"
    );
    for (verdict, words) in [
        (Verdict::TireRetuneOnly, "Other tires close the gap"),
        (Verdict::NoGap, "No gap"),
        (Verdict::NoneOfThese, "no effect of the library explains"),
        (Verdict::NotIdentifiable, "These data cannot tell: the named"),
    ] {
        d.verdict = verdict;
        let text = headline(&d);
        assert!(text.contains(words), "{text}");
    }
}

#[test]
fn a_comparison_speaks_of_what_has_changed() {
    let mut d = diagnosis();
    for (verdict, words) in [
        (Verdict::Effects, "What has changed since monday.mcap is steering delay"),
        (Verdict::TireRetuneOnly, "The tires have changed since monday.mcap"),
        (Verdict::NoGap, "Nothing has changed since monday.mcap"),
        (Verdict::NoneOfThese, "Something has changed since monday.mcap"),
    ] {
        d.verdict = verdict;
        let html = page_since(&d, Some("monday.mcap"));
        assert!(html.contains(words) && html.contains("Two drives compared"), "{words}");
    }
}

#[test]
fn where_no_effect_is_named_the_page_speaks_of_tires_alone() {
    let mut d = diagnosis();
    let spoken = ["What the effects had done to the tires", "tires and effects fitted"];
    assert!(spoken.iter().all(|words| page(&d).contains(words)));
    d.effects.iter_mut().for_each(|e| e.accepted = false);
    let html = page(&d);
    assert!(html.contains("tires fitted") && !spoken.iter().any(|words| html.contains(words)));
}

#[test]
fn the_budget_adds_up() {
    let html = page(&diagnosis());
    for (name, value) in [
        ("closed by other tires", "6.00"),
        ("closed by steering delay", "4.90"),
        ("unexplained rest", "2.10"),
    ] {
        let row = &html[html.find(name).unwrap()..];
        let value_at = row.find("class=\"value\">").unwrap() + "class=\"value\">".len();
        assert!(row[value_at..].starts_with(value), "{name}: {}", &row[value_at..value_at + 8]);
    }
}

#[test]
fn a_diagnosis_without_figures_still_makes_a_page() {
    let mut d = diagnosis();
    let nothing = Estimate { value: f64::NAN, low: f64::NAN, high: f64::NAN };
    d.verdict = Verdict::NotIdentifiable;
    d.series = Series::default();
    d.places = Where::default();
    d.effects.clear();
    d.gap.nominal = nothing;
    d.gap.retuned = nothing;
    d.gap.after = nothing;
    d.gap.unstructured_ceiling = nothing;
    assert!(!page(&d).contains("NaN"));
}
