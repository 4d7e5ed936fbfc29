//! Play in the steering.

use gripsight_vehicle::Real;

use super::{Effect, EffectId, EffectSpec, Wheels, positive, spec};
use crate::site::Site;

/// Play in the steering.
#[derive(Debug)]
pub(super) struct SteeringBacklash;

impl Effect for SteeringBacklash {
    const SPEC: EffectSpec = EffectSpec {
        alike: &[EffectId::SteeringLag],
        starts: &[0.6, 1.8],
        ..spec(
            "steering_backlash",
            "d stays while abs(u - d) is below the half width, then is dragged along",
            "play operator",
            "small reversals",
            &[Site::Steering],
            &[positive("half_width_rad", "rad", [0.008, 0.003])],
        )
    };

    fn follow<T: Real>(p: &[T], wheels: &mut Wheels<T>, steering_rad: T, _dt_s: f64) -> T {
        let wheel = wheels.kept.get_or_insert([steering_rad; 8]);
        let (low, high) = (steering_rad - p[0], steering_rad + p[0]);
        if wheel[0].re() < low.re() {
            wheel[0] = low;
        } else if wheel[0].re() > high.re() {
            wheel[0] = high;
        }
        wheel[0]
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{DT_S, assert_absent_at_null};
    use super::*;

    #[test]
    fn the_wheels_stay_until_the_play_is_used_up() {
        assert_absent_at_null::<SteeringBacklash>();
        let mut wheels = [0.0, 0.01, 0.03, 0.02, 0.0, -0.01];
        SteeringBacklash::steer(&[0.01], &mut wheels, DT_S);
        let expected = [0.0, 0.0, 0.02, 0.02, 0.01, 0.0];
        for (wheel, expected) in wheels.iter().zip(&expected) {
            approx::assert_relative_eq!(wheel, expected, epsilon = 1e-12);
        }
    }
}
