//! The steering is not faster than a rate. Fitted as its inverse, so that "no limit" is 0.

use gripsight_vehicle::Real;

use super::{Effect, EffectSpec, OutsideTerm, ParameterSpec, Reported, Wheels, spec};
use crate::site::Site;

/// The limit of an inverse rate: infinite, in files `null`, where there is none.
fn rate_radps(s_per_rad: f64) -> f64 {
    if s_per_rad > 1e-6 { 1.0 / s_per_rad } else { f64::INFINITY }
}

/// The steering is not faster than a rate. Fitted as its inverse, so that "no limit" is 0.
#[derive(Debug)]
pub(super) struct SteeringRateLimit;

impl Effect for SteeringRateLimit {
    const SPEC: EffectSpec = EffectSpec {
        outside: Some(OutsideTerm::SteeringRateLimit),
        reported: &[Reported { name: "rate_radps", unit: "rad/s", value: |p| rate_radps(p[0]) }],
        starts: &[1.0, 2.0, 3.5],
        flat_at_null: true,
        ..spec(
            "steering_rate_limit",
            "abs(d') <= rate",
            "slew rate of the servo or the power steering",
            "fast steering",
            &[Site::Steering],
            &[ParameterSpec {
                name: "s_per_rad",
                unit: "s/rad",
                null: 0.0,
                size: [0.4, 2.0],
                range: [0.0, 6.0],
            }],
        )
    };

    fn follow<T: Real>(p: &[T], wheels: &mut Wheels<T>, steering_rad: T, dt_s: f64) -> T {
        if p[0].re() < 1e-9 {
            return steering_rad;
        }
        let most = p[0].recip() * dt_s;
        let wheel = wheels.kept.get_or_insert([steering_rad; 8]);
        let way = steering_rad - wheel[0];
        wheel[0] = if way.re() > most.re() {
            wheel[0] + most
        } else if way.re() < -most.re() {
            wheel[0] - most
        } else {
            steering_rad
        };
        wheel[0]
    }

    /// The wheels go after a jump from the step's start on: in the middle of the step they have made half a step's way.
    fn steer_held<T: Real>(p: &[T], steering_rad: &mut [T], dt_s: f64) {
        let mut wheels = Wheels::default();
        for angle in steering_rad {
            let [middle, _] = [(); 2].map(|()| Self::follow(p, &mut wheels, *angle, 0.5 * dt_s));
            *angle = middle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::assert_absent_at_null;
    use super::*;

    #[test]
    fn a_step_becomes_a_ramp_and_no_limit_is_no_number() {
        assert_absent_at_null::<SteeringRateLimit>();
        let mut wheels = [0.0, 0.05, 0.05, 0.05, 0.05];
        SteeringRateLimit::steer(&[0.5], &mut wheels, 0.01);
        for (wheel, expected) in wheels.iter().zip(&[0.0, 0.02, 0.04, 0.05, 0.05]) {
            approx::assert_relative_eq!(wheel, expected, epsilon = 1e-12);
        }
        let mut wheels = [0.0, 0.05, 0.05, 0.05, 0.05];
        SteeringRateLimit::steer_held(&[0.5], &mut wheels, 0.01);
        for (wheel, expected) in wheels.iter().zip(&[0.0, 0.01, 0.03, 0.05, 0.05]) {
            approx::assert_relative_eq!(wheel, expected, epsilon = 1e-12);
        }
        let stated = SteeringRateLimit::SPEC.reported[0].value;
        assert_eq!(stated(&[0.0]), f64::INFINITY);
        assert_eq!(stated(&[2.0]), 0.5);
    }
}
