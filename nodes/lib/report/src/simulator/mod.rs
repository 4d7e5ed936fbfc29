//! The page of a diagnosis with the user's own simulator.

mod words;

use gripsight_simulator::{Estimate, RankedEffect, SimulatorDiagnosis, Verdict};
use maud::{Markup, html};

use crate::bars::{Bar, bars, logarithmic};
use crate::health::health;
use crate::page::{Tone, facts_table, figure, list, page, section, table};
use crate::text::{estimate_of, percent, significant};
use crate::{Axis, Chart, Header, Layer, ReportError, Role};

pub use words::simulator_text;
use words::{closes, invisible, missing, reason, sentence, size};

/// What a patch of the simulator's parameters came to.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PatchSaid {
    /// The difference; empty where there is none.
    pub diff: String,
    /// What must be changed elsewhere.
    pub by_hand: Vec<String>,
    /// Error over the noise of the patched simulator on held-out data; nothing where it was not run.
    pub verified: Option<f64>,
    /// Whether it was withheld because held-out data are not clearly better with it.
    pub is_no_better: bool,
}

/// What the page shows.
#[derive(Debug, Clone, Copy)]
pub struct SimulatorInput<'a> {
    /// What was found.
    pub diagnosis: &'a SimulatorDiagnosis,
    /// The patch.
    pub patch: &'a PatchSaid,
    /// The head of the page.
    pub header: &'a Header,
    /// What reading the data met, a sentence each.
    pub data_notes: &'a [String],
}

/// The page, as one HTML file.
///
/// # Errors
/// [`ReportError::Drawing`].
pub fn simulator_page(input: &SimulatorInput<'_>) -> Result<String, ReportError> {
    let d = input.diagnosis;
    let tone = match d.verdict {
        Verdict::Effects | Verdict::NoGap => Tone::Good,
        _ => Tone::Caution,
    };
    let reasons: Vec<String> = d.reasons.iter().map(reason).collect();
    let body = html! {
        (section("How large the gap is", true, &budget(d)))
        (section("What differs, ranked", true, &effects(d)))
        (section("The patch", true, &patch(d, input.patch)))
        @if !d.missing.is_empty() { (section("What the simulator has no term for", false, &list(&missing(d), ""))) }
        @for (channel, rows) in &d.series { (section(channel, false, &figure(&worst(channel, rows), "Held-out data, from the best start of every window.")?)) }
        (section("Where the gap lies", false, &places(d)))
        (section("Why", false, &list(&reasons, "")))
        (section("What these data cannot show", false, &list(&invisible(d), "Nothing of note.")))
        (section("Data", false, &html! { (facts_table(&health(&d.data_health))) (list(input.data_notes, "")) }))
    };
    Ok(page("Car and simulator", tone, &sentence(d), input.header, &body))
}

fn budget(d: &SimulatorDiagnosis) -> Markup {
    let g = &d.gap;
    let bar = |name: &str, role: Role, from: f64, e: &Estimate| Bar {
        name: name.to_owned(),
        role,
        from,
        to: e.value,
        interval: ((e.high - e.low).is_finite() && e.low < e.high).then_some((e.low, e.high)),
        value: estimate_of(e.value, e.low, e.high),
    };
    let mut rows = vec![bar("Simulator as it came", Role::Nominal, 0.0, &g.nominal)];
    let mut from = g.nominal.value;
    for s in &g.steps {
        rows.push(bar(&s.effect, Role::Identified, from, &s.error));
        from = s.error.value;
    }
    rows.push(bar("free terms (ceiling)", Role::Nominal, from, &g.unstructured_ceiling));
    rows.push(bar("Noise", Role::Measured, 0.0, &g.noise_floor));
    let noise: Vec<String> =
        g.channel_noise.iter().map(|(name, sigma)| format!("{name} {}", significant(*sigma, 2))).collect();
    html! {
        (bars(&rows))
        p {
            @if logarithmic(&rows) { "Bars by the logarithm. " }
            "Mean squared error of rollouts of " (significant(g.horizon_s, 2)) " s on " (g.scored_on) ", each channel over its noise ("
            (noise.join(", ")) "), each window from its best start. Simulator " (d.simulator.name) ", rolled out over the recording "
            (significant(d.simulator.rollouts, 3)) " times for " (d.simulator.candidates) " candidates ("
            (significant(d.simulator.took_s[0], 2)) " s, " (significant(d.simulator.took_s[1], 2)) " s of them in the simulator)."
        }
    }
}

fn effects(d: &SimulatorDiagnosis) -> Markup {
    let row = |e: &RankedEffect| {
        let name = if e.accepted { e.name.clone() } else { format!("({})", e.name) };
        [name, size(e), closes(e), percent(e.confidence), e.confused_with.join(", ")]
    };
    let rows: Vec<[String; 5]> = d.effects.iter().map(row).collect();
    html! {
        @if rows.is_empty() { p { "Nothing differs as far as these data tell." } }
        @else {
            (table(["Effect", "Size (90 %)", "Closes", "Confidence", "Not told from"], &rows))
            p { "In brackets: looked at and not named." }
        }
    }
}

fn patch(d: &SimulatorDiagnosis, said: &PatchSaid) -> Markup {
    html! {
        @if let Some(error) = said.verified {
            p { "Run with the patch on held-out data: " (significant(d.gap.nominal.value, 3)) " to " (significant(error, 3)) " times the noise." }
        }
        @if said.is_no_better { p { "The patched simulator does no better on held-out data, as far as these tell: no patch is given." } }
        @else if !said.diff.is_empty() { pre { (said.diff) } }
        @else { p { "Nothing of the parameter file is to be changed." } }
        @if !said.by_hand.is_empty() { p { "To be changed by hand:" } (list(&said.by_hand, "")) }
    }
}

fn places(d: &SimulatorDiagnosis) -> Markup {
    let p = &d.places;
    let all = p.channel.iter().chain(&p.speed).chain(&p.lateral_acceleration).chain(&p.time);
    let rows: Vec<[String; 3]> = all
        .map(|p| {
            let what = if p.low == p.high {
                p.channel.to_owned()
            } else {
                format!("{} … {} {}", significant(p.low, 2), significant(p.high, 2), p.unit.replace('2', "²"))
            };
            [what, significant(p.chi2_per_dof, 3), percent(p.share)]
        })
        .collect();
    table(["Where", "Squared error / noise", "Share"], &rows)
}

/// Five seconds around the largest error of the simulator as it came.
fn worst(channel: &str, rows: &[[f64; 4]]) -> Chart {
    const HALF_S: f64 = 2.5;
    let error = |r: &&[f64; 4]| (r[1] - r[2]).abs();
    let middle_s = rows.iter().max_by(|a, b| error(a).total_cmp(&error(b))).map_or(0.0, |r| r[0]);
    let shown: Vec<&[f64; 4]> = rows.iter().filter(|r| (r[0] - middle_s).abs() < HALF_S).collect();
    let line = |role: Role, name: &str, column: usize| Layer::Line {
        role,
        name: name.to_owned(),
        points: shown.iter().map(|r| (r[0], r[column])).collect(),
    };
    Chart::new(channel, Axis::new("time / s"), Axis::new(channel))
        .sized(460, 220)
        .with(line(Role::Nominal, "simulator as it came", 2))
        .with(line(Role::Measured, "measured", 1))
        .with(line(Role::Identified, "with what was found", 3))
}
