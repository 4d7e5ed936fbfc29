//! What of a recording is fitted, and what its signals say of each other.
//!
//! * Bad samples are left out.
//! * A motion that is not measured (no v_y, or one that is 0 while the car turns), or that contradicts the poses of a localisation, is estimated from
//!   poses, inertial unit and speed by the smoother of `gripsight_state_estimation`, which has no tire in it.
//! * What cannot be mended so is an objection: nothing is fitted then, and the objection says what mends it.
//!
//! A pure function of the sequence and the car, so that live and offline agree.

mod doubt;
mod estimate;

use std::fmt;

use gripsight_signals::{
    BadSpan, Check, Checks, Finding, Pair, StateSequence, cross_check, is_dead_reckoning,
    is_integral_of_twist, masked, stands_still, steering_check,
};
use gripsight_state_estimation::smooth;
use gripsight_vehicle::VehicleParameters;
use serde::Serialize;

use crate::{Estimate, IdentificationError};

pub use doubt::Doubt;
use estimate::{fill, sharper, source};

/// Why a channel was estimated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "why")]
pub enum Why {
    /// Nothing records it, or what does repeats itself while the car turns.
    NotMeasured,
    /// A check speaks against what is recorded.
    Contradicted {
        /// Which.
        pair: Pair,
        /// What is recorded over what the pose has.
        ratio: f64,
    },
}

/// A channel that was estimated from poses.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EstimatedChannel {
    /// Which, as the table of channels has it.
    pub channel: &'static str,
    /// Why.
    #[serde(flatten)]
    pub why: Why,
    /// Root mean square of its standard deviation, in its unit.
    pub sigma: f64,
}

/// What was estimated of the motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EstimatedMotion {
    /// Channel by channel.
    pub channels: Vec<EstimatedChannel>,
    /// How late the poses are; `None` where nothing tells.
    pub pose_delay_s: Option<Estimate>,
    /// The reported speed over the true one.
    pub v_x_scale: Estimate,
    /// Times at which the localisation jumped, since the start of the sequence, s.
    pub jumps_s: Vec<f64>,
    /// Observations that contradicted the rest, and hardly count.
    pub left_out: usize,
    /// Samples left out since their v_y is known far worse than that of the others.
    pub unknown_samples: usize,
}

/// Why nothing is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Objection {
    /// Two signals contradict each other, and only a topics file can say what the one in question is.
    Contradiction(Check),
    /// Nothing measures v_y, and no pose stands in for it.
    NoLateralSpeed {
        /// Whether a pose is recorded that is nothing but the integral of speed and yaw rate.
        dead_reckoning: bool,
    },
    /// Nothing measures the yaw rate, and no pose stands in for it.
    NoYawRate,
    /// The poses do not carry an estimate.
    PoorPoses,
    /// Nothing recorded checks v_y, and a car follows it far better with the other sign.
    TurnedLateralSpeed {
        /// How far any tires miss it as it is recorded,
        scatter_mps: f64,
        /// and with the other sign.
        turned_scatter_mps: f64,
    },
}

impl fmt::Display for Objection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const WAY_ON: &str = "record poses of a localisation, motion capture or GPS (`pose:` in a topics file): v_y is then estimated from them";
        match self {
            Self::Contradiction(check) => write!(f, "{check}"),
            Self::NoLateralSpeed { dead_reckoning: true } => write!(
                f,
                "v_y is not measured: it repeats itself while the car turns, and the pose is wheel and yaw rate counted together, which says nothing of it; {WAY_ON}"
            ),
            Self::NoLateralSpeed { dead_reckoning: false } => {
                write!(
                    f,
                    "v_y is not measured: it repeats itself while the car turns, and no pose is recorded; {WAY_ON}"
                )
            }
            Self::TurnedLateralSpeed { scatter_mps, turned_scatter_mps } => write!(
                f,
                "v_y has the wrong sign, as it seems: any tires miss it by {scatter_mps:.3} m/s, and by {turned_scatter_mps:.3} m/s if it is turned; the line `v_y: {{topic: ..., field: ..., sign: -1}}` of a topics file turns it, and poses or a lateral accelerometer would check it"
            ),
            Self::NoYawRate => write!(
                f,
                "the yaw rate is not measured: it repeats itself while the car turns, and no pose is recorded; map a gyroscope (`yaw_rate:` in a topics file) or a pose"
            ),
            Self::PoorPoses => {
                write!(
                    f,
                    "v_y is not measured, and the poses are too few, or contradict the speeds too much, to estimate it"
                )
            }
        }
    }
}

/// What the signals of a recording say of each other, and what became of them.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Recorded {
    /// Each signal against each other, and what nothing recorded checks.
    #[serde(flatten)]
    pub checks: Checks,
    /// Samples left out.
    pub bad_samples: Vec<BadSpan>,
    /// What was estimated of the motion.
    pub estimated: Option<EstimatedMotion>,
    /// How far what is fitted may be off by what the checks leave open.
    pub doubt: Doubt,
    /// Why nothing is fitted; empty where something is.
    pub objections: Vec<Objection>,
}

/// A recording made ready.
#[derive(Debug, Clone, PartialEq)]
pub struct Usable {
    /// What is fitted: bad samples left out, what is not measured filled in.
    pub sequence: StateSequence,
    /// What its signals say of each other.
    pub recorded: Recorded,
}

/// An accelerometer on a body that rolls, or is mounted askew, may read this much more than the motion takes; beyond it v_x or yaw rate is in doubt.
const ROLL: f64 = 0.08;

impl Usable {
    /// Looks at a sequence of a car.
    ///
    /// # Errors
    /// [`IdentificationError::Signal`] for a sequence that is malformed.
    pub fn of(sequence: &StateSequence, vehicle: &VehicleParameters) -> Result<Self, IdentificationError> {
        Self::mended(sequence, vehicle, true)
    }

    /// The same, but what is recorded stays, whatever contradicts it: for a diagnosis, which is to name that.
    ///
    /// # Errors
    /// As [`Self::of`].
    pub fn measured_or_estimated(
        sequence: &StateSequence,
        vehicle: &VehicleParameters,
    ) -> Result<Self, IdentificationError> {
        Self::mended(sequence, vehicle, false)
    }

    fn mended(
        sequence: &StateSequence,
        vehicle: &VehicleParameters,
        contradictions: bool,
    ) -> Result<Self, IdentificationError> {
        let clean = masked(sequence)?;
        let mut checks = cross_check(&clean.sequence)?;
        checks.checks.extend(steering_check(&clean.sequence, vehicle.wheelbase_m())?);
        if let Some(check) = contradictions.then(|| sharper(&clean.sequence, &checks)).flatten() {
            checks.checks.retain(|c| c.pair != check.pair);
            checks.checks.push(check);
        }
        let mut judge = Judge { sequence: &clean.sequence, checks: &checks, objections: Vec::new() };
        let mut wanted = judge.wanted();
        let mut objections = judge.objections;
        if !contradictions {
            wanted.retain(|(_, why)| *why == Why::NotMeasured);
            objections.retain(|o| !matches!(o, Objection::Contradiction(_)));
        }
        let mut usable = Self {
            recorded: Recorded { bad_samples: clean.bad, ..Recorded::default() },
            sequence: clean.sequence,
        };
        if objections.is_empty() && !wanted.is_empty() {
            match smooth(&source(&usable.sequence, &checks, &wanted)) {
                Ok(smoothed) => {
                    usable.recorded.estimated = Some(fill(&mut usable.sequence, &smoothed, &wanted));
                }
                Err(_) => objections.push(Objection::PoorPoses),
            }
        }
        let estimated = usable.recorded.estimated.as_ref().map_or(&[][..], |e| &e.channels);
        usable.recorded.doubt = Doubt::of(&checks, estimated);
        usable.recorded.checks = checks;
        usable.recorded.objections = objections;
        Ok(usable)
    }

    /// Standard deviation of v_y where it was estimated; zero where it was measured.
    pub(crate) fn v_y_sigma_mps(&self) -> f64 {
        let channels = self.recorded.estimated.iter().flat_map(|e| &e.channels);
        channels.filter(|c| c.channel == "v_y_mps").map(|c| c.sigma).fold(0.0, f64::max)
    }
}

/// Weighs the checks.
struct Judge<'a> {
    sequence: &'a StateSequence,
    checks: &'a Checks,
    objections: Vec<Objection>,
}

impl Judge<'_> {
    fn agrees(&self, pair: Pair) -> bool {
        self.checks.of(pair).is_some_and(|c| c.finding == Finding::Agrees)
    }

    fn disagrees(&self, pair: Pair) -> Option<Check> {
        self.checks.of(pair).copied().filter(|c| c.finding.disagrees())
    }

    fn object(&mut self, check: Check) {
        self.objections.push(Objection::Contradiction(check));
    }

    /// The channels to be estimated, and why; objections on the way.
    fn wanted(&mut self) -> Vec<(&'static str, Why)> {
        let s = self.sequence;
        // A pose that is counted together from the speeds says nothing more than they do.
        let dead_reckoning = is_dead_reckoning(s) || is_integral_of_twist(s);
        let localised = !dead_reckoning && !s.poses().time_s.is_empty();
        let mut wanted = Vec::new();
        self.speed(localised, &mut wanted);
        self.yaw_rate(localised, &mut wanted);
        // The curve's angle is made of the yaw rate: a yaw rate that is wrong says nothing of the steering.
        if let Some(check) = self.disagrees(Pair::SteeringAndCurvature).filter(|_| self.objections.is_empty())
        {
            self.object(check);
        }
        self.inertial();
        self.lateral_speed(localised, dead_reckoning, &mut wanted);
        wanted
    }

    fn speed(&mut self, localised: bool, wanted: &mut Vec<(&'static str, Why)>) {
        if localised && self.sequence.v_x_mps.iter().all(|&v| v == 0.0) {
            wanted.push(("v_x_mps", Why::NotMeasured));
        }
        let Some(check) = self.disagrees(Pair::SpeedAndPose) else { return };
        match check.finding {
            Finding::Scale { factor } => {
                wanted.push(("v_x_mps", Why::Contradicted { pair: check.pair, ratio: factor }));
            }
            _ => self.object(check),
        }
    }

    fn yaw_rate(&mut self, localised: bool, wanted: &mut Vec<(&'static str, Why)>) {
        if stands_still(self.sequence, &self.sequence.yaw_rate_radps) {
            if localised {
                wanted.push(("yaw_rate_radps", Why::NotMeasured));
            } else {
                self.objections.push(Objection::NoYawRate);
            }
            return;
        }
        if let Some(check) = self.disagrees(Pair::YawRateAndHeading) {
            match check.finding {
                Finding::Scale { factor } => {
                    wanted.push(("yaw_rate_radps", Why::Contradicted { pair: check.pair, ratio: factor }));
                }
                _ => self.object(check),
            }
            return;
        }
        // Without a heading: of yaw rate and gyroscope one is wrong, and what else is recorded may say which.
        let confirmed =
            self.agrees(Pair::YawRateAndHeading) || self.agrees(Pair::LateralAccelerationAndMotion);
        if let Some(check) = self.disagrees(Pair::YawRateAndGyro).filter(|_| !confirmed) {
            let steered = self.agrees(Pair::SteeringAndCurvature);
            if !(steered && matches!(check.finding, Finding::Sign | Finding::Unit { .. })) {
                self.object(check);
            }
        }
    }

    /// What an accelerometer says against v_x or yaw rate, where no pose stands up for them.
    fn inertial(&mut self) {
        let confirmed = self
            .checks
            .of(Pair::SpeedAndPose)
            .is_some_and(|c| c.finding != Finding::NotTold && c.finding != Finding::SameSource);
        let Some(check) = self.disagrees(Pair::LateralAccelerationAndMotion).filter(|_| !confirmed) else {
            return;
        };
        match check.finding {
            Finding::Unit { signal: "a_y", .. } | Finding::Sign => {}
            Finding::Scale { .. } if check.low < 1.0 + ROLL && check.high > 1.0 - ROLL => {}
            _ => self.object(check),
        }
    }

    fn lateral_speed(
        &mut self,
        localised: bool,
        dead_reckoning: bool,
        wanted: &mut Vec<(&'static str, Why)>,
    ) {
        if stands_still(self.sequence, &self.sequence.v_y_mps) {
            if localised {
                wanted.push(("v_y_mps", Why::NotMeasured));
            } else {
                self.objections.push(Objection::NoLateralSpeed { dead_reckoning });
            }
            return;
        }
        let by_pose = self.disagrees(Pair::LateralSpeedAndPose);
        let by_force = self.disagrees(Pair::LateralSpeedAndAcceleration);
        // What poses say has the accelerations in it. One that agrees with the poses and not with the accelerations was made of the poses, noise and all:
        // both together know better.
        let sound = localised && self.agrees(Pair::LateralAccelerationAndMotion);
        let by_force = by_force.filter(|_| sound || !self.agrees(Pair::LateralSpeedAndPose));
        let Some(check) = by_pose.or(by_force) else { return };
        match check.finding {
            Finding::NotMeasured { share } if localised => {
                wanted.push(("v_y_mps", Why::Contradicted { pair: check.pair, ratio: share }));
            }
            _ => self.object(check),
        }
    }
}

impl fmt::Display for EstimatedMotion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, channel) in self.channels.iter().enumerate() {
            let (name, unit) = match channel.channel {
                "v_x_mps" => ("v_x", "m/s"),
                "yaw_rate_radps" => ("yaw rate", "rad/s"),
                _ => ("v_y", "m/s"),
            };
            let why = match channel.why {
                Why::NotMeasured => "not measured".to_owned(),
                Why::Contradicted { pair: Pair::LateralSpeedAndAcceleration, ratio } => {
                    format!("its change is {ratio:.2} times what the accelerations leave for it")
                }
                Why::Contradicted { ratio, .. } => {
                    format!("recorded as {ratio:.2} times what the poses have")
                }
            };
            let then = if k == 0 { "" } else { "; " };
            write!(
                f,
                "{then}{name} ({why}) was estimated from poses, to {:.3} {unit}, without a tire model",
                channel.sigma
            )?;
        }
        if let Some(delay) = &self.pose_delay_s {
            write!(f, "; the poses are {:.3} s late", delay.value)?;
        }
        if !self.jumps_s.is_empty() {
            write!(f, "; the localisation jumped {} times", self.jumps_s.len())?;
        }
        Ok(())
    }
}
