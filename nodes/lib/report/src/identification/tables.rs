//! The tables of an identification.

use gripsight_identification::{Outcome, PeakFriction, PerAxle, Range};
use maud::{Markup, html};

use super::words::{drive_train, estimate, peak_friction};
use crate::health::health;
use crate::page::{facts_table, list, table};
use crate::text::{fixed, interval, percent, significant, with_interval};

/// Parameters, stiffness, grip and slip visited.
pub(super) fn tires(outcome: &Outcome) -> Markup {
    let bound = |name: &str, value: f64| {
        let flag = if outcome.on_bound.iter().any(|b| b == name) { " on its bound" } else { "" };
        format!("{}{flag}", significant(value, 3))
    };
    let (f, r) = (&outcome.phi_p.front, &outcome.phi_p.rear);
    let letter = |name: &str, letter: &str, front: f64, rear: f64| {
        [name.to_owned(), bound(&format!("front.{letter}"), front), bound(&format!("rear.{letter}"), rear)]
    };
    let slip = |r: &Range| format!("{}°", interval(r.low.to_degrees(), r.high.to_degrees()));
    let stiffness = &outcome.cornering_stiffness_n_per_rad;
    let valid = &outcome.valid_within;
    let degrees = |slip_rad: f64| format!("{}°", significant(slip_rad.to_degrees(), 3));
    let provisional = |axle: fn(&PerAxle<PeakFriction>) -> PeakFriction| {
        outcome
            .provisional
            .as_ref()
            .map_or_else(|| "–".to_owned(), |p| peak_friction(&axle(&p.peak_friction)))
    };
    table(
        ["", "Front", "Rear"],
        &[
            ["Cornering stiffness / (N/rad)".into(), estimate(&stiffness.front), estimate(&stiffness.rear)],
            [
                "Peak friction".into(),
                peak_friction(&outcome.peak_friction.front),
                peak_friction(&outcome.peak_friction.rear),
            ],
            [
                "Peak friction with the prior, provisional".into(),
                provisional(|p| p.front),
                provisional(|p| p.rear),
            ],
            ["Slip visited".into(), slip(&outcome.slip_range_rad.front), slip(&outcome.slip_range_rad.rear)],
            ["Valid up to a slip of".into(), degrees(valid.slip_rad.front), degrees(valid.slip_rad.rear)],
            [
                "Force promised at most / N".into(),
                significant(valid.force_n.front, 3),
                significant(valid.force_n.rear, 3),
            ],
            letter("B / (1/rad)", "b", f.b, r.b),
            letter("C", "c", f.c, r.c),
            letter("D", "d", f.d, r.d),
            letter("E", "e", f.e, r.e),
        ],
    )
}

/// Corrections with intervals; angles in the units of the files.
pub(super) fn signals(outcome: &Outcome) -> Markup {
    let s = &outcome.signal_intervals;
    let rows = [
        ("Steering delay and lag / s", "steering_delay_s", s.steering_delay_s),
        ("Steering gain", "steering_gain", s.steering_gain),
        ("Steering offset / rad", "steering_offset_rad", s.steering_offset_rad),
        ("v_y measured ahead of the CoG / m", "v_y_lever_arm_m", s.v_y_lever_arm_m),
        ("v_y bias / (m/s)", "v_y_bias_mps", s.v_y_bias_mps),
        ("Yaw rate bias / (rad/s)", "yaw_rate_bias_radps", s.yaw_rate_bias_radps),
    ]
    .map(|(title, name, e)| {
        let (value, interval) = with_interval(e.value, e.low, e.high);
        let weak = outcome.weak_signals.iter().find(|w| w.name == name);
        let rests = weak.map_or_else(|| "data".to_owned(), |w| format!("data {}", percent(w.data_share)));
        [title.to_owned(), value, interval, rests]
    });
    table(["", "Value", "90 %", "Rests on"], &rows)
}

/// What the drive tells of motor, brakes and resistances.
pub(super) fn longitudinal(outcome: &Outcome) -> Markup {
    html! {
        (table(["", "Value (90 %)"], &drive_train(&outcome.longitudinal)))
        p { "Reached: more was asked for and not given. Shown: the largest that was asked for was given." }
    }
}

/// Errors before and after.
pub(super) fn errors(outcome: &Outcome) -> Markup {
    let r = &outcome.rmse;
    let row = |name: String, before: f64, after: f64| {
        let gain = if before > 0.0 { percent(after / before - 1.0) } else { String::new() };
        [name, significant(before, 3), significant(after, 3), gain]
    };
    let horizon = significant(r.horizon_s, 2);
    let noise = |k: usize| significant(r.noise[k], 2);
    html! {
        (table(["RMS error", "Before", "After", "Change"], &[
            row("One step, over noise".into(), r.one_step.before, r.one_step.after),
            row("One step, v_y / (m/s)".into(), r.one_step.v_y_mps.before, r.one_step.v_y_mps.after),
            row("One step, yaw rate / (rad/s)".into(), r.one_step.yaw_rate_radps.before, r.one_step.yaw_rate_radps.after),
            row(format!("{horizon} s, over noise"), r.rollout.before, r.rollout.after),
            row(format!("{horizon} s, v_y / (m/s)"), r.rollout.v_y_mps.before, r.rollout.v_y_mps.after),
            row(format!("{horizon} s, yaw rate / (rad/s)"), r.rollout.yaw_rate_radps.before, r.rollout.yaw_rate_radps.after),
        ]))
        p { "Before: start tires, signals as recorded. After: tires found, signals corrected. Noise: v_y " (noise(0)) " m/s, yaw rate " (noise(1)) " rad/s." }
    }
}

/// What the data are like.
pub(super) fn data(outcome: &Outcome, notes: &[String]) -> Markup {
    let speeds = &outcome.v_x_range_mps;
    let speed = format!(
        "{} … {} m/s, mean {} m/s",
        fixed(speeds.low, 1),
        fixed(speeds.high, 1),
        fixed(outcome.mean_speed_mps, 1)
    );
    let mut facts = health(&outcome.health);
    facts.push(("Speed", speed));
    html! {
        (facts_table(&facts))
        @if !notes.is_empty() { (list(notes, "")) }
    }
}

/// Turn by turn.
pub(super) fn iterations(outcome: &Outcome) -> Markup {
    let rows: Vec<[String; 8]> = outcome
        .history
        .iter()
        .map(|i| {
            [
                i.iteration.to_string(),
                percent(i.change),
                significant(i.validation_rmse, 3),
                significant(i.fit_rmse, 2),
                format!("{} m/s", fixed(i.sweep_speed_mps, 1)),
                percent(i.extrapolated_share),
                i.epochs.to_string(),
                significant(i.residual_loss, 3),
            ]
        })
        .collect();
    table(
        [
            "Turn",
            "Change of the curves",
            "Held-out error",
            "Fit error",
            "Sweep speed",
            "Extrapolated",
            "Epochs",
            "Residual loss",
        ],
        &rows,
    )
}
