//! What a check that speaks against a signal means, in a sentence, with what mends it.

use std::fmt;

use super::{Check, Finding, Pair};

/// Below this share of what it should be a signal is no signal of that.
const UNRELATED: f64 = 0.2;

impl Pair {
    /// What is compared, in words.
    #[must_use]
    pub fn sides(self) -> (&'static str, &'static str) {
        match self {
            Self::YawRateAndHeading => ("the yaw rate", "the turning of the pose's heading"),
            Self::YawRateAndGyro => ("the yaw rate", "the gyroscope's"),
            Self::SpeedAndPose => ("v_x", "the speed from pose to pose"),
            Self::LateralSpeedAndPose => ("v_y", "the sideways speed from pose to pose"),
            Self::LateralAccelerationAndMotion => ("a_y", "v_x times yaw rate with the change of v_y"),
            Self::ForwardAccelerationAndMotion => ("a_x", "the change of v_x"),
            Self::LateralSpeedAndAcceleration => ("the change of v_y", "what a_y leaves for it"),
            Self::MeasuredAndCommandedSteering => ("the measured steering", "the command"),
            Self::SteeringAndCurvature => ("the steering", "the angle that the curve driven takes"),
        }
    }

    /// The signals of a topics file of which one is turned where the two have opposite signs.
    fn turned(self) -> &'static str {
        match self {
            Self::YawRateAndHeading => "yaw_rate",
            Self::YawRateAndGyro => "yaw_rate` or `gyro_yaw_rate",
            Self::SpeedAndPose => "v_x",
            Self::LateralSpeedAndPose | Self::LateralSpeedAndAcceleration => "v_y",
            Self::LateralAccelerationAndMotion => "a_y",
            Self::ForwardAccelerationAndMotion => "a_x",
            Self::MeasuredAndCommandedSteering => "measured_steering",
            Self::SteeringAndCurvature => "steering` or `yaw_rate",
        }
    }
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (first, second) = self.pair.sides();
        let mapped = "in a topics file, which `gripsight bag info BAG --write-topics FILE` begins";
        match self.finding {
            Finding::Sign => {
                let signal = self.pair.turned();
                write!(
                    f,
                    "{first} has the other sign than {second}: the line `{signal}: {{topic: ..., field: ..., sign: -1}}` {mapped}, turns it"
                )
            }
            Finding::Unit { signal, probably } => write!(
                f,
                "{first} is {:.4} times {second}: {signal} is probably in {probably}; the line `{signal}: {{topic: ..., field: ..., unit: {probably}}}` {mapped}, says so",
                self.ratio
            ),
            Finding::NotMeasured { .. } => write!(
                f,
                "{first} is {:.2} times {second} ({:.2} to {:.2}): not measured, a model or a formula made it",
                self.ratio, self.low, self.high
            ),
            Finding::Scale { factor } if factor.abs() < UNRELATED => write!(
                f,
                "{first} does not follow {second} ({factor:.3} times it, {:.3} to {:.3}): a dead sensor, or another axis; the line `{}: {{topic: ..., field: ...}}` {mapped}, names another",
                self.low,
                self.high,
                self.pair.turned()
            ),
            _ => {
                write!(f, "{first} is {:.3} times {second} ({:.3} to {:.3})", self.ratio, self.low, self.high)
            }
        }
    }
}
