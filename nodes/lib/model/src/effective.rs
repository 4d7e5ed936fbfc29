//! Own tires projected on the effective tires of a bare single-track model.

use gripsight_vehicle::{MagicFormula, PacejkaParameters, VehicleParameters};

use crate::drive::{Along, Controls, Drive, Driven, DrivenCar};
use crate::effects::{EffectSpec, Need};
use crate::site::Site;

const STEP_S: f64 = 0.01;
/// Turns of the wheels end here at the latest.
const MOST_STEERING_RAD: f64 = 0.6;
/// How long the wheels take to the largest angle: slow beside a car's yaw, which settles in a few tenths of a second.
const RAMP_S: f64 = 12.0;

/// Phi_p of a car: the tires that a bare single-track model with the figures of the vehicle file needs, so that its axles have the forces of this car over the
/// slips driven. The car is steered slowly to both sides at constant speed on a plane road of one grip, with all its effects but those of the road; forces and slips of the axles are those that a
/// single-track model makes of its motion (inverse dynamics), so whatever load transfer, combined slip and the like do to the forces is in the tires.
///
/// `slip_rad`: largest slips of front and rear axle; beyond them the shape is that of the own tires. `None` where the car does not get to any slip, or
/// its motion is not finite.
#[must_use]
pub fn effective_tires(car: &DrivenCar, v_x_mps: f64, slip_rad: [f64; 2]) -> Option<PacejkaParameters> {
    let mut car = car.clone();
    // What depends on the place is not the tires'.
    let of_the_road =
        |e: &EffectSpec| e.sites.contains(&Site::RoadAndWind) || e.needs.contains(&Need::Passes);
    car.effects.retain(|(effect, _)| !of_the_road(effect.spec()));
    let mut points: [Vec<(f64, f64)>; 2] = Default::default();
    for side in [1.0, -1.0] {
        steered(&car, v_x_mps, side, slip_rad, &mut points);
    }
    let near = car.tires;
    let [front, rear] = &points;
    Some(PacejkaParameters {
        front: MagicFormula::through(front, &near.front)?,
        rear: MagicFormula::through(rear, &near.rear)?,
    })
}

/// One slow turn of the wheels: slips and forces over load of both axles, up to the slips asked for.
fn steered(car: &DrivenCar, v_x_mps: f64, side: f64, slip_rad: [f64; 2], points: &mut [Vec<(f64, f64)>; 2]) {
    let rate_radps = side * MOST_STEERING_RAD / RAMP_S;
    let along = Along { v_x_mps, ..Along::default() };
    let at = |steering_rad: f64| Controls {
        steering_rad,
        steering_rate_radps: rate_radps,
        along: Some(along),
        ..Controls::default()
    };
    let mut drive = Drive::begin(car, [v_x_mps, 0.0, 0.0], &at(0.0));
    let steps = (RAMP_S / STEP_S) as usize;
    for k in 0..steps {
        let now = drive.step(&at(rate_radps * STEP_S * k as f64), STEP_S);
        let found = axles(&car.vehicle, &now);
        // Once both axles have slipped that far, the car is beyond what was driven.
        if !found.iter().flatten().all(|v| v.is_finite())
            || (0..2).all(|i| found[i][0].abs() > slip_rad[i])
            || found.iter().any(|axle| axle[0].abs() > std::f64::consts::FRAC_PI_4)
        {
            return;
        }
        for ((points, [slip, force]), most) in points.iter_mut().zip(found).zip(slip_rad) {
            if slip.abs() <= most {
                points.push((slip, force));
            }
        }
    }
}

/// Slip and force over static load of front and rear axle, as a single-track model sees them in a motion.
fn axles(vehicle: &VehicleParameters, now: &Driven) -> [[f64; 2]; 2] {
    let (l_f, l_r, wheelbase_m) = (vehicle.l_f_m, vehicle.l_r_m, vehicle.wheelbase_m());
    let front_rad = now.wheel_rad - ((now.v_y_mps + l_f * now.yaw_rate_radps) / now.v_x_mps).atan();
    let rear_rad = -((now.v_y_mps - l_r * now.yaw_rate_radps) / now.v_x_mps).atan();
    let lateral_n = vehicle.mass_kg * now.a_y_mps2;
    let turning_nm = vehicle.yaw_inertia_kgm2 * now.yaw_acceleration_radps2;
    let front_n = (lateral_n * l_r + turning_nm) / wheelbase_m / now.wheel_rad.cos();
    let rear_n = (lateral_n * l_f - turning_nm) / wheelbase_m;
    [[front_rad, front_n / vehicle.static_load_front_n()], [rear_rad, rear_n / vehicle.static_load_rear_n()]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::EffectId;
    use crate::model::tests::tires;

    const SLIPS_RAD: [f64; 2] = [0.12, 0.12];

    fn car(effects: Vec<(EffectId, Vec<f64>)>) -> DrivenCar {
        DrivenCar {
            vehicle: VehicleParameters::f1tenth(),
            tires: tires(),
            effects,
            substep_s: 0.002,
            force_known: false,
            on_course: false,
        }
    }

    fn known(name: &str) -> EffectId {
        EffectId::by_name(name).unwrap()
    }

    #[test]
    fn without_effects_own_tires_are_effective_ones() {
        let found = effective_tires(&car(Vec::new()), 8.0, SLIPS_RAD).unwrap();
        let own = tires();
        for slip in [0.02, 0.05, 0.1] {
            for (found, own) in [(found.front, own.front), (found.rear, own.rear)] {
                approx::assert_abs_diff_eq!(
                    found.normalized_force(slip),
                    own.normalized_force(slip),
                    epsilon = 0.005
                );
            }
        }
    }

    #[test]
    fn load_transfer_takes_grip_and_a_heavier_car_pushes_harder() {
        let transfer = known("lateral_load_transfer");
        let mut own: Vec<f64> = transfer.spec().parameters.iter().map(|p| p.null).collect();
        own[0] = 0.3;
        let less = effective_tires(&car(vec![(transfer, own)]), 8.0, SLIPS_RAD).unwrap();
        let mass = known("mass_error");
        let more = effective_tires(&car(vec![(mass, vec![1.1])]), 8.0, SLIPS_RAD).unwrap();
        let own = tires();
        let ratio =
            |found: MagicFormula, own: MagicFormula| found.normalized_force(0.1) / own.normalized_force(0.1);
        assert!(ratio(less.front, own.front) < 0.97, "{}", ratio(less.front, own.front));
        // The same figures in the file: forces of 1.1 times the load are seen as those of the mass stated.
        approx::assert_abs_diff_eq!(ratio(more.rear, own.rear), 1.0, epsilon = 0.03);
    }
}
