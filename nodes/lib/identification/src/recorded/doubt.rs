//! What the checks leave open.

use gripsight_signals::{Checks, Finding, Pair};
use serde::Serialize;

use super::EstimatedChannel;
use crate::Estimate;

/// How far the signals may be off though nothing recorded objects: standard deviations, as the checks leave them. What nothing checks is as uncertain
/// as such signals are known to be, and it is in every interval and in what a set promises.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Doubt {
    /// Of v_x over the true one.
    pub v_x_scale: f64,
    /// Of the yaw rate over the true one.
    pub yaw_rate_scale: f64,
    /// Of the share of the sideslip that v_y shows.
    pub v_y_slip_share: f64,
    /// Of the wheels' angle over the recorded one.
    pub steering_gain: f64,
}

impl Default for Doubt {
    fn default() -> Self {
        Self::UNCHECKED
    }
}

impl Doubt {
    /// Where nothing is recorded beside: a wheel's radius, a motor's gain or a gyroscope's may be off by a tenth, a v_y may be an observer's whose tires
    /// are half as stiff again, a servo's gain is known to a tenth.
    const UNCHECKED: Self =
        Self { v_x_scale: 0.06, yaw_rate_scale: 0.06, v_y_slip_share: 0.25, steering_gain: 0.06 };
    /// Of a channel that was estimated from poses.
    const ESTIMATED: f64 = 0.01;
    /// A body that rolls and pitches, and an accelerometer's own scale.
    const INERTIAL: f64 = 0.03;
    /// A gyroscope's own scale; beside another it may be the same one.
    const GYROSCOPE: f64 = 0.03;

    pub(super) fn of(checks: &Checks, estimated: &[EstimatedChannel]) -> Self {
        let was_estimated = |name: &str| estimated.iter().any(|c| c.channel == name);
        let told = |pair: Pair| {
            let check = checks.of(pair).filter(|c| {
                !matches!(
                    c.finding,
                    Finding::NotTold | Finding::SameSource | Finding::Sign | Finding::Unit { .. }
                )
            })?;
            Some((check.ratio - 1.0).hypot((check.high - check.low) / (2.0 * Estimate::Z90)))
        };
        let turning = told(Pair::LateralAccelerationAndMotion).map(|s| s.hypot(Self::INERTIAL));
        let heading = told(Pair::YawRateAndHeading);
        let gyro = told(Pair::YawRateAndGyro).map(|s| s.hypot(Self::GYROSCOPE));
        let pose = told(Pair::SpeedAndPose);
        let forward = told(Pair::ForwardAccelerationAndMotion).map(|s| s.hypot(Self::INERTIAL));
        let least =
            |known: &[Option<f64>], unchecked: f64| known.iter().flatten().copied().fold(unchecked, f64::min);
        let Self { v_x_scale, yaw_rate_scale, v_y_slip_share, steering_gain } = Self::UNCHECKED;
        // What the accelerometer tells is the product of both.
        let beside = |other: f64| turning.map(|s| s.hypot(other));
        let slow = least(&[pose, forward], v_x_scale);
        let turned = least(&[heading, gyro], yaw_rate_scale);
        let slip = [Pair::LateralSpeedAndPose, Pair::LateralSpeedAndAcceleration].map(told);
        let channel = |name: &str, doubt: f64| if was_estimated(name) { Self::ESTIMATED } else { doubt };
        let measured = told(Pair::MeasuredAndCommandedSteering).map(|s| s.hypot(0.5 * steering_gain));
        Self {
            v_x_scale: channel("v_x_mps", slow.min(beside(turned).unwrap_or(slow))),
            yaw_rate_scale: channel("yaw_rate_radps", turned.min(beside(slow).unwrap_or(turned))),
            v_y_slip_share: channel("v_y_mps", least(&slip, v_y_slip_share)),
            steering_gain: least(&[measured], steering_gain),
        }
    }
}
