//! Every signal against every other: what agrees, what does not, and what nothing recorded can check.
//!
//! A check compares two ways to the same change over short spans (half a second): the turn by the heading and by the yaw rate, the way by the
//! pose and by the speed, the sideways way and v_y, the change of v_y and the accelerations. The slope of one over the other is one where
//! both are right; it is estimated robustly (Theil and Sen's median of slopes, weighted by their span; Sen, JASA 63 (1968) 1379; Tukey's bisquare
//! where something else moves one of them too) with an interval from leaving out blocks of spans in turn. Nothing is rescaled: a check yields a typed [`Finding`], and only what a topics file
//! states changes data.

mod robust;
mod spans;
mod words;

use serde::Serialize;

use crate::{SignalError, StateSequence};
use robust::{Slope, ratio, slope, slope_beside, slope_through};
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
    /// The steering angle and that of the curve driven, wheelbase times yaw rate over v_x.
    SteeringAndCurvature,
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
        /// Which, as topics files name it.
        signal: &'static str,
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
/// v_y follows an accelerometer or a pose no better than this: a lag of its filter, a unit on a body that pitches and rolls.
const TOLERANCE_V_Y: f64 = 0.1;

/// Off by more than this, an accelerometer shows another thing than the car's motion, or in another unit: a body's roll adds a fifth at most.
const NOT_THE_MOTION: f64 = 0.5;

/// Spans in a row over which turns are compared.
const TURN_SPANS: [usize; 3] = [1, 3, 8];
/// Spans in a row over which the change of v_y is.
const SLIP_SPANS: [usize; 2] = [1, 2];

const DEG: f64 = 180.0 / std::f64::consts::PI;
const G: f64 = 1.0 / 9.806_65;
const KMH: f64 = 3.6;
const MPH: f64 = 2.236_94;
const KN: f64 = 1.943_84;

impl Pair {
    /// First over second where a signal is in another unit: the factor, the signal, its unit.
    fn units(self) -> &'static [(f64, &'static str, &'static str)] {
        match self {
            Self::YawRateAndHeading => &[(DEG, "yaw_rate", "deg/s"), (1.0 / DEG, "heading", "deg")],
            Self::YawRateAndGyro => &[(DEG, "yaw_rate", "deg/s"), (1.0 / DEG, "gyro_yaw_rate", "deg/s")],
            Self::SpeedAndPose => &[(KMH, "v_x", "km/h"), (MPH, "v_x", "mph"), (KN, "v_x", "kn")],
            Self::LateralAccelerationAndMotion => &[
                (G, "a_y", "g"),
                (1.0 / KMH, "v_x", "km/h"),
                (1.0 / MPH, "v_x", "mph"),
                (1.0 / DEG, "yaw_rate", "deg/s"),
            ],
            Self::ForwardAccelerationAndMotion => &[(G, "a_x", "g"), (1.0 / KMH, "v_x", "km/h")],
            Self::MeasuredAndCommandedSteering => {
                &[(DEG, "measured_steering", "deg"), (1.0 / DEG, "steering", "deg")]
            }
            Self::LateralSpeedAndPose | Self::LateralSpeedAndAcceleration | Self::SteeringAndCurvature => &[],
        }
    }
}

/// Compares the signals of a sequence.
///
/// # Errors
/// What [`StateSequence::check`] finds.
pub fn cross_check(sequence: &StateSequence) -> Result<Checks, SignalError> {
    sequence.check()?;
    let spans = Spans::of(sequence);
    let mut all = Checks::default();
    let mut add = |pair, first: &[f64], second: &[f64], found: Option<Slope>| {
        let with_pose =
            matches!(pair, Pair::YawRateAndHeading | Pair::SpeedAndPose | Pair::LateralSpeedAndPose);
        let same = with_pose && spans.poses_are_integral
            || first.iter().zip(second).all(|(a, b)| (a - b).abs() <= 1e-6 * (1.0 + b.abs()));
        let finding = if same { Finding::SameSource } else { judged(pair, found) };
        let Slope { value, low, high, offset } = found.unwrap_or(Slope::UNKNOWN);
        all.checks.push(Check { pair, ratio: value, low, high, offset, spans: first.len(), finding });
    };
    // A noisy heading tells more over longer turns: the length that tells most counts.
    let turns = TURN_SPANS.iter().filter_map(|&n| spans.turns(n)).map(|(first, second)| {
        let found = slope(&first, &second, 0.05);
        (first, second, found)
    });
    let width = |found: &Option<Slope>| found.map_or(f64::INFINITY, |s| s.high - s.low);
    if let Some((first, second, found)) = turns.min_by(|a, b| width(&a.2).total_cmp(&width(&b.2))) {
        add(Pair::YawRateAndHeading, &first, &second, found);
    }
    if let Some((first, second)) = spans.gyro() {
        add(Pair::YawRateAndGyro, &first, &second, slope(&first, &second, 0.05));
    }
    if let Some((first, second)) = spans.ways() {
        add(Pair::SpeedAndPose, &first, &second, ratio(&first, &second, 0.1));
    }
    if let Some((by_pose, by_speed, [turned])) = spans.sideways() {
        // The pose's noise must not lower the slope: it stands on the left, and the share is the slope's inverse.
        let found = slope_beside(&by_pose, &by_speed, &[&turned], 0.005).map(Slope::inverse);
        add(Pair::LateralSpeedAndPose, &by_speed, &by_pose, found);
    }
    let mut shows_turning = true;
    if let Some((force, motion, [turning])) = spans.lateral_forces() {
        let found = slope_beside(&force, &motion, &[&turning], 0.2);
        let is_useless = |s: Slope| s.high - s.low <= TOO_WIDE && (s.value - 1.0).abs() > NOT_THE_MOTION;
        shows_turning = !found.is_some_and(is_useless);
        add(Pair::LateralAccelerationAndMotion, &force, &motion, found);
    }
    if let Some((first, second)) = spans.forward_forces() {
        add(Pair::ForwardAccelerationAndMotion, &first, &second, slope(&first, &second, 0.3));
    }
    // Noise of v_y asks for long spans, and what jumps for short ones: the length that tells most counts here, too.
    let slips = SLIP_SPANS.iter().filter_map(|&n| spans.slipping(n)).map(|(change, left, beside)| {
        let [turned, turning, steering] = beside;
        // An accelerometer that does not show the turning shows no sideslip.
        let found =
            shows_turning.then(|| lateral_slope(&change, &left, &[&turned, &turning], &steering)).flatten();
        (change, left, found)
    });
    if let Some((change, left, found)) = slips.min_by(|a, b| width(&a.2).total_cmp(&width(&b.2))) {
        add(Pair::LateralSpeedAndAcceleration, &change, &left, found);
    }
    if let Some((first, second)) = spans.steering() {
        add(Pair::MeasuredAndCommandedSteering, &first, &second, slope(&first, &second, 0.01));
    }
    all.unchecked = unchecked(&all, sequence);
    Ok(all)
}

/// The change of v_y over what a_y leaves for it. A road's bank and a body that shakes are in a_y and lower the slope of a v_y that is measured; the slope the other
/// way round is free of them, and both enclose the truth (Frisch 1934). Where these leave it open the steering tells: what it moves, both show.
fn lateral_slope(change: &[f64], left: &[f64], beside: &[&[f64]], steering: &[f64]) -> Option<Slope> {
    const LEAST_MPS: f64 = 0.01;
    let pair = Pair::LateralSpeedAndAcceleration;
    let direct = slope_beside(change, left, beside, LEAST_MPS)?;
    let is_low = judged(pair, Some(direct)).disagrees() && (0.0..1.0).contains(&direct.value);
    if !is_low {
        return Some(direct);
    }
    let reverse = slope_beside(left, change, beside, LEAST_MPS).map(Slope::inverse);
    let may_be_right = reverse.is_some_and(|reverse| reverse.high + TOLERANCE_V_Y >= 1.0);
    let by_steering = slope_through(change, left, beside, steering).filter(|slope| {
        // Only where the two contradict each other has a_y errors that matter (Hausman 1978).
        may_be_right && slope.low > direct.high && judged(pair, Some(*slope)) == Finding::Agrees
    });
    Some(by_steering.unwrap_or(direct))
}

/// The steering against the curves driven: its sign and unit, and nothing finer, since tires slip.
///
/// # Errors
/// What [`StateSequence::check`] finds.
pub fn steering_check(sequence: &StateSequence, wheelbase_m: f64) -> Result<Option<Check>, SignalError> {
    /// A car that understeers as hard as any, or slides, takes this many times the angle of its curve; one that drifts, less than none at times.
    const MOST: f64 = 6.0;
    /// Wheels turn no further; in degrees, any drive with corners has more than so much.
    const WHEELS_RAD: f64 = 0.8;
    /// A gentle drive has not, but does not slide either: its ratio is degrees' own to within this factor.
    const CLOSE: f64 = 2.0;
    /// Of the values, a share that is no matter of a few.
    const USUAL: f64 = 0.95;
    sequence.check()?;
    let spans = Spans::of(sequence);
    let mut angles_rad: Vec<f32> = sequence.steering_rad.iter().map(|d| d.abs()).collect();
    angles_rad.sort_unstable_by(f32::total_cmp);
    let usual = angles_rad.get((USUAL * angles_rad.len() as f64) as usize).copied().map_or(0.0, f64::from);
    let Some((steering, angle)) = spans.curvature(wheelbase_m) else { return Ok(None) };
    let pair = Pair::SteeringAndCurvature;
    Ok(slope(&steering, &angle, 0.01).map(|Slope { value, low, high, offset }| {
        // A car that is carried out of its curves at the limit steers many times their angle, too, but by no angle that wheels do not have.
        let off = (value.abs() / DEG).ln().abs();
        let degrees = value.abs() > MOST && off < MOST.ln() && (usual > WHEELS_RAD || off < CLOSE.ln());
        let finding = if degrees {
            Finding::Unit { signal: "steering", probably: "deg" }
        } else if high < 0.0 {
            Finding::Sign
        } else if low > 1.0 / MOST && high < MOST {
            Finding::Agrees
        } else {
            Finding::NotTold
        };
        Check { pair, ratio: value, low, high, offset, spans: steering.len(), finding }
    }))
}

/// v_y as reported against one that poses and inertial unit give without it, sample by sample, beside the turning: either may be of another point.
/// `sigma_mps` is what the latter is known to.
///
/// A reported one that goes its own way is not measured, whatever share of the other it has: where what is left of it is larger than a fifth of the sideslip
/// there is, and not for want of knowing. On development drives honest ones leave 2 to 15 %, observers on tires that are too stiff 25 % and more.
#[must_use]
pub fn lateral_speed_check(
    reported_mps: &[f64],
    known_mps: &[f64],
    yaw_rate_radps: &[f64],
    sigma_mps: f64,
) -> Check {
    /// Of the sideslip beside the turning.
    const OWN_WAY: f64 = 0.2;
    /// Of the standard deviations that the known one has.
    const SURE: f64 = 3.0;
    let pair = Pair::LateralSpeedAndPose;
    // What is known has the noise: it stands on the left, and the share is the slope's inverse.
    let found = slope_beside(known_mps, reported_mps, &[yaw_rate_radps], 0.005).map(Slope::inverse);
    let Slope { value, low, high, offset } = found.unwrap_or(Slope::UNKNOWN);
    let mut finding = judged(pair, found);
    let known = robust::left_beside(known_mps, &[yaw_rate_radps]);
    let apart: Vec<f64> = reported_mps.iter().zip(known_mps).map(|(a, b)| a - b).collect();
    if let (Some(known), Some(apart)) = (known, robust::left_beside(&apart, &[yaw_rate_radps]))
        && apart > SURE * sigma_mps
        && apart > OWN_WAY * known
        && !finding.disagrees()
    {
        finding = Finding::NotMeasured { share: 1.0 - (apart / known).min(1.0) };
    }
    Check { pair, ratio: value, low, high, offset, spans: known_mps.len(), finding }
}

fn judged(pair: Pair, found: Option<Slope>) -> Finding {
    let Some(Slope { value, low, high, .. }) = found.filter(|s| s.value.is_finite()) else {
        return Finding::NotTold;
    };
    let of_v_y = matches!(pair, Pair::LateralSpeedAndPose | Pair::LateralSpeedAndAcceleration);
    let tolerance = if of_v_y { TOLERANCE_V_Y } else { TOLERANCE };
    let near = |factor: f64| (value / factor - 1.0).abs() < 0.15;
    let told = high - low <= TOO_WIDE * value.abs().max(1.0);
    if low - tolerance <= 1.0 && 1.0 <= high + tolerance {
        return if told { Finding::Agrees } else { Finding::NotTold };
    }
    if !told {
        return Finding::NotTold;
    }
    // A unit is a ratio that is known, not one that happens to lie there.
    let known = high - low <= TOO_WIDE * value.abs();
    if let Some(&(_, signal, probably)) =
        pair.units().iter().find(|(factor, ..)| known && (near(*factor) || near(-factor)))
    {
        Finding::Unit { signal, probably }
    } else if high < 0.0 && low < -0.5 && high > -2.0 {
        Finding::Sign
    } else if of_v_y {
        Finding::NotMeasured { share: value }
    } else {
        Finding::Scale { factor: value }
    }
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
