//! Which terms there are, and at which site.

use crate::recording::Channel;
use crate::site::Site;

/// Lags of the steering's free impulse response.
pub(super) const STEERING_LAGS_S: [f64; 8] = [0.0, 0.02, 0.04, 0.06, 0.09, 0.12, 0.16, 0.21];
/// Lags of a signal's free impulse response.
pub(super) const SENSOR_LAGS_S: [f64; 3] = [0.02, 0.05, 0.1];
/// Signals that have terms of their own.
pub(super) const SENSED: [(Block, Channel); 3] = [
    (Block::LateralVelocity, Channel::LateralVelocity),
    (Block::YawRate, Channel::YawRate),
    (Block::LateralAcceleration, Channel::LateralAcceleration),
];
/// Lags of the longitudinal command's free impulse response.
pub(super) const DRIVE_LAGS_S: [f64; 4] = [0.0, 0.05, 0.12, 0.25];
/// Harmonics of the lap.
pub(super) const HARMONICS: usize = 2;

/// Terms that go together: one call computes them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Block {
    /// A free impulse response of 0.2 s, an offset, curvature, friction.
    Steering,
    /// Lateral force of an axle over slip, speed and longitudinal acceleration, and its memory.
    FrontForce,
    RearForce,
    /// Grip of an axle over longitudinal acceleration, time and place.
    FrontGrip,
    RearGrip,
    /// Yaw moment over the turn, the longitudinal acceleration and the speed.
    Moment,
    /// Load that moves along the car or comes with the speed, and moments without a force.
    Loads,
    /// What the command does more or less.
    Mass,
    /// Longitudinal force over speed and command, and a free impulse response of the command.
    Drive,
    /// Yaw moment over the curvature, under and off power.
    Differential,
    /// The true forward speed over the recorded one: a scale, with the speed, and late.
    Speed,
    /// A signal late, scaled, off, with shares of the yaw motion.
    LateralVelocity,
    YawRate,
    LateralAcceleration,
    /// The longitudinal acceleration with shares of the yaw motion.
    LongitudinalAcceleration,
    /// By the place on the lap, and by the heading (wind).
    Outside,
}

impl Block {
    /// How many parameters it has.
    pub(super) const fn terms(self) -> usize {
        match self {
            Self::Steering => STEERING_LAGS_S.len() + 5,
            Self::FrontForce | Self::RearForce => 8,
            Self::FrontGrip | Self::RearGrip => 3 + 2 * HARMONICS,
            Self::Moment | Self::Speed | Self::LongitudinalAcceleration => 3,
            Self::Loads => 6,
            Self::Mass => 1,
            Self::Drive => DRIVE_LAGS_S.len() + 5,
            Self::Differential => 2,
            Self::LateralVelocity | Self::YawRate | Self::LateralAcceleration => SENSOR_LAGS_S.len() + 4,
            Self::Outside => 4 * HARMONICS + 8,
        }
    }

    /// Whether it adds to forces and moments of the tires.
    pub(super) const fn is_of_the_tires(self) -> bool {
        matches!(
            self,
            Self::FrontForce
                | Self::RearForce
                | Self::FrontGrip
                | Self::RearGrip
                | Self::Moment
                | Self::Loads
                | Self::Differential
        )
    }
}

/// The terms of a site.
pub(super) const fn of_site(site: Site) -> &'static [Block] {
    match site {
        Site::Steering => &[Block::Steering],
        Site::FrontAxle => &[Block::FrontForce, Block::FrontGrip],
        Site::RearAxle => &[Block::RearForce, Block::RearGrip],
        Site::LoadsAndBody => &[Block::Moment, Block::Loads, Block::Mass],
        Site::DriveTrain => &[Block::Drive, Block::Differential],
        Site::Vx => &[Block::Speed],
        Site::Vy => &[Block::LateralVelocity],
        Site::YawRate => &[Block::YawRate],
        Site::Imu => &[Block::LateralAcceleration, Block::LongitudinalAcceleration],
        Site::RoadAndWind => &[Block::Outside],
    }
}
