//! The wheels turn more than the recording says.

use gripsight_vehicle::Real;

use super::{Effect, EffectSpec, Figure, OutsideTerm, Wheels, both_sides, spec};
use crate::site::Site;

/// The wheels turn more than the recording says.
#[derive(Debug)]
pub(super) struct SteeringGain;

impl Effect for SteeringGain {
    const SPEC: EffectSpec = EffectSpec {
        outside: Some(OutsideTerm::SteeringGain),
        figure: Some(Figure { name: "steering_scale", stated: |_| Some(1.0), value: |_, gain| 1.0 + gain }),
        spread: 0.12,
        ..spec(
            "steering_gain",
            "d = (1 + g) u",
            "steering ratio, servo scale",
            "low lateral acceleration over a range of speeds",
            &[Site::Steering],
            &[both_sides("gain", "1", [0.05, 0.05])],
        )
    };

    fn follow<T: Real>(p: &[T], _wheels: &mut Wheels<T>, steering_rad: T, _dt_s: f64) -> T {
        steering_rad * (p[0] + 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{DT_S, assert_absent_at_null, steering};
    use super::*;

    #[test]
    fn every_angle_is_larger_by_the_gain() {
        assert_absent_at_null::<SteeringGain>();
        let mut wheels = steering();
        SteeringGain::steer(&[0.25], &mut wheels, DT_S);
        assert!(wheels.iter().zip(&steering()).all(|(wheel, command)| *wheel == 1.25 * command));
    }
}
