//! The sheet that every page is written on.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::chart::{Chart, DENSITY, HATCH, Swatch};
use crate::{ReportError, Role};

/// What stands at the head of every page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    /// The car's name.
    pub car: String,
    /// The data's name.
    pub bag: String,
    /// Stamp of the data's first sample, as people read it.
    pub data_stamp: String,
    /// Version of the tool.
    pub tool_version: String,
    /// The car's parameters as a number.
    pub vehicle_hash: String,
    /// Seed of every random number, where there are any.
    pub seed: Option<u64>,
    /// The exact command, with the output folder's name left open.
    pub command: String,
}

/// The first line of a page, and how it is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Tone {
    /// Use it.
    Good,
    /// Do not use it as it is.
    Caution,
}

const STYLE: &str = include_str!("style.css");

/// What stands at the head of a document, under whatever names it has there.
pub(crate) struct Sheet<'a> {
    /// What kind of page it is.
    pub(crate) title: &'a str,
    /// Whose page it is.
    pub(crate) subject: &'a str,
    /// How the first line is meant.
    pub(crate) tone: Tone,
    /// The first line.
    pub(crate) verdict: &'a str,
    /// Names and values below it.
    pub(crate) facts: &'a [(&'a str, &'a str)],
    /// The command that made it.
    pub(crate) command: &'a str,
}

/// The whole document of a car's data.
pub(crate) fn page(title: &str, tone: Tone, verdict: &str, header: &Header, body: &Markup) -> String {
    let facts = [
        ("Car", header.car.as_str()),
        ("Data", &header.bag),
        ("Recorded", &header.data_stamp),
        ("Tool", &format!("gripsight {}", header.tool_version)),
        ("Vehicle hash", &header.vehicle_hash),
        ("Seed", &header.seed.map_or_else(|| "none needed".to_owned(), |s| s.to_string())),
    ];
    let (subject, command) = (&header.car, &header.command);
    document(&Sheet { title, subject, tone, verdict, facts: &facts, command }, body)
}

/// The whole document.
pub(crate) fn document(sheet: &Sheet<'_>, body: &Markup) -> String {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (sheet.title) " · " (sheet.subject) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                header {
                    p.kind { (sheet.title) }
                    h1 class=(if sheet.tone == Tone::Good { "good" } else { "caution" }) { (sheet.verdict) }
                    dl.facts {
                        @for (name, value) in sheet.facts { div { dt { (name) } dd { (value) } } }
                    }
                }
                main { (body) }
                footer { p { "Made by" } code { (sheet.command) } }
            }
        }
    }
    .into_string()
}

/// A part of the page under a heading; parts flow in two columns unless they are wide.
pub(crate) fn section(title: &str, wide: bool, body: &Markup) -> Markup {
    html! { section class=[wide.then_some("wide")] { h2 { (title) } (body) } }
}

/// A picture with its legend above and a remark below (may be empty).
pub(crate) fn figure(chart: &Chart, remark: &str) -> Result<Markup, ReportError> {
    let svg = chart.svg()?;
    let legend: Vec<_> =
        chart.legend().map(|(name, kind)| html! { span { (swatch(kind)) (name) } }).collect();
    Ok(html! {
        figure {
            @if !legend.is_empty() { div.legend { @for entry in &legend { (entry) } } }
            (PreEscaped(svg))
            @if !remark.is_empty() { figcaption { (remark) } }
        }
    })
}

fn swatch(kind: Swatch) -> Markup {
    let css = |c: plotters::style::RGBColor| format!("#{:02x}{:02x}{:02x}", c.0, c.1, c.2);
    let drawing = match kind {
        Swatch::Line(role) => html! {
            line x1="0" y1="5" x2="18" y2="5" stroke=(role.css()) stroke-width="2" stroke-dasharray=[dashes(role)];
        },
        Swatch::Band(role) => html! { rect width="18" height="10" fill=(role.css()) fill-opacity="0.18"; },
        Swatch::Dot(role) => html! { circle cx="9" cy="5" r="3" fill=(role.css()); },
        Swatch::Density => html! { rect y="3" width="18" height="7" fill=(css(DENSITY)); },
        Swatch::Hatch => html! {
            path d="M0 10L8 0M5 10L13 0M10 10L18 0" stroke=(css(HATCH)) stroke-width="1.5";
        },
    };
    html! { svg.swatch viewBox="0 0 18 10" { (drawing) } }
}

fn dashes(role: Role) -> Option<&'static str> {
    role.is_dashed().then_some("5 3.5")
}

/// Rows of cells under a head; the first column is text, the others numbers. An empty head row is left out.
pub(crate) fn table<const N: usize>(head: [&str; N], rows: &[[String; N]]) -> Markup {
    html! {
        table {
            @if head.iter().any(|h| !h.is_empty()) {
                thead { tr { @for name in head { th { (name) } } } }
            }
            tbody { @for row in rows { tr { @for cell in row { td { (cell) } } } } }
        }
    }
}

/// Names and what is to be said of them.
pub(crate) fn facts_table<S: AsRef<str>>(facts: &[(S, String)]) -> Markup {
    html! {
        table.facts-table {
            tbody { @for (name, value) in facts { tr { td { (name.as_ref()) } td { (value) } } } }
        }
    }
}

/// Sentences one below the other; `none` where there is nothing to say.
pub(crate) fn list(items: &[String], none: &str) -> Markup {
    html! {
        @if items.is_empty() { p { (none) } } @else { ul { @for item in items { li { (item) } } } }
    }
}
