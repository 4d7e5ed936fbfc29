//! The gap page on a made-up diagnosis.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;

use gripsight_diagnosis::{
    Change, Diagnosis, DriveAnswer, EffectParameter, ExtendedModelFile, GapBudget, GapStep, Invisible,
    MechanismAnswer, Place, Prediction, RankedEffect, Series, SiteAnswer, TirePair, Verdict, Where,
};
use gripsight_estimation::Estimate;
use gripsight_model::{Identity, Need};
use gripsight_report::{Before, GapInput, Header, gap_page, gap_text, topic_notes};
use gripsight_signals::{DataHealth, Pace, Spikes, TopicHealth};
use gripsight_vehicle::{OwnTires, PacejkaParameters};

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
                needed_fraction: 0.5,
                held_out_log_ratio: 40.0,
                over_unexplained: f64::INFINITY,
                size_over_half_width: 8.0,
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
        sites: vec![SiteAnswer {
            name: "steering",
            probability: 0.99,
            closed_fraction: estimate(0.52, 0.1),
            mechanisms: vec![MechanismAnswer { name: "steering_delay", probability: 0.8 }],
            other_probability: 0.6,
            unexplained_fraction: 0.1,
        }],
        changes: vec![Change {
            site: "steering",
            name: "other",
            parameter: None,
            at_slip_rad: None,
            difference: EffectParameter {
                value: f64::NAN,
                low: f64::NAN,
                high: f64::NAN,
                unit: "1",
                before: None,
            },
            probability: 0.97,
        }],
        drives: Vec::new(),
        invisible: vec![Invisible {
            need: Need::LongitudinalCommand,
            name: "aero_drag",
            reason: "needs a longitudinal command".into(),
        }],
        detection_limits: Vec::new(),
        figures: Vec::new(),
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
            steps: vec![GapStep { effect: "steering_delay", error: estimate(3.1, 0.5) }],
            after: estimate(3.1, 0.5),
            unstructured_ceiling: estimate(2.4, 0.4),
            s4_residual: estimate(4.2, 0.6),
            noise_floor: estimate(1.0, 0.0),
            horizon_s: 0.5,
            channel_noise: BTreeMap::from([("v_y", 0.01), ("yaw_rate", 0.03)]),
            scored_on: "held-out blocks",
        },
        gap_closed_fraction: estimate(0.7, 0.1),
        extended_model: ExtendedModelFile::of_tires(OwnTires::assumed(&tires)),
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
        inference: None,
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

/// Odometry with spikes, and drive commands at a tenth of its rate.
fn topics() -> Vec<TopicHealth> {
    let topic = |stream, name: &str, rate_hz: f64, spikes: Vec<Spikes>| TopicHealth {
        stream,
        topic: Some(name.to_owned()),
        type_name: "nav_msgs/msg/Odometry".into(),
        messages: (60.0 * rate_hz) as usize,
        pace: Pace { rate_hz, jitter_s: 1e-4, gaps: 0, longest_step_s: 1.1 / rate_hz, lost_share: 0.0 },
        delay_s: Some(0.004),
        spikes,
    };
    let spikes = vec![Spikes { channel: "v_y_mps", count: 6, first_s: 12.3, largest: 3.04 }];
    let absent = TopicHealth { topic: None, messages: 0, delay_s: None, ..topic("imu", "", 1.0, Vec::new()) };
    vec![topic("odom", "/odom", 100.0, spikes), topic("drive", "/drive", 10.0, Vec::new()), absent]
}

#[test]
fn what_is_the_matter_with_a_topic_is_said() {
    assert_eq!(
        topic_notes(&topics()),
        [
            "/odom: 6 single samples of v_y_mps out by up to 3.0 (first at 12.3 s)",
            "/drive: 10.0 Hz beside odometry at 100 Hz: each command is held until the next",
        ]
    );
    let html = page(&diagnosis());
    let table = &html[html.find("<table").unwrap()..html.find("</table>").unwrap()];
    assert!(table.contains("not recorded") && table.contains("aero drag"), "the first table: {table}");
}

fn page(diagnosis: &Diagnosis) -> String {
    page_since(diagnosis, None)
}

fn page_since(diagnosis: &Diagnosis, before: Option<Before<'_>>) -> String {
    let header = Header {
        car: "car".into(),
        bag: "laps.mcap".into(),
        data_stamp: "2023-11-14T22:13:34.271Z".into(),
        tool_version: "0.1.0".into(),
        vehicle_hash: "00ab".into(),
        seed: None,
        command: "gripsight diagnose laps.mcap --out DIR".into(),
    };
    gap_page(&GapInput { diagnosis, header: &header, before, topics: &topics(), data_notes: &[] }).unwrap()
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

fn headline(d: &Diagnosis) -> String {
    let html = page(d);
    let start = html.find("<h1").unwrap();
    html[start..html.find("</h1>").unwrap()].to_owned()
}

#[test]
fn every_verdict_has_its_sentence() {
    let mut d = diagnosis();
    let text = headline(&d);
    assert!(
        text.contains("steering delay (delay 0.0470 s): 70 % (60 … 80 %) of what other tires leave closes; 3.1 times the noise remains"),
        "{text}"
    );
    for (verdict, words) in [
        (Verdict::TireRetuneOnly, "Other tires are all that helps"),
        (
            Verdict::NoGap,
            "No effect of the library is at work as far as these data tell, but 3.1 times the noise remains",
        ),
        (Verdict::NoneOfThese, "no effect of the library explains"),
        (Verdict::NotIdentifiable, "These data cannot tell: the named"),
    ] {
        d.verdict = verdict;
        let text = headline(&d);
        assert!(text.contains(words), "{text}");
    }
}

#[test]
fn what_would_close_most_and_is_not_named_stands_in_the_headline() {
    let mut d = Diagnosis { verdict: Verdict::NoneOfThese, ..diagnosis() };
    d.effects.iter_mut().for_each(|e| e.accepted = false);
    d.effects[0].confidence = 0.56;
    d.effects[0].gap_closed_fraction = estimate(0.7, 0.1);
    let text = headline(&d);
    assert!(text.contains("no effect of the library surely explains"), "{text}");
    assert!(text.contains("steering delay (delay 0.0470 s) would close 70 %"), "{text}");
    assert!(text.contains("a chance of 56 %"), "{text}");
    d.effects[0].gap_closed_fraction = estimate(0.55, 0.1);
    assert!(headline(&d).contains("no effect of the library explains"), "{}", headline(&d));
}

#[test]
fn no_gap_is_said_only_where_little_is_left() {
    let mut d = Diagnosis { verdict: Verdict::NoGap, ..diagnosis() };
    (d.effects[0].confidence, d.effects[1].confidence) = (0.2, 0.34);
    let text = headline(&d);
    assert!(text.contains("; likeliest is tire relaxation") && text.contains("34 %"), "{text}");
    (d.gap.retuned, d.gap.after) = (estimate(1.2, 0.1), estimate(1.2, 0.1));
    d.gap.unstructured_ceiling = estimate(1.1, 0.1);
    assert!(headline(&d).contains("No gap: model and car agree"), "{}", headline(&d));
    let html = page_since(&d, Some(Before::Drive("monday.mcap")));
    assert!(html.contains("Nothing has changed since monday.mcap but for noise"), "{html}");
}

#[test]
fn what_may_be_there_in_its_place_stands_beside_the_effect_named() {
    let mut d = diagnosis();
    d.effects[1].name = "steering_lag";
    d.effects[1].confidence = 0.25;
    let text = headline(&d);
    assert!(text.contains("steering delay (delay 0.0470 s) or steering lag: 70 %"), "{text}");
    d.effects[1].confidence = 0.05;
    assert!(!headline(&d).contains("or steering lag"));
}

#[test]
fn a_comparison_speaks_of_what_has_changed() {
    let mut d = diagnosis();
    for (verdict, words) in [
        (Verdict::Effects, "What has changed since monday.mcap is steering delay"),
        (Verdict::TireRetuneOnly, "The tires have changed since monday.mcap"),
        (Verdict::NoGap, "Nothing has changed since monday.mcap as far as these data tell; likeliest is"),
        (Verdict::NoneOfThese, "Something has changed since monday.mcap"),
    ] {
        d.verdict = verdict;
        let html = page_since(&d, Some(Before::Drive("monday.mcap")));
        assert!(html.contains(words) && html.contains("Two drives compared"), "{words}");
    }
}

#[test]
fn each_site_is_told_with_its_mechanisms_their_sizes_and_what_remains() {
    let text = gap_text(&diagnosis(), None, &[]);
    let line = text.lines().find(|l| l.starts_with("sites")).unwrap();
    assert!(line.contains("the steering chain 99 %: steering delay (delay 0.0470 ["), "{line}");
    assert!(line.contains("80 % or something that the library lacks 60 %; closes 52 %"), "{line}");
    assert!(line.contains("10 % of that by no effect"), "{line}");
    assert!(
        text.contains(
            "changes    something with the steering chain that the library lacks has changed: 97 %"
        )
    );
    let quiet = Diagnosis { sites: Vec::new(), changes: Vec::new(), ..diagnosis() };
    assert!(gap_text(&quiet, None, &[]).contains("nothing is the matter"));
    assert!(page(&diagnosis()).contains("Where something is the matter"));
}

#[test]
fn other_tires_are_told_by_what_an_axle_gives_at_a_slip() {
    let mut d = diagnosis();
    let difference =
        EffectParameter { value: -0.055, low: -0.07, high: -0.04, unit: "1", before: Some(0.556) };
    d.changes = vec![Change {
        site: "rear_axle",
        name: "tires",
        parameter: Some("force_over_load"),
        at_slip_rad: Some(0.0733),
        difference,
        probability: 0.97,
    }];
    let text = gap_text(&d, None, &[]);
    let line = text.lines().find(|l| l.starts_with("changes")).unwrap();
    assert!(line.contains("F_y/F_z of the rear axle at 4.2 deg of slip has changed by"), "{line}");
    assert!(line.contains("−0.0550") && line.contains("from 0.556: 97 %"), "{line}");
}

#[test]
fn of_several_drives_each_says_whether_it_agrees() {
    let mut d = diagnosis();
    let drive = |name: &str, contradicts| DriveAnswer {
        name: name.to_owned(),
        duration_s: 31.0,
        retuned: estimate(8.0, 1.5),
        after: estimate(3.1, 0.5),
        contradicts,
    };
    d.drives = vec![
        drive("a.mcap", Some(Vec::new())),
        drive("b.mcap", Some(std::mem::take(&mut d.changes))),
        drive("d.mcap", Some(Vec::new())),
        DriveAnswer { retuned: Estimate::UNKNOWN, after: Estimate::UNKNOWN, ..drive("c.mcap", None) },
    ];
    let text = gap_text(&d, None, &[]);
    let line = |name: &str| text.lines().find(|l| l.contains(name)).unwrap();
    assert!(line("a.mcap").starts_with("drives ") && line("a.mcap").ends_with("agrees with the others"));
    let apart = line("c.mcap, 31 s: not explained; ");
    assert!(apart.contains("not compared with the others"), "{text}");
    assert!(line("a.mcap").contains("8.0 (6.5 … 9.5) times the noise"), "{text}");
    let said =
        "contradicts the others: something with the steering chain that the library lacks differs: 97 %";
    assert!(line("b.mcap, 31 s").ends_with(said), "{text}");
    let html = page(&d);
    assert!(html.contains("Drive by drive") && html.contains(said));
    d.drives.remove(2);
    let text = gap_text(&d, None, &[]);
    assert!(text.lines().any(|l| l.ends_with("what the others are held against")), "{text}");
    assert!(!page(&diagnosis()).contains("Drive by drive"));
}

#[test]
fn a_simulator_s_drive_is_the_other_end_of_a_change_that_leads_to_the_car() {
    let mut d = diagnosis();
    for (verdict, words) in [
        (Verdict::Effects, "What differs from the simulator (sim.mcap) to the car is steering delay"),
        (Verdict::TireRetuneOnly, "The tires differ from the simulator (sim.mcap) to the car"),
        (Verdict::NoGap, "Nothing differs from the simulator (sim.mcap) to the car as far as"),
        (Verdict::NoneOfThese, "Something differs from the simulator (sim.mcap) to the car that no effect"),
    ] {
        d.verdict = verdict;
        let html = page_since(&d, Some(Before::Simulator("sim.mcap")));
        assert!(html.contains(words) && html.contains("From simulator to car"), "{words}");
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

/// The rows of the budget: names and figures.
fn budget(html: &str) -> Vec<(String, String)> {
    let bars = &html[html.find("<div class=\"bars\">").unwrap()..html.find("<h2>Effects, ranked").unwrap()];
    let text = |from: &str| from[..from.find("</div>").unwrap()].to_owned();
    let names = bars.split("<div>").skip(1).map(text);
    let values = bars.split("<div class=\"value\">").skip(1).map(text);
    names.zip(values).collect()
}

#[test]
fn every_step_of_the_budget_has_its_bar_its_change_and_its_interval() {
    let mut d = diagnosis();
    d.effects[1].accepted = true;
    d.gap.steps.push(GapStep { effect: "tire_relaxation", error: estimate(2.6, 0.3) });
    d.gap.after = estimate(2.6, 0.3);
    let rows = budget(&page(&d));
    let expected = [
        ("Model as it came", "14.0 (12.0 … 16.0)"),
        ("other tires", "−6.00 to 8.0 (6.5 … 9.5)"),
        ("steering delay", "−4.90 to 3.1 (2.6 … 3.6)"),
        ("tire relaxation", "−0.500 to 2.60 (2.30 … 2.90)"),
        ("unexplained rest", "1.60"),
        ("flexible terms (ceiling)", "−0.200 to 2.40 (2.00 … 2.80)"),
        ("S4 residual, beside tires", "−3.80 to 4.2 (3.6 … 4.8)"),
        ("Noise", "1.00"),
    ];
    let rows: Vec<(&str, &str)> = rows.iter().map(|(name, value)| (name.as_str(), value.as_str())).collect();
    assert_eq!(rows, expected);
}

#[test]
fn what_closes_only_a_part_is_said_so() {
    let mut d = diagnosis();
    (d.gap.retuned, d.gap.after, d.gap_closed_fraction) =
        (estimate(70.0, 9.0), estimate(54.0, 9.0), estimate(0.22, 0.05));
    let words = "Steering delay (delay 0.0470 s), a part of the gap: 22 % (17 … 27 %) of what other tires leave closes; 54 times the noise remains, \
                 and none of the library's effects explains that.";
    assert!(headline(&d).contains(words), "{}", headline(&d));
    assert!(headline(&d).contains("caution"));
    assert!(gap_text(&d, None, &[]).contains("54 times the noise remains, and none"));
    let since = gap_text(&d, Some(Before::Drive("monday.mcap")), &[]);
    assert!(since.contains("Changed since monday.mcap: steering delay (delay 0.0470 s), a part"), "{since}");

    d.verdict = Verdict::TireRetuneOnly;
    d.effects.iter_mut().for_each(|e| e.accepted = false);
    d.gap.steps.clear();
    d.gap.after = d.gap.retuned;
    assert!(headline(&d).contains("Other tires are all that helps; 70 times the noise remains."));
    d.gap.retuned = estimate(1.3, 0.1);
    d.gap.after = d.gap.retuned;
    d.gap.unstructured_ceiling = estimate(1.1, 0.1);
    assert!(headline(&d).contains("Other tires close the gap"));
}

#[test]
fn the_terminal_names_no_step_that_is_not_there() {
    let mut d = diagnosis();
    let text = gap_text(&d, None, &["cut off".to_owned()]);
    let line = |head: &str| text.lines().find(|l| l.starts_with(head)).unwrap().to_owned();
    assert_eq!(
        line("* "),
        "* steering_delay               delay 0.0470 (0.0423 … 0.0517) s; closes 62 % (52 … 72 %); sure 93 % or steering_lag"
    );
    assert_eq!(line("  + "), "  + steering_delay             3.1 (2.6 … 3.6)");
    assert!(text.contains("           cut off\n") && text.lines().count() <= 25, "{text}");
    d.verdict = Verdict::NoneOfThese;
    d.effects.iter_mut().for_each(|e| e.accepted = false);
    d.gap.steps.clear();
    d.gap.after = d.gap.retuned;
    let text = gap_text(&d, None, &[]);
    assert!(!text.contains("effects\n") && !text.contains("  + "), "{text}");
}

#[test]
fn the_likeliest_candidate_is_always_listed() {
    let mut d = diagnosis();
    let names = [
        "cog_shift",
        "v_y_bias",
        "v_y_lever_arm",
        "road_bank",
        "steering_gain",
        "steering_lag",
        "cross_wind",
    ];
    let candidates = names.map(|name| RankedEffect { name, ..d.effects[1].clone() });
    d.effects.extend(candidates);
    d.effects.last_mut().unwrap().confidence = 0.37;
    assert!(gap_text(&d, None, &[]).contains("  cross_wind "));
    assert!(page(&d).contains("<td>cross wind</td>"));
}

#[test]
fn where_the_data_cannot_tell_there_is_the_reason_the_data_and_what_to_drive() {
    let mut d = diagnosis();
    d.verdict = Verdict::NotIdentifiable;
    let html = page(&d);
    let parts: Vec<&str> = html.split("<h2>").skip(1).map(|h| &h[..h.find('<').unwrap()]).collect();
    assert_eq!(parts, ["Data", "Drive or record next"]);
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
