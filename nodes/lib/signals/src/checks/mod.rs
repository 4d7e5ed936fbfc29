//! Every signal against every other: what agrees, what does not, and what nothing recorded can check.
//!
//! A check compares two ways to the same change over short spans (half a second): the turn by the heading and by the yaw rate, the way by the
//! pose and by the speed, the sideways way and v_y, the change of v_y and the accelerations. The slope of one over the other is one where
//! both are right; it is estimated robustly (Theil and Sen's median of slopes, weighted by their span; Sen, JASA 63 (1968) 1379) with an
//! interval from leaving out blocks of spans in turn. Nothing is rescaled: a check yields a typed [`Finding`], and only what a topics file
//! states changes data.

mod robust;
mod spans;

use serde::Serialize;

use crate::{SignalError, StateSequence};
use robust::{Slope, slope};
use spans::Spans;

/// What is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Pair {
    /// The yaw rate and the turn of the pose's heading.
    YawRateAndHeading,
    /// The yaw rate and the gyroscope's.
    YawRateAndGyro,
    /// v_x and the way from pose to pose.
    SpeedAndPose,
    /// v_y and the sideways way from pose to pose.
    LateralSpeedAndPose,
    /// a_y and v_x times yaw rate with the change of v_y.
    LateralAccelerationAndMotion,
    /// a_x and the change of v_x.
    ForwardAccelerationAndMotion,
    /// The change of v_y and what a_y leaves for it.
    LateralSpeedAndAcceleration,
    /// The measured steering angle and the command.
    MeasuredAndCommandedSteering,
}

/// What a check found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Finding {
    /// Both say the same.
    Agrees,
    /// One has the other's sign turned.
    Sign,
    /// One is in another unit.
    Unit {
        /// The unit that its values would fit.
        probably: &'static str,
    },
    /// One is the other times this.
    Scale {
        /// First over second.
        factor: f64,
    },
    /// The drive does not tell: both hardly change, or noise covers it.
    NotTold,
    /// The second is made of the first: it checks nothing.
    SameSource,
    /// v_y does not follow what pose or accelerometer say: a model or a formula made it, or it is of another point.
    NotMeasured {
        /// Share of the motion that it follows.
        share: f64,
    },
}

impl Finding {
    /// Whether it speaks against one of the signals.
    #[must_use]
    pub fn disagrees(&self) -> bool {
        !matches!(self, Self::Agrees | Self::NotTold | Self::SameSource)
    }
}

/// One comparison.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Check {
    /// What is compared.
    pub pair: Pair,
    /// Slope of the first over the second; one where both are right.
    pub ratio: f64,
    /// Lower end of its 90 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// What remains of the first at no change of the second, in its unit.
    pub offset: f64,
    /// Spans compared.
    pub spans: usize,
    /// What that means.
    #[serde(flatten)]
    pub finding: Finding,
}

/// A property of a signal that nothing recorded can check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Unchecked {
    /// Which signal, as the table of channels has it.
    pub signal: &'static str,
    /// What of it.
    pub property: &'static str,
    /// What would have to be recorded.
    pub needs: &'static str,
}

/// What the signals of a sequence say of each other.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Checks {
    /// Every comparison that could be made.
    pub checks: Vec<Check>,
    /// What could not.
    pub unchecked: Vec<Unchecked>,
}

impl Checks {
    /// The check of a pair.
    #[must_use]
    pub fn of(&self, pair: Pair) -> Option<&Check> {
        self.checks.iter().find(|check| check.pair == pair)
    }

    /// The checks that speak against a signal.
    pub fn disagreeing(&self) -> impl Iterator<Item = &Check> {
        self.checks.iter().filter(|check| check.finding.disagrees())
    }

    fn told(&self, pairs: &[Pair]) -> bool {
        self.checks
            .iter()
            .any(|c| pairs.contains(&c.pair) && !matches!(c.finding, Finding::NotTold | Finding::SameSource))
    }
}

/// Off by less than this, two sensors may be right as they are: a wheel's radius under load, a gyroscope's scale by its data sheet.
const TOLERANCE: f64 = 0.04;
/// An interval wider than this tells nothing.
const TOO_WIDE: f64 = 0.6;
/// Turns of unit between two signals of one kind, first over second.
const ANGLES: [(f64, &str); 2] =
    [(180.0 / std::f64::consts::PI, "deg and deg/s"), (std::f64::consts::PI / 180.0, "rad beside deg")];
const SPEEDS: [(f64, &str); 3] = [(3.6, "km/h"), (2.236_94, "mph"), (1.943_84, "kn")];
const FORCES: [(f64, &str); 1] = [(1.0 / 9.806_65, "g")];

/// Compares the signals of a sequence.
///
/// # Errors
/// What [`StateSequence::check`] finds.
pub fn cross_check(sequence: &StateSequence) -> Result<Checks, SignalError> {
    sequence.check()?;
    let spans = Spans::of(sequence);
    let mut all = Checks::default();
    let mut add = |pair, made: Option<(Vec<f64>, Vec<f64>)>, least: f64, units: &[(f64, &'static str)]| {
        if let Some((first, second)) = made {
            all.checks.push(judged(pair, &first, &second, least, units));
        }
    };
    add(Pair::YawRateAndHeading, spans.turns(), 0.05, &ANGLES);
    add(Pair::YawRateAndGyro, spans.gyro(), 0.05, &ANGLES);
    add(Pair::SpeedAndPose, spans.ways(), 0.1, &SPEEDS);
    add(Pair::LateralSpeedAndPose, spans.sideways(), 0.01, &[]);
    add(Pair::LateralAccelerationAndMotion, spans.lateral_forces(), 0.5, &FORCES);
    add(Pair::ForwardAccelerationAndMotion, spans.forward_forces(), 0.3, &FORCES);
    add(Pair::LateralSpeedAndAcceleration, spans.slipping(), 0.02, &[]);
    add(Pair::MeasuredAndCommandedSteering, spans.steering(), 0.01, &ANGLES);
    all.unchecked = unchecked(&all, sequence);
    Ok(all)
}

fn judged(pair: Pair, first: &[f64], second: &[f64], least: f64, units: &[(f64, &'static str)]) -> Check {
    let same = first.iter().zip(second).all(|(a, b)| (a - b).abs() <= 1e-6 * (1.0 + b.abs()));
    let found = slope(first, second, least);
    let Slope { value, low, high, offset } =
        found.unwrap_or(Slope { value: f64::NAN, low: f64::NAN, high: f64::NAN, offset: f64::NAN });
    let near = |factor: f64| (value / factor - 1.0).abs() < 0.15;
    let finding = if same {
        Finding::SameSource
    } else if !value.is_finite() || high - low > TOO_WIDE * value.abs().max(1.0) {
        Finding::NotTold
    } else if low - TOLERANCE <= 1.0 && 1.0 <= high + TOLERANCE {
        Finding::Agrees
    } else if let Some((_, probably)) = units.iter().find(|(factor, _)| near(*factor) || near(-factor)) {
        Finding::Unit { probably }
    } else if low <= -1.0 + 0.3 && high >= -1.0 - 0.3 && value < 0.0 {
        Finding::Sign
    } else if matches!(pair, Pair::LateralSpeedAndPose | Pair::LateralSpeedAndAcceleration) {
        Finding::NotMeasured { share: value }
    } else {
        Finding::Scale { factor: value }
    };
    Check { pair, ratio: value, low, high, offset, spans: first.len(), finding }
}

fn unchecked(all: &Checks, sequence: &StateSequence) -> Vec<Unchecked> {
    let mut out = Vec::new();
    let mut lacks = |pairs: &[Pair], signal, property, needs| {
        if !all.told(pairs) {
            out.push(Unchecked { signal, property, needs });
        }
    };
    lacks(
        &[Pair::YawRateAndHeading, Pair::YawRateAndGyro],
        "yaw_rate_radps",
        "scale and sign",
        "a heading of a localisation, or a gyroscope of its own",
    );
    lacks(&[Pair::SpeedAndPose], "v_x_mps", "scale", "a pose of a localisation");
    if sequence.has_v_y() {
        lacks(
            &[Pair::LateralSpeedAndPose, Pair::LateralSpeedAndAcceleration],
            "v_y_mps",
            "whether it is measured",
            "a pose of a localisation, or a lateral accelerometer",
        );
    }
    out.push(Unchecked {
        signal: "steering_rad",
        property: "scale and zero",
        needs: "the angle of the road wheels, measured at the wheels",
    });
    out
}

#[cfg(test)]
mod tests;
