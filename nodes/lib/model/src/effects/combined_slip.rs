//! A force along the tire takes from the force across it. Fitted as q = k^2, so that it can be seen from zero.

use gripsight_vehicle::Real;

use super::{Effect, EffectSpec, Reported, positive, spec};
use crate::site::Site;
use crate::terms::{Axles, Car, Moment};

/// A force along the tire takes from the force across it. Fitted as q = k^2, so that it can be seen from zero.
#[derive(Debug)]
pub(super) struct CombinedSlip;

/// Smallest square of the share that is left across.
const LEAST_SQUARE: f64 = 0.01;

impl Effect for CombinedSlip {
    const SPEC: EffectSpec = EffectSpec {
        usual: Some(|_, size| 0.14 * size),
        reported: &[Reported { name: "k", unit: "1", value: |p| p[0].max(0.0).sqrt() }],
        starts: &[0.7],
        spread: 0.07,
        ..spec(
            "combined_slip",
            "F_y *= sqrt(max(0, 1 - (k F_x/(mu F_z))^2)) per axle",
            "friction ellipse; Pacejka, Tire and Vehicle Dynamics, 3rd ed., section 3.3",
            "braking and driving above 0.4 mu g with slip",
            &[Site::FrontAxle, Site::RearAxle],
            &[positive("k_squared", "1", [0.7, 0.7])],
        )
    };

    fn grip<T: Real>(p: &[T], car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        let front = car.front_share(at.force_x_mps2 > 0.0);
        for (axle, share, peak) in
            [(&mut axles.front, front, car.peak[0]), (&mut axles.rear, T::from(1.0) - front, car.peak[1])]
        {
            let use_x =
                (peak * axle.grip * axle.load_n).recip() * share * (at.force_x_mps2 * car.nominal_mass_kg);
            let square = T::from(1.0) - p[0] * use_x * use_x;
            axle.usable *=
                if square.re() < LEAST_SQUARE { T::from(LEAST_SQUARE.sqrt()) } else { square.sqrt() };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;

    #[test]
    fn braking_takes_from_the_side_force_along_an_ellipse() {
        assert_absent_at_null::<CombinedSlip>();
        let (car, at) = (car(), moment());
        let mut axles = car.axles_at_rest();
        let at = Moment { force_x_mps2: -4.0, ..at };
        CombinedSlip::grip(&[0.49], &car, &at, &mut axles);
        let force_n = 4.0 * car.nominal_mass_kg * (1.0 - car.brake_front_share);
        let used = 0.7 * force_n / (car.peak[1] * axles.rear.load_n);
        approx::assert_relative_eq!(axles.rear.usable, (1.0 - used * used).sqrt(), epsilon = 1e-12);
        assert_eq!((CombinedSlip::SPEC.reported[0].value)(&[0.49]), 0.7);
    }
}
