//! Grip moved from the rear to the front axle.

use gripsight_vehicle::Real;

use super::common::scale;
use super::{Effect, EffectId, EffectSpec, Need, both_sides, spec};
use crate::site::Site;
use crate::terms::{Axles, Car, Moment};

/// Grip moved from the rear to the front axle.
#[derive(Debug)]
pub(super) struct GripBalance;

impl Effect for GripBalance {
    const SPEC: EffectSpec = EffectSpec {
        alike: &[EffectId::GripScale],
        needs: &[Need::ReferenceTires],
        ..spec(
            "grip_balance",
            "D_f *= 1 + b, D_r *= 1 - b",
            "tire temperature, pressure or set-up that differs by axle",
            "at the limit",
            &[Site::FrontAxle, Site::RearAxle],
            &[both_sides("b", "1", [0.05, 0.05])],
        )
    };

    fn grip<T: Real>(p: &[T], _car: &Car<T>, _at: &Moment<T>, axles: &mut Axles<T>) {
        scale(axles, p[0] + 1.0, -p[0] + 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;

    #[test]
    fn what_the_front_gains_the_rear_loses() {
        assert_absent_at_null::<GripBalance>();
        let mut axles = car().axles_at_rest();
        GripBalance::grip(&[0.25], &car(), &moment(), &mut axles);
        assert_eq!([axles.front.grip, axles.rear.grip], [1.25, 0.75]);
    }
}
