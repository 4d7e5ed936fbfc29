//! The centre of gravity lies further ahead; the sensors stay.

use gripsight_vehicle::Real;

use super::{Effect, EffectSpec, Figure, OutsideTerm, ParameterSpec, both_sides, spec};
use crate::site::Site;
use crate::terms::Car;

/// The centre of gravity lies further ahead; the sensors stay.
#[derive(Debug)]
pub(super) struct CogShift;

impl Effect for CogShift {
    const SPEC: EffectSpec = EffectSpec {
        outside: Some(OutsideTerm::AxleDistances),
        figure: Some(Figure {
            name: "l_f_m",
            stated: |car| Some(car.l_f_m),
            value: |car, shift_m| car.l_f_m - shift_m,
        }),
        spread: 1.00,
        ..spec(
            "cog_shift",
            "l_f -= dl, l_r += dl, static loads follow; v_y is still measured at the nominal point",
            "fuel, ballast, corner weights not taken",
            "medium and high lateral acceleration, transients",
            &[Site::LoadsAndBody],
            // Further than a twelfth of the wheelbase nobody misplaces it.
            &[ParameterSpec { range: [-2.5, 2.5], ..both_sides("dl_m", "m", [0.01, 0.08]) }],
        )
    };

    fn car<T: Real>(p: &[T], car: &mut Car<T>) {
        car.l_f_m -= p[0];
        car.l_r_m += p[0];
        car.cog_shift_m += p[0];
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car};
    use super::*;
    use gripsight_vehicle::GRAVITY_MPS2;

    #[test]
    fn load_moves_with_the_centre_of_gravity() {
        assert_absent_at_null::<CogShift>();
        let mut shifted = car();
        CogShift::car(&[0.01], &mut shifted);
        approx::assert_relative_eq!(shifted.wheelbase_m(), car().wheelbase_m(), epsilon = 1e-12);
        assert_eq!(shifted.cog_shift_m, 0.01);
        let weight_n = shifted.mass_kg * GRAVITY_MPS2;
        let more_n = shifted.axles_at_rest().front.load_n - car().axles_at_rest().front.load_n;
        approx::assert_relative_eq!(more_n, weight_n * 0.01 / car().wheelbase_m(), epsilon = 1e-9);
    }
}
