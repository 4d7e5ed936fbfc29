//! The verdict as a sentence: the same at the head of the page and on the terminal.

use gripsight_diagnosis::{Diagnosis, RankedEffect, Verdict};

use super::words::{closes, named, words};
use crate::page::Tone;
use crate::text::{percent, significant};

/// Below this share of the gap the effects named close only a part of it.
const MOST: f64 = 0.5;
/// Mean squared error over the noise's from which what remains is worth a word.
const REMAINS: f64 = 2.0;
/// Error with other tires over that with flexible terms up to which the tires do what can be done.
const NEAR_CEILING: f64 = 1.5;

/// Chance from which what may be there in an effect's place is worth a word in the verdict.
const WORTH_A_WORD: f64 = 0.1;

/// What a drive is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Before<'a> {
    /// An earlier drive of the car, by its name.
    Drive(&'a str),
    /// A drive of the team's simulator, by its name.
    Simulator(&'a str),
}

impl Before<'_> {
    /// What is said of something that is not as it was there; `several` things have, one has.
    fn changed(self, several: bool) -> String {
        match self {
            Self::Drive(name) => format!("{} changed since {name}", if several { "have" } else { "has" }),
            Self::Simulator(name) => {
                format!(
                    "{} from the simulator ({name}) to the car",
                    if several { "differ" } else { "differs" }
                )
            }
        }
    }

    /// The head of a list of it.
    fn head(self) -> String {
        match self {
            Self::Drive(name) => format!("Changed since {name}"),
            Self::Simulator(name) => format!("From the simulator ({name}) to the car"),
        }
    }
}

/// What a diagnosis comes to: of a car against its model, or of a car against another drive.
pub(super) fn sentence(d: &Diagnosis, before: Option<Before<'_>>) -> String {
    let (has, have) = (before.map(|b| b.changed(false)), before.map(|b| b.changed(true)));
    let times = format!("{} times the noise", significant(d.gap.after.value, 2));
    let remains = remains(d);
    match d.verdict {
        Verdict::Effects => {
            let effects: Vec<String> =
                d.effects.iter().filter(|e| e.accepted).map(|e| or_else(d, e)).collect();
            let effects = enumerated(&effects);
            let closed = closed(d);
            if is_partial(d) {
                let change = before.map(|b| format!("{}: ", b.head())).unwrap_or_default();
                return format!(
                    "{change}{}, a part of the gap: {closed}; {times} remains, and none of the library's effects explains that.",
                    if before.is_some() { effects } else { capital(&effects) }
                );
            }
            let what = match &has {
                Some(has) => format!("What {has} is"),
                None => "The gap is".to_owned(),
            };
            let rest = if remains { format!("; {times} remains") } else { String::new() };
            format!("{what} {effects}: {closed}{rest}.")
        }
        Verdict::TireRetuneOnly => match (&have, tires_suffice(d)) {
            (Some(have), true) => format!("The tires {have}; no other effect is needed."),
            (None, true) => "Other tires close the gap; no other effect is needed.".into(),
            (Some(have), false) => format!("The tires {have}; {times} remains."),
            (None, false) => format!("Other tires are all that helps; {times} remains."),
        },
        Verdict::NoGap if !tires_suffice(d) => match &has {
            Some(has) => format!(
                "Nothing {has} as far as these data tell{}; {times} remains, which does not set them apart.",
                likeliest(d)
            ),
            None => format!(
                "No effect of the library is at work as far as these data tell, but {times} remains{}.",
                likeliest(d)
            ),
        },
        Verdict::NoGap => match &has {
            Some(has) => format!("Nothing {has} but for noise and the model's usual imperfection."),
            None => "No gap: model and car agree within the noise and the model's usual imperfection.".into(),
        },
        Verdict::NoneOfThese => {
            let what = match &has {
                Some(has) => format!("Something {has}"),
                None => "There is a gap".to_owned(),
            };
            let left = format!("with other tires {times} remains");
            match would_close_most(d) {
                None => format!("{what} that no effect of the library explains: {left}."),
                Some(e) => format!(
                    "{what} that no effect of the library surely explains: {left}; {} would close {} of it and is a cause with a chance of {}.",
                    named(e),
                    closes(&e.gap_closed_fraction),
                    percent(e.confidence)
                ),
            }
        }
        Verdict::NotIdentifiable => match d.reasons.first() {
            Some(reason) => format!("These data cannot tell: {reason}."),
            None => "These data cannot tell.".into(),
        },
    }
}

/// An effect with its sizes, and what may be there in its place.
fn or_else(d: &Diagnosis, effect: &RankedEffect) -> String {
    let chance = |name: &str| d.effects.iter().find(|e| e.name == name).map_or(0.0, |e| e.confidence);
    let others = effect.confused_with.iter().filter(|name| chance(name) >= WORTH_A_WORD);
    std::iter::once(named(effect)).chain(others.map(|name| words(name))).collect::<Vec<_>>().join(" or ")
}

/// The likeliest of the effects that are not named, where it is worth a word.
fn likeliest(d: &Diagnosis) -> String {
    let candidates = d.effects.iter().filter(|e| e.confidence >= WORTH_A_WORD);
    let first = candidates.max_by(|a, b| a.confidence.total_cmp(&b.confidence));
    first.map_or_else(String::new, |e| format!("; likeliest is {} ({})", named(e), percent(e.confidence)))
}

/// An effect that is not named and surely closes more than about half of the gap.
fn would_close_most(d: &Diagnosis) -> Option<&RankedEffect> {
    let candidates = d.effects.iter().filter(|e| !e.accepted && e.confidence >= WORTH_A_WORD);
    let closing = candidates.filter(|e| e.gap_closed_fraction.low > MOST);
    closing.max_by(|a, b| a.confidence.total_cmp(&b.confidence))
}

/// What the effects named close together.
fn closed(d: &Diagnosis) -> String {
    let closed = &d.gap_closed_fraction;
    if closed.value < 0.0 {
        "held-out errors grow with it".to_owned()
    } else if closed.value.is_finite() {
        format!("{} of what other tires leave closes", closes(closed))
    } else {
        "how much of what other tires leave closes cannot be stated".to_owned()
    }
}

/// How the sentence is meant.
pub(super) fn tone(d: &Diagnosis) -> Tone {
    let open = match d.verdict {
        Verdict::Effects => is_partial(d),
        Verdict::TireRetuneOnly | Verdict::NoGap => !tires_suffice(d),
        Verdict::NoneOfThese | Verdict::NotIdentifiable => true,
    };
    if open { Tone::Caution } else { Tone::Good }
}

/// Whether the model that is named leaves more than the noise and a little.
fn remains(d: &Diagnosis) -> bool {
    d.gap.after.value > REMAINS * d.gap.noise_floor.value
}

/// Whether the effects named close less than about half of the gap, and clearly more than the noise remains.
fn is_partial(d: &Diagnosis) -> bool {
    let (g, noise) = (&d.gap, d.gap.noise_floor.value);
    let closed = (g.retuned.value - g.after.value) / (g.retuned.value - noise).max(f64::MIN_POSITIVE);
    remains(d) && closed < MOST
}

/// Whether other tires bring the model near what could be explained at all, and near the noise.
fn tires_suffice(d: &Diagnosis) -> bool {
    !remains(d) && d.gap.retuned.value <= NEAR_CEILING * d.gap.unstructured_ceiling.value
}

/// "a, b and c".
fn enumerated(items: &[String]) -> String {
    match items {
        [first @ .., before, last] => [first, &[format!("{before} and {last}")]].concat().join(", "),
        one_or_none => one_or_none.concat(),
    }
}

/// As a sentence begins; a symbol such as v_y stays as it is.
fn capital(text: &str) -> String {
    if text.starts_with("v_") || text.starts_with("a_") {
        return text.to_owned();
    }
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}
