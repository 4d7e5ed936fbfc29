//! What a drive tells of the drive train.

use serde::{Deserialize, Serialize};

use crate::{Interval, Message, Range};

/// The acceleration that a car gave in a range of speeds, with drag and rolling resistance in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LongitudinalLimit {
    /// The speeds (m/s).
    pub v_x_mps: Range,
    /// Largest forward (m/s2): the limit where it was reached, else what was shown; NaN: none was asked for.
    pub a_max_mps2: f64,
    /// True when more was asked for and not given.
    pub a_max_reached: bool,
    /// Largest backward (m/s2), negative, likewise.
    pub a_min_mps2: f64,
    /// True when more braking was asked for and not given.
    pub a_min_reached: bool,
}

impl Message for LongitudinalLimit {
    const TYPE: &'static str = "gripsight_msgs/msg/LongitudinalLimit";
}

/// What a drive tells of the drive train: dv_x/dt = gain u - rolling_resistance - drag v_x^2, u the commanded acceleration after delay and lag.
/// A figure that the drive does not tell is NaN.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Longitudinal {
    /// Acceleration over commanded acceleration.
    pub gain: Interval,
    /// From a command to its effect (s).
    pub delay_s: Interval,
    /// Time constant of what follows (s).
    pub lag_s: Interval,
    /// Rolling resistance over the mass (m/s2).
    pub rolling_resistance_mps2: Interval,
    /// Drag over the mass (1/m).
    pub drag_1pm: Interval,
    /// Accelerations against speed, slowest first; empty: nothing is known.
    pub limits: Vec<LongitudinalLimit>,
}

impl Message for Longitudinal {
    const TYPE: &'static str = "gripsight_msgs/msg/Longitudinal";
}
