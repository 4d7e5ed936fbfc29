//! Resistance of the rolling tires.

use gripsight_vehicle::{GRAVITY_MPS2, Real};

use super::common::COMMAND;
use super::{Effect, EffectId, EffectSpec, ParameterSpec, spec};
use crate::site::Site;
use crate::terms::{Car, Moment, Motion};

/// Resistance of the rolling tires.
#[derive(Debug)]
pub(super) struct RollingResistance;

impl Effect for RollingResistance {
    const SPEC: EffectSpec = EffectSpec {
        along: true,
        company: Some(EffectId::AeroDrag),
        alike: &[EffectId::AeroDrag],
        needs: COMMAND,
        ..spec(
            "rolling_resistance",
            "F_x -= c m g",
            "hysteresis of the rolling tire",
            "any drive",
            &[Site::DriveTrain],
            &[ParameterSpec { name: "c", unit: "1", null: 0.0, size: [0.03, 0.015], range: [0.0, 5.0] }],
        )
    };

    fn motion<T: Real>(p: &[T], _car: &Car<T>, _at: &Moment<T>, motion: &mut Motion<T>) {
        motion.force_x_mps2 -= p[0] * GRAVITY_MPS2;
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;

    #[test]
    fn it_slows_by_the_same_at_any_speed() {
        assert_absent_at_null::<RollingResistance>();
        let mut motion = Motion::none();
        RollingResistance::motion(&[0.03], &car(), &moment(), &mut motion);
        assert_eq!(motion.force_x_mps2, -0.03 * GRAVITY_MPS2);
    }
}
