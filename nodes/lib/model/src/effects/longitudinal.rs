//! Effects along the car. They show only where the longitudinal command is recorded.

use gripsight_vehicle::{GRAVITY_MPS2, Real};

use super::loads::COMMAND;
use super::{Effect, EffectId, EffectSpec, ParameterSpec, spec};
use crate::terms::{Car, Moment, Motion};

/// Drag of the air.
#[derive(Debug)]
pub(super) struct AeroDrag;

impl Effect for AeroDrag {
    const SPEC: EffectSpec = EffectSpec {
        alike: &[EffectId::RollingResistance],
        needs: COMMAND,
        ..spec(
            "aero_drag",
            "F_x -= c m v^2 (m nominal)",
            "drag of a bluff body",
            "top speed",
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

/// Resistance of the rolling tires.
#[derive(Debug)]
pub(super) struct RollingResistance;

impl Effect for RollingResistance {
    const SPEC: EffectSpec = EffectSpec {
        alike: &[EffectId::AeroDrag],
        needs: COMMAND,
        ..spec(
            "rolling_resistance",
            "F_x -= c m g",
            "hysteresis of the rolling tire",
            "any drive",
            &[ParameterSpec { name: "c", unit: "1", null: 0.0, size: [0.03, 0.015], range: [0.0, 5.0] }],
        )
    };

    fn motion<T: Real>(p: &[T], _car: &Car<T>, _at: &Moment<T>, motion: &mut Motion<T>) {
        motion.force_x_mps2 -= p[0] * GRAVITY_MPS2;
    }
}
