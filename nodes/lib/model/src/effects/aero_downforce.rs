//! Load from the air.

use gripsight_vehicle::{GRAVITY_MPS2, Real};

use super::common::{LOAD_SENSITIVITY_SHARE, add_load};
use super::{Effect, EffectSpec, ParameterSpec, Unknown, spec};
use crate::site::Site;
use crate::terms::{Axles, Car, Moment};

/// Load from the air.
#[derive(Debug)]
pub(super) struct AeroDownforce;

impl Effect for AeroDownforce {
    const SPEC: EffectSpec = EffectSpec {
        unknown: Unknown { share: LOAD_SENSITIVITY_SHARE, samples: 0.0 },
        ..spec(
            "aero_downforce",
            "F_zf += c_f m g v^2, F_zr += c_r m g v^2",
            "wings and floor",
            "a speed range over two at high lateral acceleration",
            &[Site::LoadsAndBody],
            &[
                ParameterSpec {
                    name: "c_f",
                    unit: "s2/m2",
                    null: 0.0,
                    size: [1e-3, 6e-5],
                    range: [-1.0, 6.0],
                },
                ParameterSpec {
                    name: "c_r",
                    unit: "s2/m2",
                    null: 0.0,
                    size: [1e-3, 6e-5],
                    range: [-1.0, 6.0],
                },
            ],
        )
    };

    fn loads<T: Real>(p: &[T], car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        let weight_v2 = car.mass_kg * GRAVITY_MPS2 * at.v_x_mps * at.v_x_mps;
        add_load(car, axles, p[0] * weight_v2, p[1] * weight_v2);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;

    #[test]
    fn loads_grow_with_the_square_of_the_speed() {
        assert_absent_at_null::<AeroDownforce>();
        let (car, at) = (car(), moment());
        let mut axles = car.axles_at_rest();
        AeroDownforce::loads(&[1e-3, 2e-3], &car, &at, &mut axles);
        let unit_n = car.mass_kg * GRAVITY_MPS2 * at.v_x_mps * at.v_x_mps;
        let rest = car.axles_at_rest();
        approx::assert_relative_eq!(axles.front.load_n, rest.front.load_n + 1e-3 * unit_n, epsilon = 1e-9);
        approx::assert_relative_eq!(axles.rear.load_n, rest.rear.load_n + 2e-3 * unit_n, epsilon = 1e-9);
    }
}
