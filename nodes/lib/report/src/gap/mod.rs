//! The page of a diagnosis: where model and real car disagree, why, and by how much.

mod budget;
mod drives;
mod figures;
mod pictures;
mod sites;
mod tables;
mod terminal;
mod verdict;
mod words;

use gripsight_diagnosis::{Diagnosis, Verdict};
use gripsight_signals::TopicHealth;
use maud::{Markup, html};

pub use terminal::gap_text;
pub use verdict::Before;

use crate::page::{facts_table, figure, list, page, section};
use crate::{Header, ReportError};

/// What the page of a diagnosis shows.
#[derive(Debug, Clone, Copy)]
pub struct GapInput<'a> {
    /// What was found.
    pub diagnosis: &'a Diagnosis,
    /// The head of the page.
    pub header: &'a Header,
    /// What the drive is compared with, where two are.
    pub before: Option<Before<'a>>,
    /// The topics that the data come from; empty where they come as sequences.
    pub topics: &'a [TopicHealth],
    /// What reading the data met, a sentence each.
    pub data_notes: &'a [String],
}

/// The page of a diagnosis, as one HTML file.
///
/// # Errors
/// [`ReportError::Drawing`].
pub fn gap_page(input: &GapInput<'_>) -> Result<String, ReportError> {
    let d = input.diagnosis;
    let body = html! {
        (section("Data", true, &tables::data(d, input.topics, input.data_notes)))
        @if d.verdict == Verdict::NotIdentifiable {
            (section("Drive or record next", true, &next(d)))
        } @else {
            @if !d.drives.is_empty() { (section("Drive by drive", true, &drives::table(d))) }
            @if input.before.is_some() { (section("What has changed", true, &sites::changes(d))) }
            (explained(d)?)
        }
    };
    let title = match input.before {
        Some(Before::Drive(_)) => "Two drives compared",
        Some(Before::Simulator(_)) => "From simulator to car",
        None => "Sim-to-real gap",
    };
    Ok(page(title, verdict::tone(d), &verdict::sentence(d, input.before), input.header, &body))
}

/// What there is to show where the data can tell.
fn explained(d: &Diagnosis) -> Result<Markup, ReportError> {
    let [front, rear] = pictures::tire_curves(d);
    let [v_y, yaw_rate] = pictures::worst_seconds(d);
    let (heat, scale) = pictures::heat(d);
    Ok(html! {
        (section("How large the gap is", true, &budget::budget(d)))
        (section("Where something is the matter", true, &sites::table(d)))
        @if !d.figures.is_empty() { (section("Figures of the car", d.figures.iter().any(|f| f.contradicted), &figures::table(d))) }
        (section("Effects, ranked", true, &tables::effects(d)))
        (section("Front tires", false, &figure(&front, "")?))
        (section("Rear tires", false, &figure(&rear, "")?))
        @if names_effects(d) {
            (section("What the effects had done to the tires", true, &tables::tires(d)))
        }
        (section("Lateral velocity, worst seconds", false, &figure(&v_y, "")?))
        (section("Yaw rate, worst seconds", false, &figure(&yaw_rate, "Rollouts start anew from the best state at every window.")?))
        (section("Error over speed and lateral acceleration", false, &html! { (figure(&heat, "")?) (scale) }))
        (section(pictures::along_title(d), false, &figure(&pictures::along(d), "")?))
        (section("Error over horizon", false, &figure(&pictures::horizon(d), "")?))
        (section("Lateral and forward acceleration", false, &figure(&pictures::accelerations(d), "")?))
        (section("Where it lies", false, &tables::places(d)))
        (section("Drive or record next", false, &next(d)))
        // The first repeats the figures.
        (section("Why", false, &list(d.reasons.get(1..).unwrap_or_default(), "The figures above.")))
        (section("What these signals cannot show", false, &tables::invisible(d)))
        (section("Kinematics", false, &facts_table(&tables::identities(d))))
    })
}

fn next(d: &Diagnosis) -> Markup {
    list(&d.drive_next, "Nothing in particular.")
}

/// Whether the models beside the nominal one hold an effect.
fn names_effects(d: &Diagnosis) -> bool {
    d.effects.iter().any(|e| e.accepted)
}
