//! Other friction of the road than assumed.

use gripsight_vehicle::Real;

use super::common::scale;
use super::{Effect, EffectId, EffectSpec, Need, both_sides, spec};
use crate::site::Site;
use crate::terms::{Axles, Car, Moment};

/// Other friction of the road than assumed.
#[derive(Debug)]
pub(super) struct GripScale;

impl Effect for GripScale {
    const SPEC: EffectSpec = EffectSpec {
        alike: &[EffectId::GripBalance],
        needs: &[Need::ReferenceTires],
        ..spec(
            "grip_scale",
            "D_f, D_r *= 1 + m",
            "friction of the road",
            "above 80 % of the limit",
            &[Site::FrontAxle, Site::RearAxle],
            &[both_sides("m", "1", [0.1, 0.1])],
        )
    };

    fn grip<T: Real>(p: &[T], _car: &Car<T>, _at: &Moment<T>, axles: &mut Axles<T>) {
        scale(axles, p[0] + 1.0, p[0] + 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::super::common::LEAST_GRIP;
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;

    #[test]
    fn both_axles_have_more_or_less_grip_but_never_none() {
        assert_absent_at_null::<GripScale>();
        let grips = |m: f64| {
            let mut axles = car().axles_at_rest();
            GripScale::grip(&[m], &car(), &moment(), &mut axles);
            [axles.front.grip, axles.rear.grip]
        };
        assert_eq!(grips(-0.25), [0.75; 2]);
        assert_eq!(grips(-0.99), [LEAST_GRIP; 2]);
    }
}
