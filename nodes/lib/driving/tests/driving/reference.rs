//! The driver on the reference car, which shares no model with it.

use gripsight_driving::{
    CarState, Controller, Driver, Drivetrain, Longitudinal, Settings, TireSet, Track, Trust,
};
use gripsight_reference_car as reference;
use gripsight_reference_car::{CarParameters, Command, Course, Friction, Scenario, SensorSample, Simulation};
use gripsight_vehicle::{PacejkaParameters, VehicleParameters};

#[test]
fn on_its_projected_tires_the_1_10_car_stays_on_the_track() {
    stays_on_the_track(Controller::Pursuit, 0.25);
}

#[test]
fn on_its_projected_tires_predictive_control_keeps_it_nearer_to_the_line() {
    stays_on_the_track(Controller::Predictive, 0.2);
}

/// No farther from the line than `most_m`.
fn stays_on_the_track(controller: Controller, most_m: f64) {
    let car = CarParameters::by_name("f1tenth").unwrap();
    let vehicle = VehicleParameters::from_ros_yaml(&car.vehicle_file("f1tenth")).unwrap();
    let line = reference::Track::by_name("club", car.track_scale, false).unwrap();
    let width = line.half_width_m();
    let rows: Vec<[f64; 4]> = line.points().iter().step_by(8).map(|p| [p.x_m, p.y_m, width, width]).collect();
    let track = Track::from_points(&rows).unwrap();
    approx::assert_relative_eq!(track.length_m(), line.length_m(), max_relative = 1e-4);
    // What `closed_loop` finds of the plant on a road of 0.9.
    let tires = PacejkaParameters::from_array([9.68, 1.041, 0.830, -0.876, 11.72, 1.0, 0.857, -0.738]);
    let set = TireSet { trust: Trust::Accepted, ..TireSet::assumed(tires) };
    let drivetrain = Drivetrain {
        drive_mps2: car.drive.drive_limit * 9.81,
        brake_mps2: car.drive.brake_limit * 9.81,
        power_w_per_kg: car.drive.power_w / car.mass_kg,
        top_speed_mps: car.top_speed_mps,
        told: Longitudinal::UNKNOWN,
    };
    let mut driver =
        Driver::new(vehicle, drivetrain, track, set, Settings { controller, ..Settings::default() }).unwrap();
    let course = Course::Track { name: "club".to_owned(), reversed: false };
    let mut scenario = Scenario::new(car).course(course).friction(Friction::Uniform { mu: 0.9 });
    scenario.effects = scenario.car.own_effects(0.9);
    scenario.driver.pace = 0.3;
    let mut sim = Simulation::new(scenario).unwrap();
    let (mut worst_m, mut driven_m, mut station_m) = (0.0_f64, 0.0, 0.0);
    for _ in 0..25_000 {
        sim.step().unwrap();
        for sample in sim.drain().0 {
            let SensorSample::Odometry(s) = sample else { continue };
            let command = driver.command(
                &CarState {
                    stamp_s: s.stamp_s,
                    x_m: s.x_m,
                    y_m: s.y_m,
                    heading_rad: s.heading_rad,
                    v_x_mps: s.v_x_mps,
                    v_y_mps: s.v_y_mps,
                    yaw_rate_radps: s.yaw_rate_radps,
                },
                s.stamp_s,
            );
            sim.command(Command {
                steering_rad: command.steering_rad,
                speed_mps: command.speed_mps,
                acceleration_mps2: Some(command.acceleration_mps2),
            });
        }
        let now = sim.now().unwrap();
        worst_m = worst_m.max(now.offset_m.abs());
        driven_m += (now.station_m - station_m).rem_euclid(line.length_m()) % (0.9 * line.length_m());
        station_m = now.station_m;
    }
    assert!(worst_m < most_m && most_m < width, "{worst_m} m of {width} m");
    assert!(driven_m > 2.0 * line.length_m(), "{driven_m} m");
    let instead = driver.solves().map(|s| s.not_converged);
    assert_eq!(instead, (controller == Controller::Predictive).then_some(0));
}
