//! Load that moves between the axles under braking and power.

use gripsight_vehicle::Real;

use super::common::{LOAD_SENSITIVITY_SHARE, add_load};
use super::{Effect, EffectSpec, Figure, Lagging, OutsideTerm, ParameterSpec, Unknown, positive, spec};
use crate::site::Site;
use crate::terms::{Axles, Car, Moment, PITCH_FREQUENCY_HZ};

/// Load that moves between the axles under braking and power.
#[derive(Debug)]
pub(super) struct LongitudinalLoadTransfer;

impl Effect for LongitudinalLoadTransfer {
    const SPEC: EffectSpec = EffectSpec {
        outside: Some(OutsideTerm::CogHeight),
        figure: Some(Figure { name: "h_cg_m", stated: |car| Some(car.h_cg_m), value: |_, h_cg_m| h_cg_m }),
        // About a third of what the height of the centre of gravity gives.
        usual: Some(|car, _| 0.33 * car.h_cg_m),
        unknown: Unknown { share: LOAD_SENSITIVITY_SHARE, samples: 0.0 },
        spread: 0.19,
        lagging: &[Lagging::Pitch],
        sizing: 1,
        ..spec(
            "longitudinal_load_transfer",
            "F_zf -= (m a + drag) h/L, F_zr += (m a + drag) h/L, a: a_x as the springs carry it, which pitch at f",
            "moment balance in pitch; Milliken, Race Car Vehicle Dynamics, chapter 16",
            "trail braking, power in the corner",
            &[Site::LoadsAndBody],
            &[
                positive("h_m", "m", [0.06, 0.3]),
                // Passenger cars pitch at 1.5 Hz, race cars at 5 and more.
                ParameterSpec {
                    name: "pitch_frequency_hz",
                    unit: "Hz",
                    null: PITCH_FREQUENCY_HZ,
                    size: [1.0, 1.0],
                    range: [-2.7, 6.0],
                },
            ],
        )
    };

    fn car<T: Real>(p: &[T], car: &mut Car<T>) {
        car.pitch_frequency_hz = p[1];
    }

    fn loads<T: Real>(p: &[T], car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        // Only forces on the tires have a lever: drag acts near the centre of gravity, and the tires push against it.
        let drag_n = car.drag_1pm * at.v_x_mps * at.v_x_mps * car.nominal_mass_kg;
        let moved_n = p[0] * (car.mass_kg * at.carried_a_x_mps2 + drag_n) / car.wheelbase_m();
        add_load(car, axles, -moved_n, moved_n);
    }
}

#[cfg(test)]
mod tests {
    use super::super::aero_drag::AeroDrag;
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;

    #[test]
    fn absent_it_moves_nothing() {
        assert_absent_at_null::<LongitudinalLoadTransfer>();
    }

    #[test]
    fn only_what_the_tires_push_moves_load() {
        const C_1PM: f64 = 8e-3;
        const V_X_MPS: f64 = 7.0;
        let mut car = car();
        AeroDrag::car(&[C_1PM], &mut car);
        let front_n = |a_x_mps2: f64| {
            let at = Moment { v_x_mps: V_X_MPS, carried_a_x_mps2: a_x_mps2, ..moment() };
            let mut axles = car.axles_at_rest();
            LongitudinalLoadTransfer::loads(&[0.06, 4.0], &car, &at, &mut axles);
            axles.front.load_n
        };
        let at_rest_n = car.axles_at_rest().front.load_n;
        // Coasting against the wind, and held at its speed by the tires.
        approx::assert_relative_eq!(front_n(-C_1PM * V_X_MPS * V_X_MPS), at_rest_n, epsilon = 1e-12);
        let moved_n = 0.06 * car.mass_kg * C_1PM * V_X_MPS * V_X_MPS / car.wheelbase_m();
        approx::assert_relative_eq!(front_n(0.0), at_rest_n - moved_n, epsilon = 1e-12);
    }
}
