//! The rear wheels steer as the body rolls.

use gripsight_vehicle::Real;

use super::common::PER_G;
use super::{Effect, EffectSpec, Lagging, ParameterSpec, both_sides, spec};
use crate::site::Site;
use crate::terms::{Axles, Car, Moment, ROLL_TIME_S};

/// The rear wheels steer as the body rolls.
#[derive(Debug)]
pub(super) struct RollSteer;

impl Effect for RollSteer {
    const SPEC: EffectSpec = EffectSpec {
        lagging: &[Lagging::Roll],
        sizing: 1,
        spread: 0.02,
        ..spec(
            "roll_steer",
            "d_r = k a_y/g behind the roll of the body, which follows in a time T",
            "kinematics of the rear suspension; Milliken, Race Car Vehicle Dynamics, chapter 23",
            "medium lateral acceleration, transients",
            &[Site::RearAxle],
            &[
                both_sides("rad_per_g", "rad/g", [0.008, 0.004]),
                ParameterSpec {
                    name: "roll_time_s",
                    unit: "s",
                    null: ROLL_TIME_S,
                    size: [0.02, 0.02],
                    range: [-2.0, 5.0],
                },
            ],
        )
    };

    fn car<T: Real>(p: &[T], car: &mut Car<T>) {
        car.roll_time_s = p[1];
    }

    fn loads<T: Real>(p: &[T], _car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        axles.rear.steer_rad += p[0] * at.rolled_a_y_mps2 * PER_G;
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;
    use gripsight_vehicle::GRAVITY_MPS2;

    #[test]
    fn the_rear_wheels_steer_with_the_roll() {
        assert_absent_at_null::<RollSteer>();
        let mut axles = car().axles_at_rest();
        let at = Moment { rolled_a_y_mps2: 0.5 * GRAVITY_MPS2, ..moment() };
        RollSteer::loads(&[0.02, 0.05], &car(), &at, &mut axles);
        assert_eq!(axles.front.steer_rad, 0.0);
        approx::assert_relative_eq!(axles.rear.steer_rad, 0.01, epsilon = 1e-12);
    }
}
