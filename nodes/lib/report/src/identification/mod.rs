//! The page of an identification.

mod pictures;
mod tables;
mod words;

use gripsight_identification::{Method, Outcome, PerAxle, Source, Status};
use maud::html;

pub use words::{UNKNOWN, drive_train, estimate, peak_friction, status, understeer};

use crate::page::{Tone, figure, list, page, section};
use crate::text::{fixed, percent, significant, with_interval};
use crate::{Header, ReportError};

/// What the page of an identification shows.
#[derive(Debug, Clone, Copy)]
pub struct IdentificationInput<'a> {
    /// What was found.
    pub outcome: &'a Outcome,
    /// The head of the page.
    pub header: &'a Header,
    /// Points (|slip angle| in rad, |F_y|/F_z) of the true tires, in order of slip, where a simulator knows them.
    pub truth: Option<&'a PerAxle<Vec<(f64, f64)>>>,
    /// What reading the data met, a sentence each.
    pub data_notes: &'a [String],
}

/// The page of an identification, as one HTML file.
///
/// # Errors
/// [`ReportError::Drawing`].
pub fn identification_page(input: &IdentificationInput<'_>) -> Result<String, ReportError> {
    let outcome = input.outcome;
    let [front, rear] = pictures::tire_curves(input);
    let [v_y, yaw_rate] = pictures::worst_seconds(outcome);
    let worst = format!(
        "{} s of the drive where the model misses most; rollouts start anew from the measured state every {} s.",
        pictures::WORST_S,
        significant(outcome.rmse.horizon_s, 2)
    );
    let fitted = outcome.source != Source::Start;
    let tires = match outcome.status {
        _ if !fitted => "Tires that the run started from",
        Status::Accepted | Status::AcceptedWithin => "Tires to use",
        Status::Provisional | Status::Rejected => "Tires found",
    };
    let next: Vec<String> = outcome.drive_next.iter().map(ToString::to_string).collect();
    let drawn = !outcome.trace.time_s.is_empty();
    let body = html! {
        @if drawn {
            (section("Front tires", false, &figure(&front, "")?))
            (section("Rear tires", false, &figure(&rear, "")?))
        }
        (section(tires, false, &tables::tires(outcome)))
        @if fitted {
            (section("Handling", false, &html! {
                p { "Understeer gradient, degrees at the road wheels per g: " (understeer(&outcome.handling)) "." }
                (figure(&pictures::handling(outcome), "")?)
            }))
        }
        @if fitted { (section("Taken out of the signals", false, &tables::signals(outcome))) }

        (section("Drive train", false, &tables::longitudinal(outcome)))
        (section("What limits the result", false, &list(&outcome.reasons, "Nothing that was found.")))
        (section("Drive next", false, &list(&next, "Nothing in particular.")))
        @if drawn {
            (section("Lateral velocity, worst seconds", false, &figure(&v_y, "")?))
            (section("Yaw rate, worst seconds", false, &figure(&yaw_rate, &worst)?))
            (section("Error along the drive", true, &html! {
                div.pair {
                    @for chart in &pictures::residuals(outcome) { (figure(chart, "")?) }
                }
            }))
            (section("Rollout error over horizon, held-out data", true, &html! {
                div.pair {
                    @for chart in &pictures::horizon(outcome) { (figure(chart, "")?) }
                }
            }))
            (section("Lateral and forward acceleration", false, &figure(&pictures::accelerations(outcome), "")?))
        }
        @if fitted { (section("Held-out errors", false, &tables::errors(outcome))) }
        (section("Data", false, &tables::data(outcome, input.data_notes)))
        @if fitted {
            (section("Turns of the loop", true, &html! {
                p { (how(outcome)) }
                (tables::iterations(outcome))
            }))
        }
    };
    let tone = if outcome.accepted { Tone::Good } else { Tone::Caution };
    Ok(page("Tire identification", tone, &verdict(outcome), input.header, &body))
}

/// The first line: use it or not, and the two figures that matter.
fn verdict(outcome: &Outcome) -> String {
    let valid = &outcome.valid_within;
    let start = match (outcome.status, outcome.reasons.first()) {
        (Status::Accepted, _) => "Accepted".to_owned(),
        (Status::AcceptedWithin, _) => format!(
            "Accepted within the slips driven, {}° front and {}° rear, and the forces shown, {} and {} N",
            significant(valid.slip_rad.front.to_degrees(), 3),
            significant(valid.slip_rad.rear.to_degrees(), 3),
            significant(valid.force_n.front, 3),
            significant(valid.force_n.rear, 3)
        ),
        (Status::Provisional, Some(reason)) => {
            format!("Provisional, the peak rests on a prior: {reason}")
        }
        (Status::Provisional, None) => "Provisional, the peak rests on a prior".to_owned(),
        (Status::Rejected, Some(reason)) => format!("Not accepted: {reason}"),
        (Status::Rejected, None) => "Not accepted".to_owned(),
    };
    let stiffness = outcome.cornering_stiffness_n_per_rad;
    let stiffness = stiffness.map(|k| significant(k.value, 3));
    let grip = outcome.peak_friction.map(|p| {
        let (value, interval) = with_interval(p.value, p.low, p.high);
        match (p.reached, p.from_prior) {
            (true, _) => format!("{value} ({interval})"),
            (false, true) => format!("{} from the prior, peak not reached", fixed(p.value, 2)),
            (false, false) => "unknown, peak not reached".to_owned(),
        }
    });
    let grip = if grip.front == grip.rear {
        format!("{} front and rear", grip.front)
    } else {
        format!("front {}, rear {}", grip.front, grip.rear)
    };
    format!(
        "{start}. Peak friction {grip}; cornering stiffness front {}, rear {} N/rad.",
        stiffness.front, stiffness.rear
    )
}

/// One sentence on the way to the result.
fn how(outcome: &Outcome) -> String {
    let method = match outcome.config.method {
        Method::Paper => "the paper's procedure",
        Method::Robust => "the robust procedure",
    };
    let source = match outcome.source {
        Source::Start => "the start: nothing was fitted",
        Source::LeastSquares => "the direct least-squares fit",
        Source::ResidualLoop => "the residual loop",
        Source::NominalLoop => "the loop without a network",
    };
    let turns = outcome.iterations;
    let end = if outcome.converged { "converged" } else { "not converged" };
    let network = outcome.config.residual.name();
    let nuisance = &outcome.nuisance;
    format!(
        "Method: {method}, residual network {network}; {turns} turns, {end}. The tires above come from {source}. The direct fit \
         allowed for a relaxation length of {} m and for {} of the friction ellipse.",
        significant(nuisance.relaxation_m, 2),
        percent(nuisance.combined_slip)
    )
}
