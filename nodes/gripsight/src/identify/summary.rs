//! What the terminal says.

use std::fmt::Write as _;
use std::path::PathBuf;

use gripsight_identification::{Outcome, Range};
use gripsight_report::text::{interval, significant, with_interval};
use gripsight_report::{UNKNOWN, drive_train, estimate, peak_friction, status, understeer};

use super::progress::Timing;

/// The result in about 40 lines. `notes`: what is to be said of the data.
pub(super) fn summary(
    car: &str,
    result: &Outcome,
    notes: &[String],
    files: &[PathBuf],
    timing: &Timing,
) -> String {
    let mut text = String::new();
    let verdict = status(result);
    let _ = writeln!(text, "{car}: {verdict}");
    for reason in &result.reasons {
        let _ = writeln!(text, "  - {reason}");
    }
    tires(&mut text, result);
    if let Some(set) = &result.provisional {
        let d = set.peak_friction.map(|p| peak_friction(&p));
        let _ = writeln!(text, "{:<28}{:<32}{}", "peak friction, provisional", d.front, d.rear);
    }
    signals(&mut text, result);
    text.push('\n');
    let (unknown, known): (Vec<_>, Vec<_>) =
        drive_train(&result.longitudinal).into_iter().partition(|[_, value]| value == UNKNOWN);
    for [title, value] in known {
        let _ = writeln!(text, "{title:<28}{value}");
    }
    if !unknown.is_empty() {
        let titles: Vec<String> = unknown.into_iter().map(|[title, _]| title).collect();
        let _ = writeln!(text, "{UNKNOWN:<28}{}", titles.join(", "));
    }
    let r = &result.rmse;
    let turns = if result.converged { "converged" } else { "not converged" };
    let rows = [
        (
            "error, one step",
            format!(
                "{} -> {} times the noise",
                significant(r.one_step.before, 3),
                significant(r.one_step.after, 3)
            ),
        ),
        (
            "error, rollout",
            format!(
                "{} -> {} times the noise over {} s",
                significant(r.rollout.before, 3),
                significant(r.rollout.after, 3),
                significant(r.horizon_s, 2)
            ),
        ),
        ("loop", format!("{} turns, {turns}", result.iterations)),
    ];
    text.push('\n');
    for (name, value) in rows {
        let _ = writeln!(text, "{name:<28}{value}");
    }
    for drive in &result.drive_next {
        let _ = writeln!(text, "{:<28}{drive}", "drive next");
    }
    for note in notes {
        let _ = writeln!(text, "{:<28}{note}", "data");
    }
    text.push('\n');
    for file in files {
        let _ = writeln!(text, "{}", file.display());
    }
    let _ = writeln!(
        text,
        "{:.2} s: reading {:.2}, camera {:.2}, signals and direct fit {:.2}, training {:.2}, sweep {:.2}, fit {:.2}, own tires {:.2}, files {:.2}",
        timing.total_s,
        timing.reading_s,
        timing.camera_s,
        timing.preparing_s,
        timing.training_s,
        timing.sweep_s,
        timing.fit_s,
        timing.posterior_s,
        timing.writing_s
    );
    text
}

fn tires(text: &mut String, result: &Outcome) {
    let valid =
        |of: &dyn Fn(&gripsight_identification::ValidWithin) -> f64| significant(of(&result.valid_within), 3);
    let slip = |r: &Range| interval(r.low.to_degrees(), r.high.to_degrees());
    let letters =
        |t: &gripsight_vehicle::MagicFormula| [t.b, t.c, t.d, t.e].map(|v| significant(v, 3)).join("  ");
    let (k, d, s) = (&result.cornering_stiffness_n_per_rad, &result.peak_friction, &result.slip_range_rad);
    let rows = [
        ("", "front".to_owned(), "rear".to_owned()),
        ("peak friction", peak_friction(&d.front), peak_friction(&d.rear)),
        ("cornering stiffness N/rad", estimate(&k.front), estimate(&k.rear)),
        ("slip visited deg", slip(&s.front), slip(&s.rear)),
        (
            "valid to slip deg",
            valid(&|v| v.slip_rad.front.to_degrees()),
            valid(&|v| v.slip_rad.rear.to_degrees()),
        ),
        ("valid to force N", valid(&|v| v.force_n.front), valid(&|v| v.force_n.rear)),
        ("B  C  D  E", letters(&result.phi_p.front), letters(&result.phi_p.rear)),
    ];
    text.push('\n');
    for (name, front, rear) in rows {
        let _ = writeln!(text, "{name:<28}{front:<32}{rear}");
    }
    let _ = writeln!(text, "{:<28}{}", "understeer gradient deg/g", understeer(&result.handling));
}

fn signals(text: &mut String, result: &Outcome) {
    let s = &result.signal_intervals;
    let rows = [
        ("steering delay and lag s", "steering_delay_s", s.steering_delay_s),
        ("steering gain", "steering_gain", s.steering_gain),
        ("steering offset rad", "steering_offset_rad", s.steering_offset_rad),
        ("v_y ahead of the CoG m", "v_y_lever_arm_m", s.v_y_lever_arm_m),
        ("v_y bias m/s", "v_y_bias_mps", s.v_y_bias_mps),
        ("yaw rate bias rad/s", "yaw_rate_bias_radps", s.yaw_rate_bias_radps),
    ];
    text.push('\n');
    for (title, name, e) in rows {
        let (value, interval) = with_interval(e.value, e.low, e.high);
        let weak = result.weak_signals.iter().any(|w| w.name == name);
        let note = if weak { ", mostly assumed" } else { "" };
        let _ = writeln!(text, "{title:<28}{value} ({interval}){note}");
    }
}
