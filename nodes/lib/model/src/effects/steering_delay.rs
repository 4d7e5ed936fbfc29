//! The wheels follow the command late.

use gripsight_vehicle::Real;

use super::{Effect, EffectId, EffectSpec, positive, spec};
use crate::site::Site;
use crate::terms::delayed;

/// The wheels follow the command late.
#[derive(Debug)]
pub(super) struct SteeringDelay;

impl Effect for SteeringDelay {
    const SPEC: EffectSpec = EffectSpec {
        of_a_command: true,
        alike: &[EffectId::SteeringLag, EffectId::TireRelaxation],
        starts: &[0.5, 1.5],
        ..spec(
            "steering_delay",
            "d(t) = u(t - T)",
            "transport time of command and servo",
            "steering up to 3 Hz",
            &[Site::Steering],
            &[positive("delay_s", "s", [0.05, 0.05])],
        )
    };

    fn steer<T: Real>(p: &[T], steering_rad: &mut [T], dt_s: f64) {
        let late = delayed(steering_rad, p[0], dt_s);
        steering_rad.copy_from_slice(&late);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{DT_S, assert_absent_at_null, steering};
    use super::*;

    #[test]
    fn the_wheels_are_where_the_command_was() {
        assert_absent_at_null::<SteeringDelay>();
        let mut wheels = steering();
        SteeringDelay::steer(&[3.0 * DT_S], &mut wheels, DT_S);
        for (late, command) in wheels[3..].iter().zip(&steering()) {
            approx::assert_relative_eq!(late, command, epsilon = 1e-9);
        }
    }
}
