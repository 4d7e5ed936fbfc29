//! The wheels follow the command late.

use gripsight_vehicle::Real;

use super::{Effect, EffectId, EffectSpec, OutsideTerm, Wheels, positive, spec};
use crate::site::Site;
use crate::terms::delayed;

/// The wheels follow the command late.
#[derive(Debug)]
pub(super) struct SteeringDelay;

impl Effect for SteeringDelay {
    const SPEC: EffectSpec = EffectSpec {
        outside: Some(OutsideTerm::SteeringDelay),
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

    fn follow<T: Real>(p: &[T], wheels: &mut Wheels<T>, steering_rad: T, dt_s: f64) -> T {
        // Times are counted back from the newest angle.
        let past = &mut wheels.past;
        past.iter_mut().for_each(|(ago_s, _)| *ago_s += dt_s);
        past.push((0.0, steering_rad));
        let older = past.iter().rposition(|(ago_s, _)| *ago_s > p[0].re()).unwrap_or(0);
        past.drain(..older);
        match past[..] {
            [(before_s, before), (after_s, after), ..] if before_s > p[0].re() => {
                before + (after - before) * ((-p[0] + before_s) / (before_s - after_s))
            }
            _ => past[0].1,
        }
    }

    /// In a series the next angle is known too: a derivative by the delay exists even where there is none.
    fn steer<T: Real>(p: &[T], steering_rad: &mut [T], dt_s: f64) {
        let late = delayed(steering_rad, p[0], dt_s);
        steering_rad.copy_from_slice(&late);
    }

    fn transport_s(p: &[f64]) -> f64 {
        p[0]
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
