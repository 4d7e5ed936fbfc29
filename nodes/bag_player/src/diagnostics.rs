//! How the player is, from what it knows.

use gripsight_runtime::{Level, Status};

/// Lag behind the clock (s) from which the player says that it cannot keep up.
const LAG_LIMIT_S: f64 = 0.5;

/// What the player is doing.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) enum Stage {
    /// Nobody subscribes yet.
    #[default]
    Waiting,
    /// Messages go out.
    Playing,
    /// The parameter `paused` is true.
    Paused,
    /// The bag is at its end.
    Finished,
}

/// What the player knows.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct State {
    pub(crate) stage: Stage,
    pub(crate) rate: f64,
    /// Messages published.
    pub(crate) published: u64,
    /// Messages passed over: their topic is not played or has no subscriber, or they are no
    /// little-endian CDR.
    pub(crate) passed_over: u64,
    /// Bag time since its first message (s).
    pub(crate) played_s: f64,
    /// How late the last message was (s).
    pub(crate) lag_s: f64,
    /// Why reading ended early: the bag is cut off.
    pub(crate) truncated: Option<String>,
}

/// WARN while nobody listens, when the bag is cut off and when the player cannot keep up.
pub(crate) fn status(state: &State) -> Status {
    let (level, message) = match (&state.stage, &state.truncated) {
        (Stage::Waiting, _) => (Level::Warn, "waiting for subscribers".to_owned()),
        (_, Some(reason)) => (Level::Warn, format!("played what is there: {reason}")),
        (Stage::Playing, None) if state.lag_s > LAG_LIMIT_S => {
            (Level::Warn, format!("cannot keep up with rate {}", state.rate))
        }
        (Stage::Playing, None) => (Level::Ok, "playing".to_owned()),
        (Stage::Paused, None) => (Level::Ok, "paused".to_owned()),
        (Stage::Finished, None) => (Level::Ok, "finished".to_owned()),
    };
    Status::new(level, message)
        .value("published", state.published)
        .value("passed over", state.passed_over)
        .value("played (s)", format!("{:.2}", state.played_s))
        .value("rate", state.rate)
        .value("lag (s)", format!("{:.3}", state.lag_s))
}

#[cfg(test)]
mod tests {
    use gripsight_runtime::manual_covers;

    use super::*;

    #[test]
    fn levels() {
        let playing = State { stage: Stage::Playing, rate: 10.0, ..State::default() };
        assert_eq!(status(&State::default()).level, Level::Warn);
        assert_eq!(status(&playing).level, Level::Ok);
        let late = status(&State { lag_s: 0.6, ..playing.clone() });
        assert_eq!((late.level, late.message.as_str()), (Level::Warn, "cannot keep up with rate 10"));
        let cut = State { stage: Stage::Finished, truncated: Some("cut off at byte 7".into()), ..playing };
        assert!(status(&cut).message.ends_with("cut off at byte 7"));
        let paused = State { stage: Stage::Paused, ..State::default() };
        let finished = State { stage: Stage::Finished, ..State::default() };
        let states = [status(&State::default()), late, status(&cut), status(&paused), status(&finished)];
        assert_eq!(manual_covers(include_str!("../README.md"), &states), Ok(()));
    }
}
