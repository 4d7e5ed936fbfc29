//! What can go wrong before a run, and how a run can end.

use serde::{Deserialize, Serialize};

/// A scenario that cannot be built, or a truth file that cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReferenceCarError {
    /// A value outside the range in which the physics means anything.
    #[error("{name} = {value} is outside what the car can be: expected {expected}")]
    InvalidParameter {
        /// The parameter's path, such as `car.mass_kg`.
        name: String,
        /// What was given.
        value: f64,
        /// The accepted range, in words.
        expected: &'static str,
    },
    /// A name that nothing goes by.
    #[error("no {kind} is called {name:?}; known: {known}")]
    UnknownName {
        /// What was looked up: `car`, `track`, `effect`, `driver` or `effect parameter`.
        kind: &'static str,
        /// The name asked for.
        name: String,
        /// The names that exist, separated by commas.
        known: String,
    },
    /// An effect given twice.
    #[error("effect {name} is given twice; give all its parameters at once")]
    RepeatedEffect {
        /// The effect's canonical name.
        name: String,
    },
    /// An effect in words that does not follow `NAME[=VALUE]` or `NAME=PARAMETER:VALUE,...`.
    #[error("cannot read effect {text:?}: {reason}")]
    UnreadableEffect {
        /// What was given.
        text: String,
        /// Why it cannot be read.
        reason: String,
    },
    /// A picture could not be encoded.
    #[error("cannot encode a picture of the road")]
    Picture(#[from] image::ImageError),
    /// The truth table could not be written.
    #[error("cannot write the truth table")]
    Truth(#[from] std::io::Error),
}

/// How a run ended. Everything recorded before the end is valid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "reason", rename_all = "snake_case")]
#[non_exhaustive]
pub enum EndReason {
    /// The whole duration was driven.
    Completed,
    /// The car came to rest.
    Standstill {
        /// Time of the event.
        time_s: f64,
    },
    /// The car rolled backwards.
    Reverse {
        /// Time of the event.
        time_s: f64,
        /// Longitudinal speed then.
        v_x_mps: f64,
    },
    /// The body slip angle left the range a driver catches.
    Spin {
        /// Time of the event.
        time_s: f64,
        /// Body slip angle then.
        slip_rad: f64,
    },
    /// Both wheels of one side lost the road and the body kept rolling.
    Rollover {
        /// Time of the event.
        time_s: f64,
        /// Roll angle then.
        roll_rad: f64,
    },
    /// The car left the track by more than its width.
    LeftTrack {
        /// Time of the event.
        time_s: f64,
        /// Distance from the centre line, left positive.
        offset_m: f64,
    },
    /// The state stopped being finite numbers.
    NotFinite {
        /// Time of the last finite state.
        time_s: f64,
    },
}

impl EndReason {
    /// Whether the whole duration was driven.
    pub fn is_completed(self) -> bool {
        self == Self::Completed
    }
}

impl std::fmt::Display for EndReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Completed => write!(f, "completed"),
            Self::Standstill { time_s } => write!(f, "the car came to a standstill at {time_s:.3} s"),
            Self::Reverse { time_s, v_x_mps } => {
                write!(f, "the car rolled backwards at {time_s:.3} s ({v_x_mps:.2} m/s)")
            }
            Self::Spin { time_s, slip_rad } => {
                write!(
                    f,
                    "the car spun at {time_s:.3} s (body slip angle {:.0} degrees)",
                    slip_rad.to_degrees()
                )
            }
            Self::Rollover { time_s, roll_rad } => {
                write!(
                    f,
                    "the car rolled over at {time_s:.3} s (roll angle {:.0} degrees)",
                    roll_rad.to_degrees()
                )
            }
            Self::LeftTrack { time_s, offset_m } => {
                write!(f, "the car left the track at {time_s:.3} s ({offset_m:.1} m from the centre line)")
            }
            Self::NotFinite { time_s } => {
                write!(
                    f,
                    "the state stopped being finite after {time_s:.3} s: the parameters are too extreme for the step"
                )
            }
        }
    }
}
