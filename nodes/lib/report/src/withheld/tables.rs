//! Tables of a score.

use std::collections::{BTreeMap, BTreeSet};

use gripsight_withheld_make::Family;
use gripsight_withheld_score::{FamilyScore, Line, Rate, Scores};
use maud::{Markup, html};

use crate::chart::heat;
use crate::page::{facts_table, table};
use crate::text::{fixed, interval, significant};

/// A family in words.
pub(super) fn family(family: Family) -> &'static str {
    match family {
        Family::Reference => "reference car",
        Family::Foreign => "plants that others wrote",
        Family::Recorded => "recorded bags with injected effects",
        Family::Simulator => "pairs of simulator and car",
    }
}

fn rate(rate: &Rate) -> [String; 3] {
    if rate.of == 0 {
        return ["–".into(), "–".into(), "no case".into()];
    }
    let percent = |share: f64| 100.0 * share;
    [
        format!("{} %", fixed(percent(rate.value()), 1)),
        interval(percent(rate.low), percent(rate.high)),
        format!("{}/{}", rate.hits, rate.of),
    ]
}

fn short(r: &Rate) -> String {
    if r.of == 0 { "–".into() } else { format!("{}/{}", r.hits, r.of) }
}

pub(super) fn lines(family: &FamilyScore) -> Markup {
    let row = |line: &Line| {
        let [value, range, count] = match (&line.rate, line.value) {
            (Some(r), _) => rate(r),
            (None, value) => [significant(value.unwrap_or(f64::NAN), 3), "–".into(), "–".into()],
        };
        let met = match line.met {
            Some(true) => "met",
            Some(false) => "missed",
            None => "–",
        };
        [line.what.clone(), line.wanted.clone(), value, range, count, met.to_owned()]
    };
    let rows: Vec<_> = family.lines.iter().map(row).collect();
    let kinds: Vec<String> = family.by_kind.iter().map(|(kind, r)| format!("{kind} {}", short(r))).collect();
    html! {
        (table(["", "target", "reached", "95 %", "cases", ""], &rows))
        p { "Right over all " (family.cases) " cases, those below the detection limit too: " (kinds.join(", ")) "." }
    }
}

pub(super) fn effects(scores: &Scores) -> Markup {
    let number = |v: Option<f64>| significant(v.unwrap_or(f64::NAN), 2);
    let rows: Vec<[String; 9]> = scores
        .effects
        .iter()
        .map(|e| {
            let band = |k: usize| e.by_severity.get(k).map_or_else(String::new, short);
            [
                e.name.clone(),
                number(e.oracle_limit),
                band(0),
                band(1),
                band(2),
                band(3),
                number(e.named_from_severity),
                number(e.size_ratio),
                short(&e.coverage),
            ]
        })
        .collect();
    let head = ["", "limit", "below 1", "1 to 2", "2 to 5", "above 5", "named from", "size", "covered"];
    html! {
        (table(head, &rows))
        p {
            "Limit: median detection limit of the generator's fit, in the parameter's unit. Columns: how often it is named by severity. Named "
            "from: the severity that parts named from unnamed cases best. Size: stated over true, median."
        }
    }
}

pub(super) fn confusion(family: &FamilyScore) -> Markup {
    let columns: BTreeSet<&str> =
        family.confusion.values().flat_map(|row| row.keys().map(String::as_str)).collect();
    let cell = |row: &BTreeMap<String, usize>, column: &str| {
        let count = row.get(column).copied().unwrap_or(0);
        let color = heat(0.6 * count as f64 / row.values().sum::<usize>().max(1) as f64);
        (count, format!("background:#{:02x}{:02x}{:02x}", color.0, color.1, color.2))
    };
    html! {
        div style="overflow-x:auto" {
            table {
                thead {
                    tr {
                        th {}
                        @for column in &columns { th style="writing-mode:vertical-rl" { (column) } }
                    }
                }
                tbody {
                    @for (name, row) in &family.confusion {
                        tr {
                            td { (name) }
                            @for column in &columns {
                                @let (count, style) = cell(row, column);
                                td style=(style) { @if count > 0 { (count) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

pub(super) fn misses(scores: &Scores) -> Markup {
    let number = |v: Option<f64>| significant(v.unwrap_or(f64::NAN), 2);
    let rows: Vec<[String; 7]> = scores
        .misses
        .iter()
        .map(|m| {
            [
                m.case.clone(),
                m.kind.name().to_owned(),
                m.truth.clone(),
                m.said.clone(),
                number(m.severity),
                number(m.shrinkage_over_oracle),
                m.circumstances.clone(),
            ]
        })
        .collect();
    html! {
        div style="overflow-x:auto" {
            (table(["case", "kind", "true", "said", "severity", "shrinkage over oracle", "drive"], &rows))
        }
    }
}

pub(super) fn control(scores: &Scores) -> Markup {
    let facts: Vec<(&String, String)> = scores
        .control
        .iter()
        .map(|(family, c)| {
            let [value, range, count] = rate(&c.right);
            let [low, mean, high] = c.chance.map(|share| 100.0 * share);
            (family, format!("{value} ({range}; {count}); chance {mean:.0} % ({})", interval(low, high)))
        })
        .collect();
    html! {
        (facts_table(&facts))
        p { "Nearest neighbour in file sizes, message counts, stamps and order, guessing the kind of a case; chance: kinds dealt out at random." }
    }
}

pub(super) fn baselines(scores: &Scores) -> Markup {
    let rows: Vec<[String; 5]> = scores
        .families
        .iter()
        .flat_map(|f| {
            f.baselines.iter().map(|(method, r)| {
                let [value, range, count] = rate(r);
                [f.family.name().to_owned(), method.clone(), value, range, count]
            })
        })
        .collect();
    table(["", "method", "first name exact", "95 %", "cases"], &rows)
}
