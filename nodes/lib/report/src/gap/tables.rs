//! Tables of a diagnosis.

use gripsight_diagnosis::{Diagnosis, Place};
use gripsight_signals::TopicHealth;
use gripsight_vehicle::MagicFormula;
use maud::{Markup, html};

use super::words::{closes, listed, sizes, unit, words};
use crate::health::health;
use crate::page::{facts_table, list};
use crate::text::{interval, percent, significant};

/// Effects in the table.
const SHOWN: usize = 6;

/// The ranking.
pub(super) fn effects(d: &Diagnosis) -> Markup {
    html! {
        @if d.effects.is_empty() { p { "None was fitted." } } @else {
            table.effects {
                thead { tr { th { "Effect" } th { "Size (90 %)" } th { "Closes" } th { "Confidence" } th { "Not told from" } } }
                tbody {
                    @for e in listed(d, SHOWN) {
                        tr class=[e.accepted.then_some("named")] {
                            td { (words(e.name)) }
                            td { (sizes(e)) }
                            td { (closes(&e.gap_closed_fraction)) }
                            td { (percent(e.confidence)) }
                            td { (e.confused_with.iter().map(|n| words(n)).collect::<Vec<_>>().join(", ")) }
                        }
                    }
                }
            }
            p {
                "Bold: named by the verdict. Closes: share of the gap between other tires and the noise on held-out data; of an effect named, after "
                "those above it; of any other, beside the named ones alone."
            }
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
            thead { tr { th { "Axle" } th { "" } th { "stiffness / load (B C D)" } th { "peak friction D" } th { "B" } th { "C" } th { "E" } } }
            tbody {
                @for (axle, without, with) in axles {
                    @for (what, t) in [("without effect", without), ("with the effects named", with)] {
                        tr {
                            td { (axle) }
                            td { (what) }
                            @for v in figures(t) { td { (significant(v, 3)) } }
                        }
                    }
                    tr {
                        td { (axle) }
                        td { "change" }
                        @for (a, b) in figures(without).into_iter().zip(figures(with)).take(4) { td { (change(a, b)) } }
                        td {}
                    }
                }
            }
        }
        p {
            "Effective tires of a bare single-track model (Phi_p) over the slips driven. Read the stiffness, and the peak where slip was driven up to it. B, C and E alone say little: they make up for each other, and for a "
            "peak that was not reached."
        }
    }
}

/// What the data tell best first.
fn figures(t: &MagicFormula) -> [f64; 5] {
    [t.normalized_stiffness(), t.d, t.b, t.c, t.e]
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
pub(super) fn invisible(d: &Diagnosis) -> Markup {
    let rows: Vec<(String, String)> = d.invisible.iter().map(|i| (words(i.name), i.reason.clone())).collect();
    html! {
        @if rows.is_empty() { p { "Nothing: what every effect considered needs is recorded." } } @else { (facts_table(&rows)) }
    }
}

/// The kinematic identities.
pub(super) fn identities(d: &Diagnosis) -> Vec<(String, String)> {
    d.identities.iter().map(|i| (i.name.to_owned(), i.finding.clone())).collect()
}

/// What the data are like: topic by topic, what the matter is, and the streams joined.
pub(super) fn data(d: &Diagnosis, topics: &[TopicHealth], notes: &[String]) -> Markup {
    html! {
        @if !topics.is_empty() { (crate::topics::table(topics)) }
        @if !notes.is_empty() { (list(notes, "")) }
        (facts_table(&health(&d.data_health)))
    }
}
