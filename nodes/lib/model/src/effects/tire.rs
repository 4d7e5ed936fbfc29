//! Effects inside the tire.

use gripsight_vehicle::{GRAVITY_MPS2, Real};

use super::{Effect, EffectId, EffectSpec, Reported, positive, spec};
use crate::terms::{Axles, Car, Moment};

/// The side force follows the slip angle with a lag of one relaxation length.
#[derive(Debug)]
pub(super) struct TireRelaxation;

impl Effect for TireRelaxation {
    const SPEC: EffectSpec = EffectSpec {
        alike: &[EffectId::SteeringDelay, EffectId::SteeringLag],
        starts: &[0.5, 0.15],
        ..spec(
            "tire_relaxation",
            "sigma/v alpha' + alpha = alpha_ss (linearly: sigma/v F' + F = F_ss)",
            "Pacejka, Tire and Vehicle Dynamics, 3rd ed., section 1.2.4 and chapter 7",
            "steering above 1 Hz at low speed",
            &[positive("sigma_m", "m", [0.08, 0.5])],
        )
    };

    fn car<T: Real>(p: &[T], car: &mut Car<T>) {
        car.relaxation_m += p[0];
    }
}

/// A force along the tire takes from the force across it. Fitted as q = k^2, so that it can be seen from zero.
#[derive(Debug)]
pub(super) struct CombinedSlip;

/// Smallest square of the share that is left across.
const LEAST_SQUARE: f64 = 0.01;

impl Effect for CombinedSlip {
    const SPEC: EffectSpec = EffectSpec {
        reported: &[Reported { name: "k", unit: "1", value: |p| p[0].max(0.0).sqrt() }],
        starts: &[0.7],
        ..spec(
            "combined_slip",
            "F_y *= sqrt(max(0, 1 - (k F_x/(mu F_z))^2)) per axle",
            "friction ellipse; Pacejka, Tire and Vehicle Dynamics, 3rd ed., section 3.3",
            "braking and driving above 0.4 mu g with slip",
            &[positive("k_squared", "1", [0.7, 0.7])],
        )
    };

    fn grip<T: Real>(p: &[T], car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        let front = car.front_share(at.force_x_mps2 > 0.0);
        for (axle, share, peak) in
            [(&mut axles.front, front, car.peak[0]), (&mut axles.rear, 1.0 - front, car.peak[1])]
        {
            let use_x =
                (peak * axle.grip * axle.load_n).recip() * (at.force_x_mps2 * car.nominal_mass_kg * share);
            let square = T::from(1.0) - p[0] * use_x * use_x;
            axle.usable *=
                if square.re() < LEAST_SQUARE { T::from(LEAST_SQUARE.sqrt()) } else { square.sqrt() };
        }
    }
}

/// Standard gravity, for effects that are stated per g.
pub(super) const PER_G: f64 = 1.0 / GRAVITY_MPS2;
