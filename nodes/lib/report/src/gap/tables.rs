//! Bars and tables of a diagnosis.

use gripsight_gap::{Diagnosis, EffectParameter, Estimate, Place, RankedEffect};
use maud::{Markup, html};

use crate::Role;
use crate::bars::{Bar, bars, logarithmic};
use crate::health::health;
use crate::page::{facts_table, list};
use crate::text::{interval, percent, percent_interval, significant, with_interval};

/// Effects in the table.
const SHOWN: usize = 6;

/// How the gap is made up, from the model as it came down to the noise.
pub(super) fn budget(d: &Diagnosis) -> Markup {
    let g = &d.gap;
    let total = |name: &str, role: Role, e: &Estimate| {
        let (value, range) = with_interval(e.value, e.low, e.high);
        let value = if e.low < e.high { format!("{value} ({range})") } else { value };
        let interval = (e.low < e.high).then_some((e.low, e.high));
        Bar { name: name.into(), role, from: 0.0, to: e.value, interval, value }
    };
    let part = |name: String, role: Role, from: f64, to: f64| Bar {
        name,
        role,
        from,
        to,
        interval: None,
        value: significant(from - to, 3),
    };
    let named: Vec<String> = d.effects.iter().filter(|e| e.accepted).map(|e| words(e.name)).collect();
    let mut rows = vec![
        total("Model as it came", Role::Nominal, &g.nominal),
        part("closed by other tires".into(), Role::Identified, g.nominal.value, g.retuned.value),
    ];
    if !named.is_empty() {
        let name = format!("closed by {}", named.join(", "));
        rows.push(part(name, Role::Identified, g.retuned.value, g.after.value));
    }
    rows.push(part("unexplained rest".into(), Role::Nominal, g.after.value, g.noise_floor.value));
    rows.push(total("Noise", Role::Measured, &g.noise_floor));
    let (ceiling, black_box) = (&g.unstructured_ceiling, &g.s4_residual);
    html! {
        (bars(&rows))
        p {
            @if logarithmic(&rows) { "Bars by the logarithm, from the noise on. " }
            "Mean squared error of open-loop rollouts of " (significant(g.horizon_s, 2)) " s on " (g.scored_on)
            ", each channel over its noise (" (noise(d)) "); the thin line is the 90 % interval by block bootstrap. "
            "Flexible terms without any physics reach " (significant(ceiling.value, 3))
            " (" (interval(ceiling.low, ceiling.high)) "): less than that no effect can be expected to leave. "
            @if black_box.value.is_finite() {
                "The S4 residual network on top of the other tires, a black box that names nothing, leaves " (significant(black_box.value, 3))
                " (" (interval(black_box.low, black_box.high)) ")."
            }
        }
    }
}

/// The ranking.
pub(super) fn effects(d: &Diagnosis) -> Markup {
    html! {
        @if d.effects.is_empty() { p { "None was fitted." } } @else {
            table.effects {
                thead { tr { th { "Effect" } th { "Size (90 %)" } th { "Closes" } th { "Confidence" } th { "Not told from" } } }
                tbody {
                    @for e in d.effects.iter().take(SHOWN) {
                        tr class=[e.accepted.then_some("named")] {
                            td { (words(e.name)) }
                            td { (e.parameters.iter().map(|(name, p)| size(name, p)).collect::<Vec<_>>().join(", ")) }
                            td { (closes(&e.gap_closed_fraction)) }
                            td { (percent(e.confidence)) }
                            td { (e.confused_with.iter().map(|n| words(n)).collect::<Vec<_>>().join(", ")) }
                        }
                    }
                }
            }
            p { "Bold: named by the verdict. Closes: share of the gap between other tires and the noise, after those above it." }
        }
    }
}

/// The tires fitted without any effect, and together with those named.
pub(super) fn tires(d: &Diagnosis) -> Markup {
    let pair = &d.tires;
    let axles = [
        ("front", &pair.without_effect.front, &pair.with_effect.front),
        ("rear", &pair.without_effect.rear, &pair.with_effect.rear),
    ];
    let change = |a: f64, b: f64| {
        let percent = 100.0 * (b - a) / a;
        if percent.is_finite() { format!("{percent:+.1} %").replace('-', "\u{2212}") } else { String::new() }
    };
    html! {
        table.tires {
            thead { tr { th { "Axle" } th { "" } th { "B" } th { "C" } th { "D" } th { "E" } th { "stiffness / load (B C D)" } } }
            tbody {
                @for (axle, without, with) in axles {
                    @for (what, t) in [("without effect", without), ("with the effects named", with)] {
                        tr {
                            td { (axle) }
                            td { (what) }
                            @for v in [t.b, t.c, t.d, t.e, t.normalized_stiffness()] { td { (significant(v, 3)) } }
                        }
                    }
                    tr {
                        td { (axle) }
                        td { "change" }
                        @for (a, b) in [(without.b, with.b), (without.c, with.c), (without.d, with.d)] { td { (change(a, b)) } }
                        td {}
                        td { (change(without.normalized_stiffness(), with.normalized_stiffness())) }
                    }
                }
            }
        }
    }
}

fn closes(fraction: &Estimate) -> String {
    if fraction.low < fraction.high {
        format!("{} ({})", percent(fraction.value), percent_interval(fraction.low, fraction.high))
    } else {
        percent(fraction.value)
    }
}

/// An effect with its sizes, for a sentence.
pub(super) fn named(effect: &RankedEffect) -> String {
    let sizes = effect.parameters.iter().map(|(name, p)| {
        let (value, _) = with_interval(p.value, p.low, p.high);
        format!("{} {value}{}", words(name), unit(p.unit))
    });
    format!("{} ({})", words(effect.name), sizes.collect::<Vec<_>>().join(", "))
}

fn size(name: &str, p: &EffectParameter) -> String {
    let (value, interval) = with_interval(p.value, p.low, p.high);
    let before = p.before.map_or_else(String::new, |before| format!(", before {}", significant(before, 3)));
    format!("{} {value} ({interval}){}{before}", words(name), unit(p.unit))
}

/// A name without underscores, and without the unit at its end: that stands beside the number.
fn words(name: &str) -> String {
    const UNITS: [&str; 9] = ["_radps", "_rad", "_mps2", "_mps", "_m", "_s", "_1pm", "_per_min", "_per_g"];
    if name == "rad_per_g" {
        return "angle".to_owned();
    }
    let bare = UNITS.iter().find_map(|unit| name.strip_suffix(unit)).unwrap_or(name);
    // The velocities keep theirs.
    bare.replace('_', " ")
        .replace("v x", "v_x")
        .replace("v y", "v_y")
        .replace("a x", "a_x")
        .replace("a y", "a_y")
}

fn unit(unit: &str) -> String {
    if unit == "1" { String::new() } else { format!(" {}", unit.replace('2', "²")) }
}

/// The worst part of each circumstance.
pub(super) fn places(d: &Diagnosis) -> Markup {
    let w = &d.places;
    let circumstances: [(&str, &[Place]); 10] = [
        ("Channel", &w.channel),
        ("Axle", &w.axle),
        ("Speed", &w.speed),
        ("|Lateral acceleration|", &w.lateral_acceleration),
        ("Slip angle", &w.slip),
        ("|Steering rate|", &w.steering_rate),
        ("Forward acceleration", &w.longitudinal_acceleration),
        ("Frequency", &w.frequency),
        ("Along the lap", &w.track_position),
        ("Time", &w.time),
    ];
    let rows: Vec<[String; 4]> = circumstances
        .into_iter()
        .filter_map(|(name, places)| {
            let worst = places.iter().max_by(|a, b| a.share.total_cmp(&b.share))?;
            let at = if worst.low < worst.high {
                format!("{}{}", interval(worst.low, worst.high), unit(worst.unit))
            } else {
                words(worst.channel)
            };
            Some([name.to_owned(), at, significant(worst.chi2_per_dof, 3), percent(worst.share)])
        })
        .collect();
    html! { (crate::page::table(["", "Where most of it lies", "Error / noise", "Share"], &rows)) }
}

/// What these signals cannot show, and why.
pub(super) fn invisible(d: &Diagnosis) -> Vec<(String, String)> {
    if d.invisible.is_empty() {
        return vec![("nothing of the library".into(), String::new())];
    }
    d.invisible.iter().map(|i| (words(i.name), i.reason.clone())).collect()
}

/// The kinematic identities.
pub(super) fn identities(d: &Diagnosis) -> Vec<(String, String)> {
    d.identities.iter().map(|i| (i.name.to_owned(), i.finding.clone())).collect()
}

/// What the data are like.
pub(super) fn data(d: &Diagnosis, notes: &[String]) -> Markup {
    html! {
        (facts_table(&health(&d.data_health)))
        @if !notes.is_empty() { (list(notes, "")) }
    }
}

/// The unit at the end of a channel's name.
fn channel_unit(name: &str) -> &'static str {
    let units = [("_mps2", " m/s²"), ("_mps", " m/s"), ("_radps", " rad/s"), ("_rad", " rad")];
    units.into_iter().find(|(end, _)| name.ends_with(end)).map_or("", |(_, unit)| unit)
}

/// The noise of each channel.
fn noise(d: &Diagnosis) -> String {
    d.gap
        .channel_noise
        .iter()
        .map(|(name, sigma)| format!("{} {}{}", words(name), significant(*sigma, 2), channel_unit(name)))
        .collect::<Vec<_>>()
        .join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lose_underscores_and_units() {
        assert_eq!(words("steering_delay"), "steering delay");
        assert_eq!((words("delay_s"), words("v_y_lever_arm")), ("delay".into(), "v_y lever arm".into()));
        assert_eq!(words("rad_per_g"), "angle");
        assert_eq!((words("a_y_mps2"), channel_unit("a_y_mps2")), ("a_y".into(), " m/s²"));
        assert_eq!(words("yaw_rate_radps"), "yaw rate");
        assert_eq!((unit("1"), unit("m/s2")), (String::new(), " m/s²".into()));
    }
}
