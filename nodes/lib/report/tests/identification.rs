//! The identification page on a made-up outcome.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

use std::f64::consts::TAU;

use gripsight_identification::{
    Change, Config, DriveNext, Estimate, FrictionPrior, Given, Handling, HandlingPoint, HorizonError,
    IterationRecord, LimitsAt, Longitudinal, Manoeuvre, Nuisance, Outcome, PeakFriction, PerAxle,
    ProvisionalSet, Range, Recorded, Rmse, RmseReport, RunKey, SignalCorrections, SignalEstimates, Source,
    Status, TireCurve, Told, Trace, ValidWithin, WeakSignal,
};
use gripsight_report::{Header, IdentificationInput, identification_page};
use gripsight_signals::DataHealth;
use gripsight_vehicle::{PacejkaParameters, VehicleParameters};

fn header() -> Header {
    Header {
        car: "car <1>".into(),
        bag: "laps.mcap".into(),
        data_stamp: "2023-11-14T22:13:34.271Z".into(),
        tool_version: "0.1.0".into(),
        vehicle_hash: "00ab".into(),
        seed: Some(7),
        command: "gripsight identify laps.mcap --seed 7 --out DIR".into(),
    }
}

fn outcome() -> Outcome {
    let config = Config::default();
    let phi_p = PacejkaParameters::from_array([7.0, 1.6, 0.48, 0.1, 9.0, 1.5, 0.5, -0.2]);
    let estimate = |value: f64, half: f64| Estimate { value, low: value - half, high: value + half };
    let peak = |value: f64| PeakFriction {
        value,
        low: value - 0.02,
        high: value + 0.02,
        reached: true,
        from_prior: false,
    };
    let curve = |initial: &gripsight_vehicle::MagicFormula, found: &gripsight_vehicle::MagicFormula| {
        let slip_rad: Vec<f64> = (0..120).map(|k| f64::from(k) * 0.003).collect();
        let over = |scale: f64, tire: &gripsight_vehicle::MagicFormula| {
            slip_rad.iter().map(|&a| scale * tire.normalized_force(a)).collect::<Vec<_>>()
        };
        TireCurve {
            initial: over(1.0, initial),
            identified: over(1.0, found),
            low: over(0.95, found),
            high: over(1.05, found),
            density: slip_rad.iter().map(|a| (900.0 * (-a * 20.0).exp()) as u32).collect(),
            slip_rad,
        }
    };
    let change = |after: f64| Change { before: 3.0 * after, after };
    let rmse =
        |after: f64| Rmse { before: 3.0 * after, after, v_y_mps: change(0.02), yaw_rate_radps: change(0.05) };
    let time_s: Vec<f64> = (0..6000).map(|k| f64::from(k) * 0.01).collect();
    let wave = |f: f64, a: f64| time_s.iter().map(|t| a * (TAU * f * t).sin()).collect::<Vec<_>>();
    Outcome {
        phi_p,
        found: phi_p,
        status: Status::Accepted,
        valid_within: ValidWithin {
            slip_rad: PerAxle { front: 0.21, rear: 0.15 },
            force_n: PerAxle { front: 7.9, rear: 9.2 },
        },
        provisional: None,
        cornering_stiffness_n_per_rad: PerAxle { front: estimate(61.2, 4.0), rear: estimate(83.1, 6.0) },
        peak_friction: PerAxle { front: peak(0.48), rear: peak(0.5) },
        iterations: 3,
        converged: true,
        accepted: true,
        reasons: vec!["rear.c rests on 3 % of the samples".into()],
        slip_range_rad: PerAxle {
            front: Range { low: -0.2, high: 0.21 },
            rear: Range { low: -0.15, high: 0.12 },
        },
        v_x_range_mps: Range { low: 0.5, high: 4.8 },
        mean_speed_mps: 2.7,
        signals: SignalCorrections::NONE,
        signal_intervals: SignalEstimates {
            steering_delay_s: estimate(0.081, 0.002),
            steering_gain: estimate(0.97, 0.02),
            steering_offset_rad: estimate(-0.004, 0.001),
            v_y_lever_arm_m: estimate(-0.031, 0.004),
            v_y_bias_mps: estimate(0.001, 0.004),
            yaw_rate_bias_radps: estimate(0.0, 0.003),
        },
        weak_signals: vec![WeakSignal { name: "yaw_rate_bias_radps", data_share: 0.04, prior_sigma: 0.01 }],
        nuisance: Nuisance { relaxation_m: 0.05, combined_slip: 0.3, load_transfer: 0.8 },
        fitted: config.initial,
        rmse: RmseReport { one_step: rmse(1.1), rollout: rmse(2.3), horizon_s: 1.0, noise: [0.01, 0.02] },
        rollout_error: (1..=20)
            .map(|k| f64::from(k) * 0.1)
            .map(|horizon_s| HorizonError {
                horizon_s,
                v_y_mps: Change { before: 0.01 + 0.06 * horizon_s, after: 0.01 + 0.01 * horizon_s },
                yaw_rate_radps: Change { before: 0.02 + 0.12 * horizon_s, after: 0.02 + 0.02 * horizon_s },
            })
            .collect(),
        source: Source::ResidualLoop,
        on_bound: vec!["rear.c".into()],
        initial: config.initial,
        least_squares: Some(phi_p),
        history: (1..=3)
            .map(|iteration| IterationRecord {
                iteration,
                phi_p,
                change: 0.3 / f64::from(iteration * iteration),
                fit_rmse: 0.01,
                evaluations: 400,
                sweep_speed_mps: 3.2,
                extrapolated_share: 0.2,
                validation_rmse: 2.4,
                residual_left: 0.3,
                epochs: 60,
                residual_loss: 0.4,
            })
            .collect(),
        curves: PerAxle {
            front: curve(&config.initial.front, &phi_p.front),
            rear: curve(&config.initial.rear, &phi_p.rear),
        },
        prior: Some(FrictionPrior { mu: 0.6, sigma: 0.1 }),
        grip: None,
        grip_change: None,
        handling: Handling {
            understeer_gradient_rad_per_mps2: estimate(0.004, 0.001),
            up_to_a_y_mps2: 2.3,
            diagram: (1..=4)
                .map(f64::from)
                .map(|a_y_mps2| HandlingPoint { a_y_mps2, steering_rad: estimate(0.004 * a_y_mps2, 0.002) })
                .collect(),
        },
        longitudinal: Longitudinal::default(),
        health: DataHealth {
            samples: 6000,
            duration_s: 59.99,
            rate_hz: 100.0,
            jitter_s: 0.0002,
            gaps: Vec::new(),
            frozen: Vec::new(),
            moving_share: 0.97,
            recorded: vec!["x_m", "y_m", "yaw_rad"],
        },
        drive_next: vec![DriveNext {
            manoeuvre: Manoeuvre::CornerHarder,
            v_x_mps: None,
            a_y_mps2: Some(9.1),
            why: "Corner harder: the rear tires saw slip up to 8.6° only".into(),
        }],
        key: RunKey {
            run_id: String::new(),
            sequence_id: 1,
            iteration: 3,
            vehicle_hash: "00ab".into(),
            seed: 7,
        },
        config,
        vehicle: VehicleParameters::f1tenth(),
        recorded: Recorded::default(),
        trace: Trace {
            v_x_mps: vec![3.0; time_s.len()],
            a_y_mps2: wave(0.31, 4.0),
            a_x_mps2: wave(0.23, 2.0),
            x_m: wave(0.05, 10.0),
            y_m: wave(0.1, 5.0),
            slip_rad: PerAxle { front: wave(0.3, 0.2), rear: wave(0.3, 0.15) },
            v_y_mps: wave(0.3, 0.3),
            v_y_before_mps: wave(0.3, 0.45),
            v_y_after_mps: wave(0.3, 0.31),
            yaw_rate_radps: wave(0.3, 2.0),
            yaw_rate_before_radps: wave(0.3, 1.4),
            yaw_rate_after_radps: wave(0.3, 1.95),
            time_s,
        },
    }
}

fn page(outcome: &Outcome) -> String {
    let truth: Vec<(f64, f64)> =
        (0..100).map(|k| (f64::from(k) * 0.002, 0.49 * (f64::from(k) * 0.02).tanh())).collect();
    let truth = PerAxle { front: truth.clone(), rear: truth };
    let notes = ["2 odometry messages came twice and were left out".to_owned()];
    let input = IdentificationInput { outcome, header: &header(), truth: Some(&truth), data_notes: &notes };
    identification_page(&input).unwrap()
}

#[test]
fn the_page_stands_alone_and_repeats() {
    let html = page(&outcome());
    assert_eq!(html, page(&outcome()));
    for outside in ["<script", "<link", "<img", "src=", "url(", "@import"] {
        assert!(!html.contains(outside), "{outside}");
    }
    let addresses: Vec<&str> = html.match_indices("http").map(|(at, _)| &html[at..at + 26]).collect();
    assert!(addresses.iter().all(|a| *a == "http://www.w3.org/2000/svg"), "{addresses:?}");
    assert!(html.contains("car &lt;1&gt;"), "the car's name is text, not markup");
    assert!(!html.contains("NaN"));
    std::fs::write(concat!(env!("CARGO_TARGET_TMPDIR"), "/identification.html"), html).unwrap();
}

#[test]
fn the_verdict_says_what_the_figures_rest_on() {
    let accepted = outcome();
    assert!(
        page(&accepted).contains("Accepted. Peak friction front 0.480 (0.460 … 0.520), rear")
            || page(&accepted).contains("Accepted. Peak friction front 0.480")
    );

    // 0.004 rad per m/s2, plus or minus a quarter.
    assert!(page(&accepted).contains("2.2 (1.7 … 2.8) up to 2.3 m/s2: understeers"));

    let mut within = outcome();
    within.status = Status::AcceptedWithin;
    within.peak_friction = within.peak_friction.map(|p| PeakFriction { reached: false, ..p });
    let from_prior =
        PeakFriction { value: 0.6, low: f64::NAN, high: f64::NAN, reached: false, from_prior: true };
    within.provisional = Some(ProvisionalSet {
        phi_p: within.phi_p,
        peak_friction: PerAxle { front: from_prior, rear: from_prior },
    });
    let html = page(&within);
    assert!(html.contains(
        "Accepted within the slips driven, 12.0° front and 8.59° rear, and the forces shown, 7.90 and 9.20 N."
    ));
    assert!(html.contains("Peak friction unknown, peak not reached front and rear"));
    assert!(html.contains("0.60 from the prior"));

    let mut rejected = outcome();
    (rejected.accepted, rejected.status) = (false, Status::Rejected);
    rejected.reasons = vec!["the peak was not reached and there is no prior".into()];
    rejected.peak_friction.front.reached = false;
    let html = page(&rejected);
    assert!(
        html.contains("<h1 class=\"caution\">Not accepted: the peak was not reached and there is no prior.")
    );
    assert!(html.contains("front unknown, peak not reached"));
}

#[test]
fn the_drive_train_is_shown_with_what_is_unknown() {
    let mut told = outcome();
    told.longitudinal.gain = Told::Known(Estimate { value: 0.96, low: 0.93, high: 0.99 });
    let given = |value: f64, reached: bool| Some(Given { value, reached });
    let v_x_mps = Range { low: 1.0, high: 2.5 };
    told.longitudinal.limits =
        vec![LimitsAt { v_x_mps, a_max_mps2: given(4.0, true), a_min_mps2: given(-6.5, false) }];
    let html = page(&told);
    for part in ["0.960 (0.930 … 0.990)", "drag 1/m</td><td>unknown", "4.0 reached, −6.5 shown"] {
        assert!(html.contains(part), "{part}");
    }
}

#[test]
fn a_refused_run_makes_a_page_without_pictures() {
    let mut refused = outcome();
    (refused.accepted, refused.status) = (false, Status::Rejected);
    refused.source = Source::Start;
    refused.reasons = vec!["the car hardly turned".into()];
    refused.curves = PerAxle::default();
    refused.rollout_error.clear();
    refused.history.clear();
    refused.trace = Trace::default();
    let html = page(&refused);
    assert!(!html.contains("<figure>") && html.contains("Not accepted: the car hardly turned"));
    assert!(html.contains("Tires that the run started from"));
}
