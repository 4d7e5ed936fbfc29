//! What the data say of the figures that are stated of the car.

use std::fmt::Write;

use gripsight_diagnosis::{Diagnosis, FigureAnswer};
use maud::{Markup, html};

use crate::text::{significant, with_interval};

/// For a terminal: the figures that the data contradict, and those that nobody stated.
pub(super) fn lines(out: &mut String, d: &Diagnosis) {
    let mut head = "figures";
    for figure in d.figures.iter().filter(|f| f.contradicted || f.stated.is_none()) {
        let (value, range) = with_interval(figure.value, figure.low, figure.high);
        let _ = writeln!(out, "{head:<10} {} {value} [{range}]: {}", figure.name, judged(figure));
        head = "";
    }
}

/// All of them, as a table.
pub(super) fn table(d: &Diagnosis) -> Markup {
    html! {
        table {
            thead { tr { th { "Figure" } th { "Stated" } th { "By the data and the prior" } th { "90 % interval" } th { "" } } }
            tbody {
                @for figure in &d.figures {
                    @let (value, range) = with_interval(figure.value, figure.low, figure.high);
                    tr class=[figure.contradicted.then_some("named")] {
                        td { (figure.name) }
                        td { (figure.stated.map_or_else(|| "–".to_owned(), |s| significant(s, 4))) }
                        td { (value) }
                        td { (range) }
                        td { (judged(figure)) }
                    }
                }
            }
        }
        p {
            "Each figure beside the model that is stated, the others as they are there. What a drive does not show stays as it is stated, or, where nothing "
            "is, as cars of this size mostly have it."
        }
    }
}

fn judged(figure: &FigureAnswer) -> String {
    match figure.stated {
        None => "not stated".to_owned(),
        Some(stated) if figure.contradicted => {
            format!("the data contradict the {} that is stated", significant(stated, 4))
        }
        Some(_) => String::new(),
    }
}
