//! Grip that fades over the run.

use gripsight_vehicle::Real;

use super::common::scale;
use super::{Effect, EffectSpec, ParameterSpec, spec};
use crate::site::Site;
use crate::terms::{Axles, Car, Moment};

/// Grip that fades over the run.
#[derive(Debug)]
pub(super) struct TireWear;

impl Effect for TireWear {
    const SPEC: EffectSpec = EffectSpec {
        spread: 0.08,
        ..spec(
            "tire_wear",
            "D (1 - rate t)",
            "wear and heat of the tires over a run, to first order",
            "a long run near the limit",
            &[Site::FrontAxle, Site::RearAxle],
            &[ParameterSpec {
                name: "rate_per_min",
                unit: "1/min",
                null: 0.0,
                size: [0.06, 0.06],
                range: [-5.0, 10.0],
            }],
        )
    };

    fn grip<T: Real>(p: &[T], _car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        let factor = T::from(1.0) - p[0] * at.minutes;
        scale(axles, factor, factor);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;

    #[test]
    fn grip_fades_with_time() {
        assert_absent_at_null::<TireWear>();
        let mut axles = car().axles_at_rest();
        TireWear::grip(&[0.05], &car(), &Moment { minutes: 2.0, ..moment() }, &mut axles);
        approx::assert_relative_eq!(axles.front.grip, 0.9, epsilon = 1e-12);
        approx::assert_relative_eq!(axles.rear.grip, 0.9, epsilon = 1e-12);
    }
}
