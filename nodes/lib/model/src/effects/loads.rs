//! Effects on the axle loads.

use gripsight_vehicle::{GRAVITY_MPS2, Real};

use super::{Effect, EffectSpec, Need, ParameterSpec, positive, spec};
use crate::terms::{Axles, Car, Moment};

/// No axle is lighter than this share of the weight.
const LEAST_LOAD_SHARE: f64 = 0.05;

fn add<T: Real>(car: &Car<T>, axles: &mut Axles<T>, front_n: T, rear_n: T) {
    let least_n = car.mass_kg * (GRAVITY_MPS2 * LEAST_LOAD_SHARE);
    for (axle, more_n) in [(&mut axles.front, front_n), (&mut axles.rear, rear_n)] {
        axle.load_n += more_n;
        if axle.load_n.re() < least_n.re() {
            axle.load_n = least_n;
        }
    }
}

/// Load that moves between the axles under braking and power.
#[derive(Debug)]
pub(super) struct LongitudinalLoadTransfer;

impl Effect for LongitudinalLoadTransfer {
    const SPEC: EffectSpec = spec(
        "longitudinal_load_transfer",
        "F_zf -= (m a_x + drag) h/L, F_zr += (m a_x + drag) h/L",
        "moment balance in pitch",
        "trail braking, power in the corner",
        &[positive("h_m", "m", [0.06, 0.3])],
    );

    fn loads<T: Real>(p: &[T], car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        // Only forces on the tires have a lever: drag acts near the centre of gravity, and the tires push against it.
        let drag_n = car.drag_1pm * at.v_x_mps * at.v_x_mps * car.nominal_mass_kg;
        let moved_n = p[0] * (car.mass_kg * at.a_x_mps2 + drag_n) / car.wheelbase_m();
        add(car, axles, -moved_n, moved_n);
    }
}

/// Load from the air.
#[derive(Debug)]
pub(super) struct AeroDownforce;

impl Effect for AeroDownforce {
    const SPEC: EffectSpec = spec(
        "aero_downforce",
        "F_zf += c_f m g v^2, F_zr += c_r m g v^2",
        "wings and floor",
        "a speed range over two at high lateral acceleration",
        &[
            ParameterSpec { name: "c_f", unit: "s2/m2", null: 0.0, size: [1e-3, 6e-5], range: [-1.0, 6.0] },
            ParameterSpec { name: "c_r", unit: "s2/m2", null: 0.0, size: [1e-3, 6e-5], range: [-1.0, 6.0] },
        ],
    );

    fn loads<T: Real>(p: &[T], car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        let weight_v2 = car.mass_kg * GRAVITY_MPS2 * at.v_x_mps * at.v_x_mps;
        add(car, axles, p[0] * weight_v2, p[1] * weight_v2);
    }
}

/// What the longitudinal effects need.
pub(super) const COMMAND: &[Need] = &[Need::LongitudinalCommand];

#[cfg(test)]
mod tests {
    use gripsight_vehicle::VehicleParameters;

    use super::super::longitudinal::AeroDrag;
    use super::*;

    #[test]
    fn only_what_the_tires_push_moves_load() {
        const C_1PM: f64 = 8e-3;
        const V_X_MPS: f64 = 7.0;
        let mut car = Car::nominal(&VehicleParameters::f1tenth(), [1.0, 1.0]);
        AeroDrag::car(&[C_1PM], &mut car);
        let front_n = |a_x_mps2: f64| {
            let at = Moment {
                v_x_mps: V_X_MPS,
                yaw_rate_radps: 0.0,
                a_y_mps2: 0.0,
                rolled_a_y_mps2: 0.0,
                front_use: 0.0,
                a_x_mps2,
                force_x_mps2: 0.0,
                minutes: 0.0,
                lap_share: 0.0,
                lap_m: 0.0,
                place_rad: 0.0,
            };
            let mut axles = car.axles_at_rest();
            LongitudinalLoadTransfer::loads(&[0.06], &car, &at, &mut axles);
            axles.front.load_n
        };
        let at_rest_n = car.axles_at_rest().front.load_n;
        // Coasting against the wind, and held at its speed by the tires.
        approx::assert_relative_eq!(front_n(-C_1PM * V_X_MPS * V_X_MPS), at_rest_n, epsilon = 1e-12);
        let moved_n = 0.06 * car.mass_kg * C_1PM * V_X_MPS * V_X_MPS / car.wheelbase_m();
        approx::assert_relative_eq!(front_n(0.0), at_rest_n - moved_n, epsilon = 1e-12);
    }
}
