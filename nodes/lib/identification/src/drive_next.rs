//! What to drive, so that the next identification tells more: for a person, and for a driver that can do it.

use std::fmt;

use serde::{Deserialize, Serialize};

/// What to drive next.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DriveNext {
    /// What to do.
    pub manoeuvre: Manoeuvre,
    /// Forward speed to do it at, m/s; `None`: at any.
    pub v_x_mps: Option<f64>,
    /// Lateral acceleration to go to, m/s2; `None`: that of the line.
    pub a_y_mps2: Option<f64>,
    /// The same for a person, with what it is good for.
    pub why: String,
}

/// What to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Manoeuvre {
    /// Turn in and out again, below the limit of the tires.
    TurnIns,
    /// Corner harder than so far.
    CornerHarder,
    /// Corner to both sides, faster and faster.
    CornersBothWays,
    /// The same corners at two speeds.
    SameCornersAtTwoSpeeds,
    /// Drive on as before.
    DriveOn,
    /// Identify what was driven on each floor by itself.
    EachFloorByItself,
    /// Measure v_y.
    MeasureLateralVelocity,
}

impl Manoeuvre {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::TurnIns,
        Self::CornerHarder,
        Self::CornersBothWays,
        Self::SameCornersAtTwoSpeeds,
        Self::DriveOn,
        Self::EachFloorByItself,
        Self::MeasureLateralVelocity,
    ];

    /// That of a name; `None`: there is no such one.
    #[must_use]
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|manoeuvre| manoeuvre.name() == name)
    }

    /// Whether turning in more often, below the limit, does it.
    #[must_use]
    pub fn is_turning_in(self) -> bool {
        matches!(self, Self::TurnIns | Self::CornersBothWays | Self::DriveOn)
    }

    /// Its name in files and messages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::TurnIns => "turn_ins",
            Self::CornerHarder => "corner_harder",
            Self::CornersBothWays => "corners_both_ways",
            Self::SameCornersAtTwoSpeeds => "same_corners_at_two_speeds",
            Self::DriveOn => "drive_on",
            Self::EachFloorByItself => "each_floor_by_itself",
            Self::MeasureLateralVelocity => "measure_lateral_velocity",
        }
    }

    /// With a reason, at any speed.
    pub(crate) fn because(self, why: impl Into<String>) -> DriveNext {
        DriveNext { manoeuvre: self, v_x_mps: None, a_y_mps2: None, why: why.into() }
    }
}

impl DriveNext {
    pub(crate) fn at(self, v_x_mps: f64) -> Self {
        Self { v_x_mps: Some(v_x_mps), ..self }
    }

    pub(crate) fn up_to(self, a_y_mps2: f64) -> Self {
        Self { a_y_mps2: Some(a_y_mps2), ..self }
    }
}

impl fmt::Display for DriveNext {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { v_x_mps, a_y_mps2, why, .. } = self;
        match (v_x_mps, a_y_mps2) {
            (Some(v), Some(a)) => write!(f, "{why}: {a:.1} m/s² at {v:.1} m/s"),
            (Some(v), None) => write!(f, "{why}: at {v:.1} m/s"),
            (None, Some(a)) => write!(f, "{why}: {a:.1} m/s²"),
            (None, None) => f.write_str(why),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_files() {
        for manoeuvre in Manoeuvre::ALL {
            assert_eq!(serde_json::to_value(manoeuvre).unwrap(), manoeuvre.name());
            assert_eq!(Manoeuvre::by_name(manoeuvre.name()), Some(manoeuvre));
        }
        assert_eq!(Manoeuvre::by_name("handstand"), None);
    }

    #[test]
    fn a_person_reads_what_for_how_hard_and_how_fast() {
        let next = Manoeuvre::TurnIns.because("more turn-ins").at(12.0).up_to(3.0);
        assert_eq!(next.to_string(), "more turn-ins: 3.0 m/s² at 12.0 m/s");
        assert_eq!(Manoeuvre::DriveOn.because("drive on").to_string(), "drive on");
    }
}
