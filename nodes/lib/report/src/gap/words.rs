//! Names and sizes as people read them, on the page and on the terminal.

use gripsight_diagnosis::{Diagnosis, EffectParameter, RankedEffect};
use gripsight_estimation::Estimate;

use crate::text::{estimate_of, interval, percent, percent_estimate, significant, with_interval};

/// Ends beyond so many times the value tell nothing of it.
const WIDEST: f64 = 10.0;
const NOT_TOLD: &str = "not told";

/// A name without underscores, and without the unit at its end: that stands beside the number.
pub(super) fn words(name: &str) -> String {
    const UNITS: [&str; 9] = ["_radps", "_rad", "_mps2", "_mps", "_m", "_s", "_1pm", "_per_min", "_per_g"];
    if name == "rad_per_g" {
        return "angle".to_owned();
    }
    let bare = UNITS.iter().find_map(|unit| name.strip_suffix(unit)).unwrap_or(name);
    // The velocities keep theirs.
    bare.replace('_', " ")
        .replace("v x", "v_x")
        .replace("v y", "v_y")
        .replace("a x", "a_x")
        .replace("a y", "a_y")
}

/// A unit behind its number.
pub(super) fn unit(unit: &str) -> String {
    if unit == "1" { String::new() } else { format!(" {}", unit.replace('2', "²")) }
}

/// The unit at the end of a channel's name.
pub(super) fn channel_unit(name: &str) -> &'static str {
    let units = [("_mps2", " m/s²"), ("_mps", " m/s"), ("_radps", " rad/s"), ("_rad", " rad")];
    units.into_iter().find(|(end, _)| name.ends_with(end)).map_or("", |(_, unit)| unit)
}

/// A parameter with its interval. An end that is not there is said so; an interval far wider than the value tells nothing.
fn size(name: &str, p: &EffectParameter) -> String {
    let name = words(name);
    if !p.value.is_finite() {
        return format!("{name} none");
    }
    let before = before(p);
    let unit = unit(p.unit);
    // A size that has gone back to nothing is told against what it was.
    let size = p.before.map_or(p.value.abs(), |before| p.value.abs().max(before.abs()));
    let told = |end: f64| end.is_finite() && end.abs() <= WIDEST * size;
    let (value, range) = match (told(p.low), told(p.high)) {
        (true, true) => (with_interval(p.value, p.low, p.high).0, interval(p.low, p.high)),
        (true, false) => (significant(p.value, 3), format!("{} … {NOT_TOLD}", significant(p.low, 3))),
        (false, true) => (significant(p.value, 3), format!("{NOT_TOLD} … {}", significant(p.high, 3))),
        (false, false) => return format!("{name} {NOT_TOLD}{before}"),
    };
    format!("{name} {value} ({range}){unit}{before}")
}

/// What the model handed over, or that of the drive before, has of it.
fn before(p: &EffectParameter) -> String {
    p.before.map_or_else(String::new, |before| format!(", before {}", significant(before, 3)))
}

/// The effects to list, at most so many: those named, then candidates by what they would close; the likeliest candidate is always among them.
pub(super) fn listed(d: &Diagnosis, most: usize) -> Vec<&RankedEffect> {
    let mut listed: Vec<&RankedEffect> = d.effects.iter().take(most).collect();
    let likeliest =
        d.effects.iter().filter(|e| !e.accepted).max_by(|a, b| a.confidence.total_cmp(&b.confidence));
    if let (Some(likeliest), Some(last)) = (likeliest, listed.last_mut())
        && !last.accepted
        && likeliest.confidence > 0.0
        && d.effects.iter().position(|e| e.name == likeliest.name) >= Some(most)
    {
        *last = likeliest;
    }
    listed
}

/// The parameters of an effect with their intervals.
pub(super) fn sizes(effect: &RankedEffect) -> String {
    effect.parameters.iter().map(|(name, p)| size(name, p)).collect::<Vec<_>>().join(", ")
}

/// A figure of the budget with its interval; of too few blocks there is none.
pub(super) fn figure(e: &Estimate) -> String {
    if e.value.is_finite() && !(e.low.is_finite() && e.high.is_finite()) {
        format!("{} (interval {NOT_TOLD})", significant(e.value, 3))
    } else {
        estimate_of(e.value, e.low, e.high)
    }
}

/// What an effect closes.
pub(super) fn closes(fraction: &Estimate) -> String {
    if fraction.value.is_nan() {
        "not stated".to_owned()
    } else if fraction.value <= -0.005 {
        "makes held-out errors larger".to_owned()
    } else if fraction.low < fraction.high {
        percent_estimate(fraction.value, fraction.low, fraction.high)
    } else {
        percent(fraction.value)
    }
}

/// An effect with its sizes, for a sentence.
pub(super) fn named(effect: &RankedEffect) -> String {
    let sizes = effect.parameters.iter().filter(|(_, p)| p.value.is_finite()).map(|(name, p)| {
        let (value, _) = with_interval(p.value, p.low, p.high);
        format!("{} {value}{}{}", words(name), unit(p.unit), before(p))
    });
    format!("{} ({})", words(effect.name), sizes.collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lose_underscores_and_units() {
        assert_eq!(words("steering_delay"), "steering delay");
        assert_eq!((words("delay_s"), words("v_y_lever_arm")), ("delay".into(), "v_y lever arm".into()));
        assert_eq!(words("rad_per_g"), "angle");
        assert_eq!((words("a_y_mps2"), channel_unit("a_y_mps2")), ("a_y".into(), " m/s²"));
        assert_eq!(words("yaw_rate_radps"), "yaw rate");
        assert_eq!((unit("1"), unit("m/s2")), (String::new(), " m/s²".into()));
    }

    #[test]
    fn sizes_have_the_digits_of_their_interval_and_none_where_it_tells_nothing() {
        let size_of = |value: f64, low: f64, high: f64, unit| {
            size("c_f", &EffectParameter { value, low, high, unit, before: None })
        };
        assert_eq!(size_of(1.2e-4, 1.08e-4, 1.31e-4, "rad/N"), "c f 0.000120 (0.000108 … 0.000131) rad/N");
        assert_eq!(size_of(-1e-5, -3e-5, 1e-5, "1"), "c f −0.000010 (−0.000030 … 0.000010)");
        assert_eq!(size_of(0.05, -3.758, 3.858, "1"), "c f not told");
        assert_eq!(size_of(1.9, 1.4, f64::INFINITY, "rad/s"), "c f 1.90 (1.40 … not told) rad/s");
        assert_eq!(size_of(f64::NAN, 0.0, 1.0, "1"), "c f none");
        let gone = EffectParameter { value: 0.0, low: -0.0033, high: 0.0033, unit: "s", before: Some(0.04) };
        assert_eq!(size("delay_s", &gone), "delay 0.0000 (−0.0033 … 0.0033) s, before 0.0400");
    }

    #[test]
    fn a_negative_share_is_said_in_words() {
        let estimate = |value: f64| Estimate { value, low: value - 0.1, high: value + 0.1 };
        assert_eq!(closes(&estimate(-0.78)), "makes held-out errors larger");
        assert_eq!(closes(&estimate(0.62)), "62 % (52 … 72 %)");
        assert_eq!(closes(&Estimate::UNKNOWN), "not stated");
        let two_blocks = Estimate { value: 8.0, low: f64::NEG_INFINITY, high: f64::INFINITY };
        assert_eq!(figure(&two_blocks), "8.00 (interval not told)");
    }
}
