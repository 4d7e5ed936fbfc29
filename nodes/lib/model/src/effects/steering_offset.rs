//! The wheels are not straight when the recording says so.

use gripsight_vehicle::Real;

use super::{Effect, EffectSpec, OutsideTerm, Wheels, both_sides, spec};
use crate::site::Site;

/// The wheels are not straight when the recording says so.
#[derive(Debug)]
pub(super) struct SteeringOffset;

impl Effect for SteeringOffset {
    const SPEC: EffectSpec = EffectSpec {
        outside: Some(OutsideTerm::SteeringOffset),
        ..spec(
            "steering_offset",
            "d = u + d0",
            "steering centre, alignment",
            "straights, both turn directions",
            &[Site::Steering],
            &[both_sides("offset_rad", "rad", [0.01, 0.005])],
        )
    };

    fn follow<T: Real>(p: &[T], _wheels: &mut Wheels<T>, steering_rad: T, _dt_s: f64) -> T {
        steering_rad + p[0]
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{DT_S, assert_absent_at_null, steering};
    use super::*;

    #[test]
    fn every_angle_is_off_by_the_same() {
        assert_absent_at_null::<SteeringOffset>();
        let mut wheels = steering();
        SteeringOffset::steer(&[0.01], &mut wheels, DT_S);
        assert!(wheels.iter().zip(&steering()).all(|(wheel, command)| *wheel == command + 0.01));
    }
}
