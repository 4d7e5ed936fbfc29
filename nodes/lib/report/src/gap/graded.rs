//! The graded answer as lines: how likely each site is at fault, which mechanism, and what has changed.

use std::fmt::Write;

use gripsight_diagnosis::{Change, EffectParameter, Graded, SiteAnswer};

use super::words::{unit, words};
use crate::text::{interval, percent, significant};

/// Probability from which a site, or something that the library lacks, is worth a line.
const WORTH_A_LINE: f64 = 0.5;
/// Probability from which a mechanism is worth a word beside others.
const WORTH_A_WORD: f64 = 0.1;
/// Changes listed at most.
const CHANGES: usize = 6;

/// The graded answer for a terminal.
#[must_use]
pub fn graded_text(graded: &Graded) -> String {
    let mut out = String::new();
    let mut head = "sites";
    for site in graded.sites.iter().filter(|s| s.probability >= WORTH_A_LINE) {
        let _ = writeln!(out, "{head:<10} {}", site_line(graded, site));
        head = "";
    }
    if head == "sites" {
        let _ = writeln!(out, "{head:<10} nothing is the matter at any of them, as far as these data tell");
    }
    let mut head = "changes";
    for change in graded.changes.iter().take(CHANGES) {
        let _ = writeln!(out, "{head:<10} {}", change_line(change));
        head = "";
    }
    let _ = writeln!(out, "           (graded answer: probabilities not calibrated on sealed cases yet)");
    out
}

/// A site in one line: how sure, which mechanisms and how large, what it closes.
fn site_line(graded: &Graded, site: &SiteAnswer) -> String {
    let mut mechanisms: Vec<String> = site
        .mechanisms
        .iter()
        .filter(|m| m.probability >= WORTH_A_WORD)
        .map(|m| {
            let of = graded.mechanisms.iter().find(|e| e.name == m.name);
            let size = of.and_then(|e| e.parameters.iter().next()).map_or_else(String::new, sized);
            let doubt = of.is_some_and(|e| !e.accepted && e.probability >= WORTH_A_LINE);
            let doubt = if doubt { ", a candidate" } else { "" };
            format!("{}{size} {}{doubt}", words(m.name), percent(m.probability))
        })
        .collect();
    if site.other_probability >= WORTH_A_WORD {
        mechanisms.push(format!("something that the library lacks {}", percent(site.other_probability)));
    }
    let closes = if site.closed_fraction.value.is_finite() {
        format!("; closes {}", percent(site.closed_fraction.value))
    } else {
        String::new()
    };
    let rest = if site.other_probability >= WORTH_A_LINE && site.unexplained_fraction.is_finite() {
        format!(", {} of that by no effect of the library", percent(site.unexplained_fraction))
    } else {
        String::new()
    };
    format!("{} {}: {}{closes}{rest}", place(site.name), percent(site.probability), mechanisms.join(" or "))
}

/// A parameter with its interval, in brackets.
fn sized((name, p): (&&'static str, &EffectParameter)) -> String {
    if p.value.is_finite() {
        format!(
            " ({} {} [{}]{})",
            words(name),
            significant(p.value, 3),
            interval(p.low, p.high),
            unit(p.unit)
        )
    } else {
        String::new()
    }
}

/// A change between two drives in one line.
fn change_line(change: &Change) -> String {
    let what = if change.name == "other" {
        format!("something with {} that the library lacks", place(change.site))
    } else {
        words(change.name)
    };
    let d = &change.difference;
    let size = if d.value.is_finite() {
        format!(" by {} ({}){}", significant(d.value, 3), interval(d.low, d.high), unit(d.unit))
    } else {
        String::new()
    };
    format!("{what} has changed{size}: {}", percent(change.probability))
}

/// A site as people call it.
fn place(name: &str) -> &str {
    match name {
        "steering" => "the steering chain",
        "front_axle" => "the front axle",
        "rear_axle" => "the rear axle",
        "loads_and_body" => "loads and body",
        "drive_train" => "the drive train",
        "v_x" => "the reported speed",
        "v_y" => "the reported v_y",
        "yaw_rate" => "the reported yaw rate",
        "imu" => "the inertial unit",
        "road_and_wind" => "road and wind",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use gripsight_diagnosis::{MechanismAnswer, SizedEffect};
    use gripsight_estimation::Estimate;

    use super::*;

    #[test]
    fn a_site_is_told_with_its_mechanisms_their_sizes_and_what_remains() {
        let delay = EffectParameter { value: 0.05, low: 0.046, high: 0.054, unit: "s", before: None };
        let mechanism = |name, probability| MechanismAnswer { name, probability };
        let graded = Graded {
            sites: vec![SiteAnswer {
                name: "steering",
                probability: 0.99,
                closed_fraction: Estimate { value: 0.52, low: 0.4, high: 0.6 },
                mechanisms: vec![mechanism("steering_delay", 0.61), mechanism("steering_gain", 0.03)],
                other_probability: 0.02,
                unexplained_fraction: 0.1,
            }],
            mechanisms: vec![SizedEffect {
                name: "steering_delay",
                probability: 0.61,
                accepted: true,
                needed_fraction: 0.5,
                parameters: BTreeMap::from([("delay_s", delay.clone())]),
                confused_with: vec!["steering_lag"],
            }],
            changes: vec![Change {
                site: "steering",
                name: "steering_delay",
                difference: EffectParameter { value: -0.04, low: -0.05, high: -0.03, ..delay },
                probability: 0.97,
            }],
            rounds: 3,
            dispersion: 2.0,
        };
        let text = graded_text(&graded);
        assert!(text.contains("the steering chain 99 %: steering delay (delay 0.0500 [0.046"), "{text}");
        assert!(text.contains("61 %; closes 52 %") && !text.contains("gain"), "{text}");
        assert!(
            text.contains("steering delay has changed by \u{2212}0.0400") && text.contains("97 %"),
            "{text}"
        );
        let quiet = Graded { sites: Vec::new(), changes: Vec::new(), ..graded };
        assert!(graded_text(&quiet).contains("nothing is the matter"));
    }
}
