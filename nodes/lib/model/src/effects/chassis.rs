//! Effects of the body, the suspension and the drivetrain.

use gripsight_vehicle::{GRAVITY_MPS2, Real};

use super::loads::COMMAND;
use super::tire::PER_G;
use super::{Effect, EffectSpec, ParameterSpec, both_sides, spec};
use crate::terms::{Axles, Car, Moment, Motion};

const fn ratio(size: f64) -> ParameterSpec {
    ParameterSpec { name: "ratio", unit: "1", null: 1.0, size: [size, size], range: [-3.0, 5.0] }
}

/// Another mass than the file states.
#[derive(Debug)]
pub(super) struct MassError;

impl Effect for MassError {
    const SPEC: EffectSpec = EffectSpec {
        needs: COMMAND,
        ..spec(
            "mass_error",
            "m *= ratio (loads follow)",
            "fuel, driver, ballast",
            "accelerating and braking with the command recorded",
            &[ratio(0.08)],
        )
    };

    fn car<T: Real>(p: &[T], car: &mut Car<T>) {
        car.mass_kg *= p[0];
    }
}

/// Another yaw inertia than the file states.
#[derive(Debug)]
pub(super) struct YawInertiaError;

impl Effect for YawInertiaError {
    const SPEC: EffectSpec = spec(
        "yaw_inertia_error",
        "I_z *= ratio",
        "yaw inertia is seldom measured",
        "steering above 1 Hz",
        &[ratio(0.15)],
    );

    fn car<T: Real>(p: &[T], car: &mut Car<T>) {
        car.yaw_inertia_kgm2 *= p[0];
    }
}

/// The centre of gravity lies further ahead; the sensors stay.
#[derive(Debug)]
pub(super) struct CogShift;

impl Effect for CogShift {
    const SPEC: EffectSpec = spec(
        "cog_shift",
        "l_f -= dl, l_r += dl, static loads follow; v_y is still measured at the nominal point",
        "fuel, ballast, corner weights not taken",
        "medium and high lateral acceleration, transients",
        // Further than a twelfth of the wheelbase nobody misplaces it.
        &[ParameterSpec { range: [-2.5, 2.5], ..both_sides("dl_m", "m", [0.01, 0.08]) }],
    );

    fn car<T: Real>(p: &[T], car: &mut Car<T>) {
        car.l_f_m -= p[0];
        car.l_r_m += p[0];
        car.cog_shift_m += p[0];
    }
}

/// The front suspension and the steering give way under side force.
#[derive(Debug)]
pub(super) struct ComplianceSteer;

impl Effect for ComplianceSteer {
    const SPEC: EffectSpec = spec(
        "compliance_steer",
        "d -= c F_yf/F_zf",
        "elastic steering and suspension; Milliken, Race Car Vehicle Dynamics, chapter 23",
        "medium lateral acceleration, transients",
        &[ParameterSpec {
            name: "rad_per_g",
            unit: "rad/g",
            null: 0.0,
            size: [0.015, 0.008],
            range: [-2.0, 5.0],
        }],
    );

    fn loads<T: Real>(p: &[T], _car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        axles.front.steer_rad -= p[0] * at.front_use;
    }
}

/// The rear wheels steer as the body rolls.
#[derive(Debug)]
pub(super) struct RollSteer;

impl Effect for RollSteer {
    const SPEC: EffectSpec = spec(
        "roll_steer",
        "d_r = k a_y/g behind the roll of the body",
        "kinematics of the rear suspension; Milliken, Race Car Vehicle Dynamics, chapter 23",
        "medium lateral acceleration, transients",
        &[both_sides("rad_per_g", "rad/g", [0.008, 0.004])],
    );

    fn loads<T: Real>(p: &[T], _car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        axles.rear.steer_rad += p[0] * at.rolled_a_y_mps2 * PER_G;
    }
}

/// A differential that resists the speed difference of its wheels.
#[derive(Debug)]
pub(super) struct DifferentialYawMoment;

/// Share of the moment that is left off power.
const OFF_POWER: f64 = 0.5;

impl Effect for DifferentialYawMoment {
    const SPEC: EffectSpec = EffectSpec {
        needs: COMMAND,
        ..spec(
            "differential_yaw_moment",
            "M_z = -k m g L tanh(r L/v) under power, half of it off power",
            "limited-slip differential; Milliken, Race Car Vehicle Dynamics, chapter 20",
            "throttle on and off in one corner",
            &[both_sides("k", "1", [0.03, 0.03])],
        )
    };

    fn motion<T: Real>(p: &[T], car: &Car<T>, at: &Moment<T>, motion: &mut Motion<T>) {
        let length_m = car.wheelbase_m();
        let share = if at.force_x_mps2 > 0.0 { 1.0 } else { OFF_POWER };
        let turn = (at.yaw_rate_radps * length_m / at.v_x_mps).tanh();
        motion.yaw_radps2 -=
            p[0] * car.mass_kg * (GRAVITY_MPS2 * share) * length_m * turn / car.yaw_inertia_kgm2;
    }
}
