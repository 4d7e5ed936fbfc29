//! Whether errors can be read against the noise of a recording.

use gripsight_model::Recording;
use gripsight_model::noise::{WHITE_RATIO, unclear};

/// A sentence where the noise cannot be told from the signals.
pub(crate) fn caveat(recording: &Recording) -> Option<String> {
    let names = unclear(recording, WHITE_RATIO);
    (!names.is_empty()).then(|| {
        format!(
            "noise cannot be told from these signals ({}: smoothed, interpolated or simulated): the floor is a lower bound, and so is every share of the gap; read the errors against each other, not against 1",
            names.join(", ")
        )
    })
}
