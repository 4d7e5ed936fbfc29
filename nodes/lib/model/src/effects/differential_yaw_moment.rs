//! A differential that resists the speed difference of its wheels.

use gripsight_vehicle::{GRAVITY_MPS2, Real};

use super::common::COMMAND;
use super::{Effect, EffectSpec, both_sides, spec};
use crate::site::Site;
use crate::terms::{Car, Moment, Motion};

/// A differential that resists the speed difference of its wheels.
#[derive(Debug)]
pub(super) struct DifferentialYawMoment;

/// Share of the moment that is left off power.
const OFF_POWER: f64 = 0.5;

impl Effect for DifferentialYawMoment {
    const SPEC: EffectSpec = EffectSpec {
        needs: COMMAND,
        spread: 0.29,
        ..spec(
            "differential_yaw_moment",
            "M_z = -k m g L tanh(r L/v) under power, half of it off power",
            "limited-slip differential; Milliken, Race Car Vehicle Dynamics, chapter 20",
            "throttle on and off in one corner",
            &[Site::DriveTrain],
            &[both_sides("k", "1", [0.03, 0.03])],
        )
    };

    fn motion<T: Real>(p: &[T], car: &Car<T>, at: &Moment<T>, motion: &mut Motion<T>) {
        let length_m = car.wheelbase_m();
        let share = if at.force_x_mps2 > 0.0 { 1.0 } else { OFF_POWER };
        let turn = (at.yaw_rate_radps * length_m / at.v_x_mps).tanh();
        motion.yaw_radps2 -=
            p[0] * car.mass_kg * (GRAVITY_MPS2 * share) * length_m * turn / car.turned_kgm2();
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;

    #[test]
    fn it_resists_the_turn_half_as_much_off_power() {
        assert_absent_at_null::<DifferentialYawMoment>();
        let (car, at) = (car(), moment());
        let yaw_radps2 = |force_x_mps2: f64| {
            let mut motion = Motion::none();
            DifferentialYawMoment::motion(&[0.05], &car, &Moment { force_x_mps2, ..at }, &mut motion);
            motion.yaw_radps2
        };
        let turn = (at.yaw_rate_radps * car.wheelbase_m() / at.v_x_mps).tanh();
        let moment_nm = 0.05 * car.mass_kg * GRAVITY_MPS2 * car.wheelbase_m() * turn;
        approx::assert_relative_eq!(yaw_radps2(1.0), -moment_nm / car.turned_kgm2(), epsilon = 1e-9);
        approx::assert_relative_eq!(yaw_radps2(-1.0), 0.5 * yaw_radps2(1.0), epsilon = 1e-9);
    }
}
