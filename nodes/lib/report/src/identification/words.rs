//! What an identification found, in words that page and terminal share.

use gripsight_identification::{
    Estimate, Given, Handling, LimitsAt, Longitudinal, Outcome, PeakFriction, Status, Told,
};

use crate::text::{estimate_of, fixed, interval, significant, with_interval};

/// An estimate with its interval behind it.
#[must_use]
pub fn estimate(e: &Estimate) -> String {
    estimate_of(e.value, e.low, e.high)
}

/// What a set may be used for.
#[must_use]
pub fn status(outcome: &Outcome) -> &'static str {
    match outcome.status {
        Status::Accepted => "accepted",
        Status::AcceptedWithin => "accepted within what was driven",
        Status::Provisional => "provisional: the peak rests on a prior",
        Status::Rejected => "not accepted",
    }
}

/// Peak friction with its interval, or what stands in its place.
#[must_use]
pub fn peak_friction(peak: &PeakFriction) -> String {
    if peak.reached {
        estimate(&Estimate { value: peak.value, low: peak.low, high: peak.high })
    } else if peak.from_prior {
        format!("{} from the prior", fixed(peak.value, 2))
    } else {
        "not reached".to_owned()
    }
}

/// The understeer gradient in degrees of road-wheel angle per g, with what it says of the car.
#[must_use]
pub fn understeer(found: &Handling) -> String {
    const DEG_PER_G: f64 = 180.0 / std::f64::consts::PI * 9.806_65;
    let Estimate { value, low, high } = found.understeer_gradient_rad_per_mps2;
    if !(low.is_finite() && high.is_finite()) {
        return "unknown".to_owned();
    }
    let says = match (low > 0.0, high < 0.0) {
        (true, _) => "understeers",
        (_, true) => "oversteers",
        _ => "neutral, as far as the data tell",
    };
    let (value, interval) = with_interval(value * DEG_PER_G, low * DEG_PER_G, high * DEG_PER_G);
    format!("{value} ({interval}) up to {} m/s2: {says}", significant(found.up_to_a_y_mps2, 2))
}

/// What stands in the place of a figure that the data do not tell.
pub const UNKNOWN: &str = "unknown";

/// What a drive tells of the drive train, a line each: what it is and what was found.
#[must_use]
pub fn drive_train(found: &Longitudinal) -> Vec<[String; 2]> {
    let figures = [
        ("acceleration over command", &found.gain),
        ("drive delay s", &found.delay_s),
        ("drive lag s", &found.lag_s),
        ("rolling resistance m/s2", &found.rolling_resistance_mps2),
        ("drag 1/m", &found.drag_1pm),
    ];
    let figures = figures.map(|(title, told)| {
        let value = match told {
            Told::Known(e) => estimate(e),
            Told::Unknown => UNKNOWN.to_owned(),
        };
        [title.to_owned(), value]
    });
    let given = |given: Option<Given>| match given {
        None => "none asked".to_owned(),
        Some(Given { value, reached }) => {
            format!("{} {}", fixed(value, 1), if reached { "reached" } else { "shown" })
        }
    };
    let limit = |at: &LimitsAt| {
        let speeds = interval(at.v_x_mps.low, at.v_x_mps.high);
        [format!("m/s2 at {speeds} m/s"), format!("{}, {}", given(at.a_max_mps2), given(at.a_min_mps2))]
    };
    figures.into_iter().chain(found.limits.iter().map(limit)).collect()
}
