//! The graded answer: how likely something is the matter at each site, which mechanism, and what has changed.

use std::fmt::Write;

use gripsight_diagnosis::{Change, Diagnosis, EffectParameter, SiteAnswer, Verdict};
use gripsight_model::EffectId;
use maud::{Markup, html};

use super::words::{unit, words};
use crate::text::{interval, percent, significant};

/// Probability from which a site, or something that the library lacks, is worth a line.
const WORTH_A_LINE: f64 = 0.5;
/// Probability from which a mechanism is worth a word beside others, and a site a row of the table.
const WORTH_A_WORD: f64 = 0.1;
/// Changes listed at most.
const CHANGES: usize = 6;

/// Sites and changes for a terminal.
pub(super) fn lines(out: &mut String, d: &Diagnosis) {
    let mut head = "sites";
    for site in d.sites.iter().filter(|s| s.probability >= WORTH_A_LINE) {
        let _ = writeln!(out, "{head:<10} {}", site_line(d, site));
        head = "";
    }
    if head == "sites" {
        let what = if d.verdict == Verdict::NoneOfThese {
            "what is left fits none of them"
        } else {
            "nothing is the matter at any of them, as far as these data tell"
        };
        let _ = writeln!(out, "{head:<10} {what}");
    }
    let mut head = "changes";
    for change in d.changes.iter().take(CHANGES) {
        let _ = writeln!(out, "{head:<10} {}", change_line(change));
        head = "";
    }
}

/// The sites as a table: how sure, which mechanisms and how large, what each closes.
pub(super) fn table(d: &Diagnosis) -> Markup {
    let share = |v: f64| if v.is_finite() { percent(v) } else { String::new() };
    html! {
        table.sites {
            thead { tr { th { "Site" } th { "Something is the matter" } th { "Which" } th { "Closes" } th { "Of that unnamed" } } }
            tbody {
                @for site in d.sites.iter().filter(|s| s.probability >= WORTH_A_WORD) {
                    tr class=[(site.probability >= WORTH_A_LINE).then_some("named")] {
                        td { (place(site.name)) }
                        td { (percent(site.probability)) }
                        td { (mechanisms(d, site)) }
                        td { (share(site.closed_fraction.value)) }
                        td { (if site.other_probability >= WORTH_A_LINE { share(site.unexplained_fraction) } else { String::new() }) }
                    }
                }
            }
        }
        p {
            "Probabilities that something matters at a site and which mechanism it is; a candidate is one that held-out data do not need, or that is small "
            "beside what looks like it and has no name. Closes: share of what all effects and free terms together close on the data fitted."
        }
    }
}

/// What has changed since the earlier drive.
pub(super) fn changes(d: &Diagnosis) -> Markup {
    html! {
        @if d.changes.is_empty() { p { "Nothing." } } @else {
            ul { @for change in d.changes.iter().take(CHANGES) { li { (change_line(change)) } } }
        }
    }
}

/// A site in one line: how sure, which mechanisms and how large, what it closes.
fn site_line(d: &Diagnosis, site: &SiteAnswer) -> String {
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
    format!("{} {}: {}{closes}{rest}", place(site.name), percent(site.probability), mechanisms(d, site))
}

/// The mechanisms of a site with their probabilities and sizes.
fn mechanisms(d: &Diagnosis, site: &SiteAnswer) -> String {
    let mut out: Vec<String> = site
        .mechanisms
        .iter()
        .filter(|m| m.probability >= WORTH_A_WORD)
        .map(|m| {
            let of = d.effects.iter().find(|e| e.name == m.name);
            let size = of.and_then(|e| e.parameters.iter().next()).map_or_else(String::new, sized);
            let doubt = of.is_some_and(|e| !e.accepted && e.confidence >= WORTH_A_LINE);
            let doubt = if doubt { ", a candidate" } else { "" };
            format!("{}{size} {}{doubt}", words(m.name), percent(m.probability))
        })
        .collect();
    if site.other_probability >= WORTH_A_WORD {
        out.push(format!("something that the library lacks {}", percent(site.other_probability)));
    }
    out.join(" or ")
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
    differing(change, "has changed")
}

/// What differs in a drive from others, in some words.
pub(super) fn change_words(change: &Change) -> String {
    differing(change, "differs")
}

fn differing(change: &Change, verb: &str) -> String {
    let what = if change.name == "other" {
        format!("something with {} that the library lacks", place(change.site))
    } else if let Some(slip_rad) = change.at_slip_rad {
        // Tires, by the force of an axle over its load.
        format!("F_y/F_z of {} at {} deg of slip", place(change.site), significant(slip_rad.to_degrees(), 2))
    } else {
        // Which of several parameters, where the effect has more than one.
        let of_several = EffectId::by_name(change.name).is_some_and(|e| e.sizing() > 1);
        let parameter =
            change.parameter.filter(|_| of_several).map_or(String::new(), |p| format!(" ({})", words(p)));
        words(change.name) + &parameter
    };
    let d = &change.difference;
    let size = if d.value.is_finite() {
        let from = d.before.filter(|_| change.at_slip_rad.is_some());
        let from = from.map_or_else(String::new, |before| format!(" from {}", significant(before, 3)));
        format!(" by {} ({}){}{from}", significant(d.value, 3), interval(d.low, d.high), unit(d.unit))
    } else {
        String::new()
    };
    format!("{what} {verb}{size}: {}", percent(change.probability))
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
