//! Own tires projected on effective ones, against the axle forces of a plant that shares no equation with the model.

#![allow(clippy::unwrap_used)]

use gripsight_model::{DrivenCar, EffectId, effective_tires};
use gripsight_reference_car::{CarParameters, Course, Friction, Scenario, Simulation};
use gripsight_vehicle::{MagicFormula, OwnTires, VehicleParameters};

const SPEED_MPS: f64 = 6.0;
const MOST_SLIP_RAD: f64 = 0.3;

/// Slip and force over static load of both axles, steered slowly to both sides.
fn axles_of_the_plant(car: &CarParameters, vehicle: &VehicleParameters, mu: f64) -> [Vec<(f64, f64)>; 2] {
    let loads = [vehicle.static_load_front_n(), vehicle.static_load_rear_n()];
    let mut points: [Vec<(f64, f64)>; 2] = Default::default();
    for reversed in [false, true] {
        let course = Course::by_name("ramp_steer", car, reversed).unwrap();
        let mut driven = Scenario::new(car.clone())
            .course(course)
            .friction(Friction::Uniform { mu })
            .duration(15.0)
            .seed(1);
        driven.effects = car.own_effects(mu);
        for t in Simulation::new(driven).unwrap().run(|_| {}).truth {
            let m = &t.motion;
            let front = m.steering_rad - ((m.v_y_mps + vehicle.l_f_m * m.yaw_rate_radps) / m.v_x_mps).atan();
            let rear = -((m.v_y_mps - vehicle.l_r_m * m.yaw_rate_radps) / m.v_x_mps).atan();
            for (axle, slip, force) in [(0, front, t.front_axle_n()[1]), (1, rear, t.rear_axle_n()[1])] {
                if m.v_x_mps > car.low_speed_mps() && slip.abs() < MOST_SLIP_RAD {
                    points[axle].push((slip, force / loads[axle]));
                }
            }
        }
    }
    points
}

/// The car as the library writes it: tires of the single wheels' formula, and what it has of its own.
fn written(car: &CarParameters, vehicle: &VehicleParameters, mu: f64) -> DrivenCar {
    let axle = |stiffness: f64, grip: f64| {
        let tire = MagicFormula::from_stiffness(stiffness, 1.4, grip * mu, 0.0);
        [tire.normalized_stiffness(), tire.c, tire.d, tire.e]
    };
    let front = axle(car.tire_front.cornering_stiffness_per_rad, car.tire_front.grip);
    let rear = axle(car.tire_rear.cornering_stiffness_per_rad, car.tire_rear.grip);
    let tires = OwnTires::from_parameters(&[front, rear].concat());
    let transfer = EffectId::by_name("lateral_load_transfer").unwrap();
    DrivenCar {
        vehicle: vehicle.clone(),
        tires,
        effects: vec![(transfer, vec![car.own_load_transfer_loss(mu)])],
        substep_s: 0.002,
        force_known: false,
        on_course: false,
    }
}

#[test]
fn projected_tires_have_the_forces_of_a_plant_with_load_transfer() {
    let (car, mu) = (CarParameters::by_name("f1tenth").unwrap(), 0.9);
    let vehicle = VehicleParameters::from_ros_yaml(&car.vehicle_file("car")).unwrap();
    let points = axles_of_the_plant(&car, &vehicle, mu);
    let most = points.each_ref().map(|axle| axle.iter().map(|p| p.0.abs()).fold(0.0, f64::max));
    let written = written(&car, &vehicle, mu);
    let effective = effective_tires(&written, SPEED_MPS, most).unwrap();
    for (name, axle, found, own) in [
        ("front", &points[0], effective.front, written.tires.front),
        ("rear", &points[1], effective.rear, written.tires.rear),
    ] {
        assert!(axle.len() > 100, "{name}: {}", axle.len());
        let peak = axle.iter().map(|p| p.1.abs()).fold(0.0, f64::max);
        let error = |tire: MagicFormula| {
            let squares: f64 = axle.iter().map(|p| (tire.normalized_force(p.0) - p.1).powi(2)).sum();
            (squares / axle.len() as f64).sqrt() / peak
        };
        // Phi_p has what load transfer takes; own tires have not.
        assert!(error(found) < 0.04, "{name}: {:.3} of the peak, {found:?}", error(found));
        assert!(error(own) > 1.2 * error(found), "{name}: {:.3}, own {:.3}", error(found), error(own));
    }
}
