//! Another mass than the file states.

use gripsight_vehicle::Real;

use super::common::{COMMAND, ratio};
use super::{Effect, EffectSpec, Figure, OutsideTerm, spec};
use crate::site::Site;
use crate::terms::Car;

/// Another mass than the file states.
#[derive(Debug)]
pub(super) struct MassError;

impl Effect for MassError {
    const SPEC: EffectSpec = EffectSpec {
        outside: Some(OutsideTerm::Mass),
        figure: Some(Figure {
            name: "mass_kg",
            stated: |car| Some(car.mass_kg),
            value: |car, ratio| car.mass_kg * ratio,
        }),
        along: true,
        needs: COMMAND,
        ..spec(
            "mass_error",
            "m *= ratio (loads follow)",
            "fuel, driver, ballast",
            "accelerating and braking with the command recorded",
            &[Site::LoadsAndBody],
            &[ratio(0.08)],
        )
    };

    fn car<T: Real>(p: &[T], car: &mut Car<T>) {
        car.mass_kg *= p[0];
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car};
    use super::*;

    #[test]
    fn the_car_is_heavier_and_the_command_still_speaks_of_the_stated_mass() {
        assert_absent_at_null::<MassError>();
        let mut heavier = car();
        MassError::car(&[1.25], &mut heavier);
        assert_eq!(heavier.mass_kg, 1.25 * car().mass_kg);
        assert_eq!(heavier.nominal_mass_kg, car().nominal_mass_kg);
        approx::assert_relative_eq!(
            heavier.axles_at_rest().front.load_n,
            1.25 * car().axles_at_rest().front.load_n,
            epsilon = 1e-9
        );
    }
}
