//! The page of a diagnosis: where model and real car disagree, why, and by how much.

mod pictures;
mod tables;

use gripsight_gap::{Diagnosis, Verdict};
use maud::html;

use crate::page::{Tone, facts_table, figure, list, page, section};
use crate::text::{percent, percent_interval};
use crate::{Header, ReportError};

/// What the page of a diagnosis shows.
#[derive(Debug, Clone, Copy)]
pub struct GapInput<'a> {
    /// What was found.
    pub diagnosis: &'a Diagnosis,
    /// The head of the page.
    pub header: &'a Header,
    /// The earlier drive's name where two drives are compared: its tires are the model's.
    pub earlier: Option<&'a str>,
    /// What reading the data met, a sentence each.
    pub data_notes: &'a [String],
}

/// The page of a diagnosis, as one HTML file.
///
/// # Errors
/// [`ReportError::Drawing`].
pub fn gap_page(input: &GapInput<'_>) -> Result<String, ReportError> {
    let d = input.diagnosis;
    let [front, rear] = pictures::tire_curves(d);
    let [v_y, yaw_rate] = pictures::worst_seconds(d);
    let (heat, scale) = pictures::heat(d);
    let drawn = !d.series.horizon.is_empty();
    let body = html! {
        (section("Data", true, &tables::data(d, input.data_notes)))
        (section("How large the gap is", true, &tables::budget(d)))
        (section("Effects, ranked", true, &tables::effects(d)))
        @if drawn {
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
        }
        (section("Where it lies", false, &tables::places(d)))
        (section("Drive or record next", false, &list(&d.drive_next, "Nothing in particular.")))
        (section("Why", false, &list(&d.reasons, "")))
        (section("What these signals cannot show", false, &facts_table(&tables::invisible(d))))
        (section("Kinematics", false, &facts_table(&tables::identities(d))))
    };
    let tone = match d.verdict {
        Verdict::Effects | Verdict::TireRetuneOnly | Verdict::NoGap => Tone::Good,
        Verdict::NoneOfThese | Verdict::NotIdentifiable => Tone::Caution,
    };
    let title = if input.earlier.is_some() { "Two drives compared" } else { "Sim-to-real gap" };
    Ok(page(title, tone, &verdict(d, input.earlier), input.header, &body))
}

/// Whether the models beside the nominal one hold an effect.
fn names_effects(d: &Diagnosis) -> bool {
    d.effects.iter().any(|e| e.accepted)
}

/// The first line: of a car against its model, or of a car against its own earlier drive.
fn verdict(d: &Diagnosis, earlier: Option<&str>) -> String {
    match d.verdict {
        Verdict::Effects => {
            let named: Vec<String> = d.effects.iter().filter(|e| e.accepted).map(tables::named).collect();
            let what = match earlier {
                Some(earlier) => format!("What has changed since {earlier} is"),
                None => "The gap is".to_owned(),
            };
            let closed = &d.gap_closed_fraction;
            format!(
                "{what} {}: {} of what other tires leave closes ({}).",
                named.join(" and "),
                percent(closed.value),
                percent_interval(closed.low, closed.high)
            )
        }
        Verdict::TireRetuneOnly => match earlier {
            Some(earlier) => format!("The tires have changed since {earlier}; no other effect is needed."),
            None => "Other tires close the gap; no other effect is needed.".into(),
        },
        Verdict::NoGap => match earlier {
            Some(earlier) => format!(
                "Nothing has changed since {earlier} but for noise and the model's usual imperfection."
            ),
            None => "No gap: model and car agree within the noise and the model's usual imperfection.".into(),
        },
        Verdict::NoneOfThese => match earlier {
            Some(earlier) => {
                format!("Something has changed since {earlier} that no effect of the library explains.")
            }
            None => "There is a gap that no effect of the library explains.".into(),
        },
        Verdict::NotIdentifiable => match d.reasons.first() {
            Some(reason) => format!("These data cannot tell: {reason}."),
            None => "These data cannot tell.".into(),
        },
    }
}
