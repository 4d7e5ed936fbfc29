//! What an identification found, in words that page and terminal share.

use gripsight_identification::{Estimate, Outcome, PeakFriction, Status};

use crate::text::{estimate_of, fixed};

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
