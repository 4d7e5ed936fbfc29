//! Effects on the grip: they act on D at constant cornering stiffness.

use gripsight_vehicle::Real;

use super::{Effect, EffectId, EffectSpec, Need, ParameterSpec, both_sides, spec};
use crate::terms::{Axles, Car, Moment};

/// The grip factor never falls below this.
const LEAST_GRIP: f64 = 0.1;

fn scale<T: Real>(axles: &mut Axles<T>, front: T, rear: T) {
    for (axle, factor) in [(&mut axles.front, front), (&mut axles.rear, rear)] {
        axle.grip *= if factor.re() < LEAST_GRIP { T::from(LEAST_GRIP) } else { factor };
    }
}

/// Grip lost to the load that moves to the outer wheels.
#[derive(Debug)]
pub(super) struct LateralLoadTransfer;

impl Effect for LateralLoadTransfer {
    const SPEC: EffectSpec = spec(
        "lateral_load_transfer",
        "D (1 - k (a_y/a_max)^2), a_max what the tires give with their loads",
        "load sensitivity of the tire's friction; Milliken, Race Car Vehicle Dynamics, section 2.4",
        "lateral acceleration from 0.3 to 1.0 of the limit",
        &[ParameterSpec { name: "k", unit: "1", null: 0.0, size: [0.15, 0.15], range: [-1.0, 5.0] }],
    );

    fn grip<T: Real>(p: &[T], car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        let share = at.a_y_mps2 / car.largest_a_y_mps2(axles);
        let factor = T::from(1.0) - p[0] * share * share;
        scale(axles, factor, factor);
    }
}

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
            &[both_sides("m", "1", [0.1, 0.1])],
        )
    };

    fn grip<T: Real>(p: &[T], _car: &Car<T>, _at: &Moment<T>, axles: &mut Axles<T>) {
        scale(axles, p[0] + 1.0, p[0] + 1.0);
    }
}

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
            &[both_sides("b", "1", [0.05, 0.05])],
        )
    };

    fn grip<T: Real>(p: &[T], _car: &Car<T>, _at: &Moment<T>, axles: &mut Axles<T>) {
        scale(axles, p[0] + 1.0, -p[0] + 1.0);
    }
}

/// A place on the course with less grip. Start and length are fitted as shares of the lap, or of the way driven where none was closed.
#[derive(Debug)]
pub(super) struct LowGripPatch;

/// Width of the patch's edges over its length.
const EDGE: f64 = 0.1;

impl Effect for LowGripPatch {
    const SPEC: EffectSpec = EffectSpec {
        needs: &[Need::Passes],
        flat_at_null: true,
        ..spec(
            "low_grip_patch",
            "D (1 - depth w(s)), w = 1 on the patch, with soft edges",
            "dirt, water, paint",
            "two or more passes above 60 % of the limit",
            &[
                ParameterSpec { name: "depth", unit: "1", null: 0.0, size: [0.2, 0.2], range: [0.0, 4.0] },
                ParameterSpec {
                    name: "start_share",
                    unit: "lap",
                    null: 0.5,
                    size: [1.0, 1.0],
                    range: [-1.0, 1.0],
                },
                ParameterSpec {
                    name: "length_share",
                    unit: "lap",
                    null: 0.05,
                    size: [0.05, 0.05],
                    range: [-0.7, 3.0],
                },
            ],
        )
    };

    fn grip<T: Real>(p: &[T], _car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        if at.lap_m <= 0.0 {
            return;
        }
        let middle = p[1] + p[2] * 0.5;
        let mut off = middle - at.lap_share;
        off -= off.re().round();
        let edge = p[2] * EDGE;
        let side = |x: T| (x / edge).tanh();
        let weight = (side(p[2] * 0.5 - off) + side(p[2] * 0.5 + off)) * 0.5;
        let factor = T::from(1.0) - p[0] * weight;
        scale(axles, factor, factor);
    }
}

/// Grip that fades over the run.
#[derive(Debug)]
pub(super) struct TireWear;

impl Effect for TireWear {
    const SPEC: EffectSpec = spec(
        "tire_wear",
        "D (1 - rate t)",
        "wear and heat of the tires over a run, to first order",
        "a long run near the limit",
        &[ParameterSpec {
            name: "rate_per_min",
            unit: "1/min",
            null: 0.0,
            size: [0.06, 0.06],
            range: [-5.0, 10.0],
        }],
    );

    fn grip<T: Real>(p: &[T], _car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        let factor = T::from(1.0) - p[0] * at.minutes;
        scale(axles, factor, factor);
    }
}
