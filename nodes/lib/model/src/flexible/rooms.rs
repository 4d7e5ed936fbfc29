//! Sites taken together: the five rooms by which the diagnosis tells what is left.

use super::blocks::Block;
use crate::effects::EffectId;

/// Where a cause can sit, roughly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Room {
    /// Between the command and the road wheels: a free impulse response of 0.2 s, curvature, friction.
    Steering,
    /// Between the motion and the recorded signals: each signal late, scaled, with shares of the yaw motion.
    Sensors,
    /// Lateral forces over slips, speed and longitudinal acceleration, and their memory.
    Forces,
    /// Longitudinal force over speed and command, and a free impulse response of the command.
    Drive,
    /// From outside: by the place on the lap, and by the heading (wind).
    Outside,
}

impl Room {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Steering, Self::Sensors, Self::Forces, Self::Drive, Self::Outside];

    /// In the result.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Steering => "steering",
            Self::Sensors => "sensors",
            Self::Forces => "lateral_forces",
            Self::Drive => "longitudinal_forces",
            Self::Outside => "road_and_wind",
        }
    }

    /// Its terms, in the order of their parameters.
    pub(super) const fn blocks(self) -> &'static [Block] {
        match self {
            Self::Steering => &[Block::Steering],
            Self::Sensors => &[Block::LateralVelocity, Block::YawRate, Block::LateralAcceleration],
            Self::Forces => &[Block::FrontForce, Block::RearForce, Block::Moment],
            Self::Drive => &[Block::Drive],
            Self::Outside => &[Block::Outside],
        }
    }
}

impl EffectId {
    /// Where it sits: whose free terms can do what it does.
    #[must_use]
    pub fn room(self) -> Room {
        match self {
            Self::SteeringLag
            | Self::SteeringDelay
            | Self::SteeringGain
            | Self::SteeringOffset
            | Self::SteeringBacklash
            | Self::SteeringRateLimit
            | Self::ComplianceSteer => Room::Steering,
            Self::VyLeverArm
            | Self::VyBias
            | Self::OdometryDelay
            | Self::OdometryLowPass
            | Self::VxScale
            | Self::ImuLeverArm
            | Self::ImuTilt
            | Self::GyroScale
            | Self::GyroBias => Room::Sensors,
            Self::AeroDrag | Self::RollingResistance | Self::MassError => Room::Drive,
            Self::LowGripPatch | Self::RoadBank | Self::RoadSlope => Room::Outside,
            _ => Room::Forces,
        }
    }
}
