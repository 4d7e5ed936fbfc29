//! The diagnosis on a terminal, in some 25 lines.

use std::fmt::Write;

use gripsight_diagnosis::{Diagnosis, Place, Verdict};
use gripsight_estimation::Estimate;

use super::drives;
use super::figures;
use super::sites;
use super::verdict::{Before, sentence};
use super::words::{closes, figure, listed, sizes, unit, words};
use crate::text::{fixed, interval, percent};

/// Candidates listed beside the effects named.
const CANDIDATES: usize = 3;
/// Circumstances listed.
const CIRCUMSTANCES: usize = 2;

/// The diagnosis in some 25 lines. `before` is the drive that it is compared with; `data_notes` is what reading the data met.
#[must_use]
pub fn gap_text(d: &Diagnosis, before: Option<Before<'_>>, data_notes: &[String]) -> String {
    let mut out = String::new();
    let named: Vec<&str> = d.effects.iter().filter(|e| e.accepted).map(|e| e.name).collect();
    let line = if named.is_empty() { String::new() } else { format!(": {}", named.join(", ")) };
    let health = &d.data_health;
    let _ = writeln!(out, "verdict    {}{line}", d.verdict.name());
    let _ = writeln!(out, "           {}", sentence(d, before));
    let _ = writeln!(
        out,
        "data       {:.0} s at {:.0} Hz, jitter {:.1} ms, {} gaps, {} frozen spans",
        health.duration_s,
        health.rate_hz,
        1e3 * health.jitter_s,
        health.gaps.len(),
        health.frozen.len()
    );
    lines(&mut out, "           ", data_notes);
    if d.verdict == Verdict::NotIdentifiable {
        lines(&mut out, "next       ", &d.drive_next);
        return out;
    }
    for identity in d.identities.iter().filter(|i| i.informative) {
        let _ = writeln!(out, "identity   {}: {}", identity.name, identity.finding);
    }
    budget(&mut out, d);
    drives::lines(&mut out, d);
    sites::lines(&mut out, d);
    figures::lines(&mut out, d);
    effects(&mut out, d);
    places(&mut out, d);
    // What `next` says how to see needs no line of its own.
    let invisible =
        d.invisible.iter().map(|i| i.name).filter(|name| !d.drive_next.iter().any(|n| n.contains(name)));
    let invisible: Vec<&str> = invisible.collect();
    if !invisible.is_empty() {
        let _ = writeln!(out, "invisible  {}", invisible.join(", "));
    }
    // The first repeats the figures.
    lines(&mut out, "because    ", d.reasons.get(1..).unwrap_or_default());
    lines(&mut out, "next       ", &d.drive_next);
    out
}

fn lines(out: &mut String, head: &str, sentences: &[String]) {
    for sentence in sentences {
        let _ = writeln!(out, "{head}{sentence}");
    }
}

/// The error after every step.
fn budget(out: &mut String, d: &Diagnosis) {
    let g = &d.gap;
    let _ = writeln!(
        out,
        "gap        mean squared error over noise (1 is noise), {} s rollouts, {}",
        fixed(g.horizon_s, 0),
        g.scored_on
    );
    let mut line = |name: &str, e: &Estimate| {
        if e.value.is_finite() {
            let _ = writeln!(out, "  {name:<28} {}", figure(e));
        }
    };
    line("model as it came", &g.nominal);
    line("with other tires", &g.retuned);
    for step in &g.steps {
        line(&format!("+ {}", step.effect), &step.error);
    }
    line("flexible terms (ceiling)", &g.unstructured_ceiling);
    line("S4 residual, beside tires", &g.s4_residual);
}

/// The best effects: `*` marks those named.
fn effects(out: &mut String, d: &Diagnosis) {
    let named = d.effects.iter().filter(|e| e.accepted).count();
    for e in listed(d, named + CANDIDATES) {
        let mark = if e.accepted { '*' } else { ' ' };
        let group = if e.confused_with.is_empty() {
            String::new()
        } else {
            format!(" or {}", e.confused_with.join(", "))
        };
        let closed = closes(&e.gap_closed_fraction);
        let closed = if e.gap_closed_fraction.value < 0.0 { closed } else { format!("closes {closed}") };
        let _ = writeln!(
            out,
            "{mark} {:<28} {}; {closed}; sure {}{group}",
            e.name,
            sizes(e),
            percent(e.confidence)
        );
    }
}

/// The channels by their share, and the circumstances that stand out most from an even spread.
fn places(out: &mut String, d: &Diagnosis) {
    let w = &d.places;
    let mut channels: Vec<&Place> = w.channel.iter().collect();
    channels.sort_by(|a, b| b.share.total_cmp(&a.share));
    let shares: Vec<String> =
        channels.iter().map(|p| format!("{} {}", words(p.channel), percent(p.share))).collect();
    let _ = writeln!(out, "where      of the squared error: {}", shares.join(", "));
    let circumstances: [(&str, &[Place]); 7] = [
        ("speed", &w.speed),
        ("lateral acceleration", &w.lateral_acceleration),
        ("slip", &w.slip),
        ("steering rate", &w.steering_rate),
        ("longitudinal acceleration", &w.longitudinal_acceleration),
        ("place on the lap", &w.track_position),
        ("time", &w.time),
    ];
    // Bins hold equally many samples: an even spread is one over their number.
    let mut worst: Vec<(f64, &str, &Place)> = circumstances
        .into_iter()
        .filter_map(|(name, bins)| {
            let most = bins.iter().max_by(|a, b| a.share.total_cmp(&b.share))?;
            Some((most.share * bins.len() as f64, name, most))
        })
        .collect();
    worst.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (times, name, p) in worst.into_iter().take(CIRCUMSTANCES) {
        let _ = writeln!(
            out,
            "           {name} {}{}: {}, {times:.1} times its share of the samples",
            interval(p.low, p.high),
            unit(p.unit),
            percent(p.share)
        );
    }
}
