//! Several drives explained together: what each says of that.

use std::fmt::Write;

use gripsight_diagnosis::{Diagnosis, DriveAnswer};
use gripsight_estimation::Estimate;
use maud::{Markup, html};

use super::sites::change_words;
use super::words::figure;
use crate::text::fixed;

/// For a terminal: a line each.
pub(super) fn lines(out: &mut String, d: &Diagnosis) {
    let mut head = "drives";
    for drive in &d.drives {
        let errors = if drive.retuned.value.is_finite() {
            let (retuned, after) = (figure(&drive.retuned), figure(&drive.after));
            format!("{retuned} times the noise with other tires, {after} with what is named")
        } else {
            "not explained".to_owned()
        };
        let _ = writeln!(
            out,
            "{head:<10} {}, {} s: {errors}; {}",
            drive.name,
            fixed(drive.duration_s, 0),
            contradicts(d, drive)
        );
        head = "";
    }
}

/// As a table.
pub(super) fn table(d: &Diagnosis) -> Markup {
    html! {
        table {
            thead { tr { th { "Drive" } th { "Length" } th { "Error with other tires" } th { "With what is named" } th { "Beside the others" } } }
            tbody {
                @for drive in &d.drives {
                    tr class=[drive.contradicts.as_ref().is_some_and(|c| !c.is_empty()).then_some("named")] {
                        td { (drive.name) }
                        td { (fixed(drive.duration_s, 0)) " s" }
                        td { (known(&drive.retuned)) }
                        td { (known(&drive.after)) }
                        td { (contradicts(d, drive)) }
                    }
                }
            }
        }
        p { "Mean squared errors over the noise of the stretches of each drive that nothing was fitted to, with their 90 % intervals." }
    }
}

fn known(error: &Estimate) -> String {
    if error.value.is_finite() { figure(error) } else { "–".to_owned() }
}

fn contradicts(d: &Diagnosis, drive: &DriveAnswer) -> String {
    match drive.contradicts.as_deref() {
        None => "not compared with the others: too short by itself, or with other signals".to_owned(),
        Some([]) if is_alone(d) => "what the others are held against".to_owned(),
        Some([]) => "agrees with the others".to_owned(),
        Some(changes) => {
            let said: Vec<String> = changes.iter().map(change_words).collect();
            format!("contradicts the others: {}", said.join("; "))
        }
    }
}

/// Whether drives contradict and no two of them agree: one is what the others are held against.
fn is_alone(d: &Diagnosis) -> bool {
    let (agree, differ): (Vec<_>, Vec<_>) =
        d.drives.iter().filter_map(|d| d.contradicts.as_ref()).partition(|c| c.is_empty());
    agree.len() == 1 && !differ.is_empty()
}
