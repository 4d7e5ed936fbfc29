//! Whether the noise of a recording can be told, so that errors can be read against it.

use gripsight_model::Recording;
use gripsight_model::noise::{ROUGH_RATIO, WHITE_RATIO, unclear};

/// Whether the noise of most channels can be told, if roughly, so that errors can be read against it.
pub(crate) fn is_known(recording: &Recording) -> bool {
    2 * unclear(recording, ROUGH_RATIO).len() <= recording.channels.iter().filter(|c| c.scored()).count()
}

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
