//! Grip lost to the load that moves to the outer wheels.

use gripsight_vehicle::Real;

use super::common::scale;
use super::{Effect, EffectSpec, OutsideTerm, ParameterSpec, spec};
use crate::site::Site;
use crate::terms::{Axles, Car, Moment};

/// Grip lost to the load that moves to the outer wheels.
#[derive(Debug)]
pub(super) struct LateralLoadTransfer;

impl Effect for LateralLoadTransfer {
    const SPEC: EffectSpec = EffectSpec {
        outside: Some(OutsideTerm::LateralLoadTransfer),
        usual: Some(|_, size| 0.27 * size),
        spread: 0.08,
        ..spec(
            "lateral_load_transfer",
            "D (1 - k (a_y/a_max)^2), a_max what the tires give with their loads",
            "load sensitivity of the tire's friction; Milliken, Race Car Vehicle Dynamics, section 2.4",
            "lateral acceleration from 0.3 to 1.0 of the limit",
            &[Site::FrontAxle, Site::RearAxle],
            &[ParameterSpec { name: "k", unit: "1", null: 0.0, size: [0.15, 0.15], range: [-1.0, 5.0] }],
        )
    };

    fn grip<T: Real>(p: &[T], car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        let share = at.a_y_mps2 / car.largest_a_y_mps2(axles);
        let factor = T::from(1.0) - p[0] * share * share;
        scale(axles, factor, factor);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;

    #[test]
    fn grip_falls_with_the_square_of_the_share_of_the_limit() {
        assert_absent_at_null::<LateralLoadTransfer>();
        let (car, at) = (car(), moment());
        let mut axles = car.axles_at_rest();
        let share = at.a_y_mps2 / car.largest_a_y_mps2(&axles);
        LateralLoadTransfer::grip(&[0.2], &car, &at, &mut axles);
        for axle in [axles.front, axles.rear] {
            approx::assert_relative_eq!(axle.grip, 1.0 - 0.2 * share * share, epsilon = 1e-12);
        }
    }
}
