//! A diagnosis with the user's simulator, in words.

use std::fmt::Write as _;

use gripsight_simulator::{RankedEffect, Reason, SimulatorDiagnosis, Verdict};

use super::PatchSaid;
use crate::text::{estimate_of, fixed, percent, percent_estimate, significant};

/// Share of the gap below which a term is not told: it would read as 0 %.
const SHOWN: f64 = 0.005;

/// The verdict in a sentence.
pub(super) fn sentence(d: &SimulatorDiagnosis) -> String {
    let named: Vec<String> =
        d.effects.iter().filter(|e| e.accepted).map(|e| format!("{} ({})", e.name, size(e))).collect();
    let gap = format!(
        "{} to {} times the noise",
        significant(d.gap.nominal.value, 3),
        significant(d.gap.after.value, 3)
    );
    match d.verdict {
        Verdict::Effects => format!("The simulator differs from the car in {}: {gap}.", named.join(" and ")),
        Verdict::NoGap => {
            format!("Simulator and car agree: {} times the noise.", significant(d.gap.nominal.value, 3))
        }
        Verdict::MissingStructure => {
            let largest = d.missing.first().filter(|m| m.closed_fraction >= SHOWN);
            let first = largest.map_or_else(String::new, |m| {
                format!(
                    "; free terms like {} would close {} of the gap",
                    m.name.replace('_', " "),
                    percent(m.closed_fraction)
                )
            });
            let beside =
                if named.is_empty() { String::new() } else { format!(" beside {}", named.join(" and ")) };
            format!("The simulator has no term for what is left of the gap{beside} ({gap}){first}.")
        }
        Verdict::NoneOfThese => format!(
            "A few stretches of the drive hold a gap ({} times the noise over all of it) that neither its parameters nor free terms explain.",
            significant(d.gap.nominal.value, 3)
        ),
    }
}

/// The size of an effect, with what the simulator has now.
pub(super) fn size(e: &RankedEffect) -> String {
    let one = |(name, s): (&String, &gripsight_simulator::Sized)| {
        let unit = if s.unit == "1" { String::new() } else { format!(" {}", s.unit.replace('2', "²")) };
        let value = estimate_of(s.value, s.low, s.high);
        match s.before {
            Some(before) => format!("{} to {value}{unit}", significant(before, 3)),
            None => format!("{} {value}{unit}", name.trim_end_matches("_s").replace('_', " ")),
        }
    };
    let mut text = e.parameters.iter().map(one).collect::<Vec<_>>().join(", ");
    if let Some(u) = &e.unit_error {
        let _ = write!(text, "; a factor of {}: {}", significant(u.ratio, 3), u.name);
    }
    text
}

/// The share of the gap that an effect closes.
pub(super) fn closes(e: &RankedEffect) -> String {
    let g = e.gap_closed_fraction;
    if !g.value.is_finite() {
        return String::new();
    }
    if (g.high - g.low).is_finite() { percent_estimate(g.value, g.low, g.high) } else { percent(g.value) }
}

/// What the simulator has no term for, a sentence each.
pub(super) fn missing(d: &SimulatorDiagnosis) -> Vec<String> {
    let has_none = |name: &str| d.simulator.lacks.iter().any(|l| l == name);
    d.missing
        .iter()
        .filter(|m| m.closed_fraction >= SHOWN)
        .map(|m| {
            let name = m.name.replace('_', " ");
            let share = percent(m.closed_fraction);
            if has_none(&name) {
                format!("Your simulator has no {name}; adding it would close {share} of the gap.")
            } else {
                format!("Terms that work like {name} would close {share} of the gap.")
            }
        })
        .collect()
}

/// A reason in a sentence.
pub(super) fn reason(r: &Reason) -> String {
    match r {
        Reason::Gap { nominal, after } => format!(
            "Rollouts of the simulator as it came miss held-out data by {} times the noise, with what was found by {}.",
            significant(*nominal, 3),
            significant(*after, 3)
        ),
        Reason::Taken { name, wald, needed } if wald < needed => format!(
            "{name} was taken; beside what was found after it its size over its standard error, squared, is {} (by itself it needed {}).",
            significant(*wald, 3),
            significant(*needed, 3)
        ),
        Reason::Taken { name, wald, needed } => format!(
            "{name} was taken: its size over its standard error, squared, is {} ({} were needed).",
            significant(*wald, 3),
            significant(*needed, 3)
        ),
        Reason::Confused { name, with } => {
            format!("This drive cannot tell {name} from {}.", with.join(", "))
        }
        Reason::Missing { closed_fraction, z } => format!(
            "Free terms close {} of the gap beyond that, {} standard deviations from nothing.",
            percent(*closed_fraction),
            significant(*z, 2)
        ),
        Reason::SpeedImposed => {
            "The measured forward speed was imposed: what differs along the car is not called lateral."
                .to_owned()
        }
        Reason::SpeedSimulated => {
            "The forward speed is the simulator's own: what differs along the car can look lateral."
                .to_owned()
        }
    }
}

/// What the data cannot show, a line each.
pub(super) fn invisible(d: &SimulatorDiagnosis) -> Vec<String> {
    d.invisible.iter().map(|i| format!("{}: {}", i.name, i.reason)).collect()
}

/// The diagnosis in some 25 lines.
#[must_use]
pub fn simulator_text(d: &SimulatorDiagnosis, patch: &PatchSaid, data_notes: &[String]) -> String {
    let mut out = String::new();
    let named: Vec<&str> = d.effects.iter().filter(|e| e.accepted).map(|e| e.name.as_str()).collect();
    let line = if named.is_empty() { String::new() } else { format!(": {}", named.join(", ")) };
    let verdict = match d.verdict {
        Verdict::Effects => "effects",
        Verdict::NoGap => "no_gap",
        Verdict::MissingStructure => "missing_structure",
        Verdict::NoneOfThese => "none_of_these",
    };
    let _ = writeln!(out, "verdict    {verdict}{line}");
    let _ = writeln!(out, "           {}", sentence(d));
    let health = &d.data_health;
    let _ = writeln!(out, "data       {:.0} s at {:.0} Hz", health.duration_s, health.rate_hz);
    lines(&mut out, "           ", data_notes);
    let g = &d.gap;
    let of = |e: &gripsight_simulator::Estimate| estimate_of(e.value, e.low, e.high);
    let _ = writeln!(out, "gap        {} as it came, times the noise, on {}", of(&g.nominal), g.scored_on);
    for step in &g.steps {
        let _ = writeln!(out, "           {} with {}", of(&step.error), step.effect);
    }
    let _ = writeln!(out, "           {} with free terms", of(&g.unstructured_ceiling));
    for e in d.effects.iter().filter(|e| e.accepted) {
        let alike = if e.confused_with.is_empty() {
            String::new()
        } else {
            format!("; not told from {}", e.confused_with.join(", "))
        };
        let _ = writeln!(out, "effect     {}: {}, closes {}{alike}", e.name, size(e), closes(e));
    }
    lines(&mut out, "missing    ", &missing(d));
    lines(&mut out, "invisible  ", &invisible(d));
    if patch.is_no_better {
        let _ = writeln!(
            out,
            "patch      none: the patched simulator does no better on held-out data, as far as these tell"
        );
    } else if let Some(error) = patch.verified {
        // As many digits as the figures above have.
        let digits = |value: f64| significant(value, if value < 10.0 { 2 } else { 3 });
        let without = if patch.by_hand.is_empty() { "" } else { ", without what is by hand" };
        let _ = writeln!(
            out,
            "patch      verified: {} to {} times the noise{without}",
            digits(g.nominal.value),
            digits(error)
        );
    }
    lines(&mut out, "by hand    ", &patch.by_hand);
    let _ = writeln!(
        out,
        "cost       {} rollouts of the recording for {} candidates: {} s, {} s of them in the simulator",
        fixed(d.simulator.rollouts, 0),
        d.simulator.candidates,
        significant(d.simulator.took_s[0], 2),
        significant(d.simulator.took_s[1], 2)
    );
    out
}

fn lines(out: &mut String, head: &str, sentences: &[String]) {
    for sentence in sentences {
        let _ = writeln!(out, "{head}{sentence}");
    }
}
