//! Drag of the air.

use gripsight_vehicle::Real;

use super::common::COMMAND;
use super::{Effect, EffectId, EffectSpec, OutsideTerm, ParameterSpec, spec};
use crate::site::Site;
use crate::terms::{Car, Moment, Motion};

/// Drag of the air.
#[derive(Debug)]
pub(super) struct AeroDrag;

impl Effect for AeroDrag {
    const SPEC: EffectSpec = EffectSpec {
        outside: Some(OutsideTerm::Drag),
        along: true,
        company: Some(EffectId::RollingResistance),
        alike: &[EffectId::RollingResistance],
        needs: COMMAND,
        ..spec(
            "aero_drag",
            "F_x -= c m v^2 (m nominal)",
            "drag of a bluff body",
            "top speed",
            &[Site::DriveTrain],
            &[ParameterSpec { name: "c_1pm", unit: "1/m", null: 0.0, size: [8e-3, 8e-4], range: [0.0, 5.0] }],
        )
    };

    fn car<T: Real>(p: &[T], car: &mut Car<T>) {
        car.drag_1pm = p[0];
    }

    fn motion<T: Real>(p: &[T], car: &Car<T>, at: &Moment<T>, motion: &mut Motion<T>) {
        motion.force_x_mps2 -= p[0] * at.v_x_mps * at.v_x_mps * car.nominal_mass_kg / car.mass_kg;
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;

    #[test]
    fn it_slows_with_the_square_of_the_speed() {
        assert_absent_at_null::<AeroDrag>();
        let (mut car, at) = (car(), moment());
        let mut motion = Motion::none();
        AeroDrag::car(&[8e-3], &mut car);
        AeroDrag::motion(&[8e-3], &car, &at, &mut motion);
        assert_eq!(car.drag_1pm, 8e-3);
        approx::assert_relative_eq!(motion.force_x_mps2, -8e-3 * at.v_x_mps * at.v_x_mps, epsilon = 1e-12);
    }
}
