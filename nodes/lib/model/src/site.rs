//! The places of a car in which a cause can sit.

/// A place in which a cause can sit: what is answered first, before the mechanism there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Site {
    /// Between the recorded command or angle and the road wheels.
    Steering,
    /// Tires and suspension of the front axle.
    FrontAxle,
    /// Tires and suspension of the rear axle.
    RearAxle,
    /// Mass, inertia, centre of gravity, and what loads the axles.
    LoadsAndBody,
    /// Motor, brakes, differential, and what holds the car back along the road.
    DriveTrain,
    /// The recorded forward speed.
    Vx,
    /// The recorded lateral velocity.
    Vy,
    /// The recorded yaw rate.
    YawRate,
    /// The inertial unit's accelerations.
    Imu,
    /// The road's shape, and the air that moves over it.
    RoadAndWind,
}

impl Site {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Steering,
        Self::FrontAxle,
        Self::RearAxle,
        Self::LoadsAndBody,
        Self::DriveTrain,
        Self::Vx,
        Self::Vy,
        Self::YawRate,
        Self::Imu,
        Self::RoadAndWind,
    ];

    /// Canonical name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Steering => "steering",
            Self::FrontAxle => "front_axle",
            Self::RearAxle => "rear_axle",
            Self::LoadsAndBody => "loads_and_body",
            Self::DriveTrain => "drive_train",
            Self::Vx => "v_x",
            Self::Vy => "v_y",
            Self::YawRate => "yaw_rate",
            Self::Imu => "imu",
            Self::RoadAndWind => "road_and_wind",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::EffectId;

    #[test]
    fn every_site_has_an_effect_and_every_effect_a_site() {
        for site in Site::ALL {
            assert!(EffectId::ALL.iter().any(|e| e.spec().sites.contains(&site)), "{}", site.name());
        }
        assert!(EffectId::ALL.iter().all(|e| !e.spec().sites.is_empty()));
    }
}
