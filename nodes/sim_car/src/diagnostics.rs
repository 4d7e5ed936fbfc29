//! How the car is, from what the node knows.

use gripsight_runtime::{Level, Status};

/// Lag behind the clock (s) from which the node says that it cannot keep up.
const LAG_LIMIT_S: f64 = 0.2;

/// What the node knows.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct State {
    /// Time that the car has driven (s).
    pub(crate) driven_s: f64,
    pub(crate) v_x_mps: f64,
    /// Age of the last drive command (s); none where the own driver is at work.
    pub(crate) command_age_s: Option<f64>,
    pub(crate) command_timeout_s: f64,
    /// How far the car is behind its clock (s).
    pub(crate) lag_s: f64,
    /// Why the car cannot go on.
    pub(crate) end: Option<String>,
}

/// ERROR when the car cannot go on; WARN without fresh commands and when it cannot keep up.
pub(crate) fn status(state: &State) -> Status {
    let stale = state.command_age_s.is_some_and(|age| age > state.command_timeout_s);
    let (level, message) = match &state.end {
        Some(reason) => (Level::Error, format!("the car cannot go on: {reason}")),
        None if state.lag_s > LAG_LIMIT_S => (Level::Warn, "cannot keep up with the clock".to_owned()),
        None if stale => (Level::Warn, "no drive commands: braking".to_owned()),
        None => (Level::Ok, "driving".to_owned()),
    };
    let status = Status::new(level, message)
        .value("driven (s)", format!("{:.2}", state.driven_s))
        .value("speed (m/s)", format!("{:.2}", state.v_x_mps))
        .value("lag (s)", format!("{:.3}", state.lag_s));
    match state.command_age_s {
        Some(age) if age.is_finite() => status.value("age of the command (s)", format!("{age:.3}")),
        _ => status,
    }
}

#[cfg(test)]
mod tests {
    use gripsight_runtime::manual_covers;

    use super::*;

    #[test]
    fn levels() {
        let driving = State { command_age_s: Some(0.01), command_timeout_s: 0.5, ..State::default() };
        assert_eq!(status(&driving).level, Level::Ok);
        let silent = status(&State { command_age_s: Some(f64::INFINITY), ..driving.clone() });
        assert_eq!((silent.level, silent.message.as_str()), (Level::Warn, "no drive commands: braking"));
        let late = status(&State { lag_s: 1.0, ..driving.clone() });
        assert_eq!(late.level, Level::Warn);
        let over = status(&State { end: Some("the car rolled over at 1.000 s".into()), ..driving });
        assert_eq!(over.level, Level::Error);
        assert!(over.message.contains("rolled over"));
        assert_eq!(manual_covers(include_str!("../README.md"), &[silent, late, over]), Ok(()));
    }
}
