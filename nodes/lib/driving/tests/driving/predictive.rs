//! The predictive controller on a single-track car.

use gripsight_driving::{Actuator, CarState, Controller, Driver, Named, Settings, TireSet, Track, Trust};
use gripsight_vehicle::{Input, SingleTrack, State};

use crate::closed::{DRIVETRAIN, drive, drive_with, on_the_line, rear_driven, set, tires, with};

fn settings(controller: Controller, share: f64) -> Settings {
    Settings { controller, share, ..Settings::default() }
}

fn predictive() -> Settings {
    settings(Controller::Predictive, Settings::default().share)
}

#[test]
fn beside_a_straight_line_it_comes_back_without_swinging() {
    // Two straights of 80 m.
    let mut rows: Vec<[f64; 4]> = Vec::new();
    for side in [1.0, -1.0] {
        rows.extend((0..80).map(|k| [side * (f64::from(k) - 40.0), -6.0 * side, 0.5, 0.5]));
        rows.extend((0..40).map(|k| {
            let p = std::f64::consts::PI * (f64::from(k) / 40.0 - 0.5);
            [side * (40.0 + 6.0 * p.cos()), side * 6.0 * p.sin(), 0.5, 0.5]
        }));
    }
    let track = Track::from_points(&rows).unwrap();
    let mut driver =
        Driver::new(rear_driven(), DRIVETRAIN, track, set(0.8, Trust::Accepted), predictive()).unwrap();
    let model_tires = tires(0.8);
    let (vehicle, mut offsets) = (rear_driven(), Vec::new());
    let mut car = CarState { y_m: -5.7, heading_rad: 0.05, ..on_the_line(&driver, 10.0, 5.0) };
    for _ in 0..300 {
        let command = driver.command(&car, car.stamp_s);
        let input = Input { v_x_mps: car.v_x_mps, steering_rad: command.steering_rad };
        let from = State { v_y_mps: car.v_y_mps, yaw_rate_radps: car.yaw_rate_radps };
        let to = SingleTrack::new(&vehicle, &model_tires).step(from, &input, &input, 0.01, 0.002);
        let (sin, cos) = car.heading_rad.sin_cos();
        car = CarState {
            stamp_s: car.stamp_s + 0.01,
            x_m: car.x_m + 0.01 * (car.v_x_mps * cos - to.v_y_mps * sin),
            y_m: car.y_m + 0.01 * (car.v_x_mps * sin + to.v_y_mps * cos),
            heading_rad: car.heading_rad + 0.01 * to.yaw_rate_radps,
            v_y_mps: to.v_y_mps,
            yaw_rate_radps: to.yaw_rate_radps,
            ..car
        };
        offsets.push(driver.place().unwrap().offset_m);
    }
    assert!(offsets[0] > 0.25);
    let swing_m = offsets.iter().fold(0.0_f64, |least, offset| least.min(*offset));
    let left_m = offsets[150..].iter().fold(0.0_f64, |most, offset| most.max(offset.abs()));
    assert!(swing_m > -0.02 && left_m < 0.01, "{swing_m} m beyond, {left_m} m left after 1.5 s");
    assert_eq!(driver.solves().unwrap().not_converged, 0);
}

#[test]
fn at_most_of_the_grip_it_keeps_nearer_to_the_line_than_the_pursuit() {
    let worst_m = |controller: Controller| {
        let mut driver = with(set(0.8, Trust::Accepted), settings(controller, 0.9));
        let worst_m = drive(&mut driver, |_| 0.8, 0.0, 25.0);
        assert!(!driver.held_back());
        worst_m
    };
    let (predicted_m, pursued_m) = (worst_m(Controller::Predictive), worst_m(Controller::Pursuit));
    assert!(predicted_m < 0.05 && predicted_m < 0.7 * pursued_m, "{predicted_m} m, pursuit {pursued_m} m");
}

#[test]
fn where_there_is_no_answer_the_pursuit_s_is_taken_and_counted() {
    let mut predictive = with(set(0.8, Trust::Accepted), predictive());
    let mut pursuit = with(set(0.8, Trust::Accepted), Settings::default());
    let car = on_the_line(&predictive, 5.0, 3.0);
    // Finite, and nothing that can be calculated with.
    let lost = CarState { yaw_rate_radps: 1e200, ..car };
    assert_eq!(predictive.command(&lost, 0.0), pursuit.command(&lost, 0.0));
    let solves = *predictive.solves().unwrap();
    assert_eq!((solves.not_converged, solves.commands), (1, 0));
    assert_eq!(pursuit.solves(), None);
    // What is not finite is braked for, whoever steers.
    let unknown = CarState { v_y_mps: f64::NAN, ..car };
    assert_eq!(predictive.command(&unknown, 0.0), pursuit.command(&unknown, 0.0));
    // A car that stands has no slip angles.
    let mut stands = with(set(0.8, Trust::Accepted), self::predictive());
    stands.command(&CarState { v_x_mps: 0.0, ..car }, 0.0);
    assert_eq!((stands.solves().unwrap().slow, stands.solves().unwrap().not_converged), (1, 0));
    // The next good state is answered again, far outside of the track, too.
    let outside = CarState { stamp_s: 0.01, x_m: car.x_m + 2.0, ..car };
    assert!(stands.command(&outside, 0.01).steering_rad.is_finite());
    assert_eq!((stands.solves().unwrap().commands, stands.solves().unwrap().not_converged), (1, 0));
}

#[test]
fn a_known_delay_and_a_known_lag_are_made_up_for() {
    let none = Named::default();
    for late in [Named { steering_delay_s: Some(0.15), ..none }, Named { steering_lag_s: Some(0.15), ..none }]
    {
        let worst_m = |told: bool| {
            let actuator = Actuator {
                delay_s: late.steering_delay_s.filter(|_| told).unwrap_or(0.0),
                lag_s: late.steering_lag_s.filter(|_| told).unwrap_or(0.0),
                ..Actuator::default()
            };
            let mut driver = with(TireSet { actuator, ..set(0.7, Trust::Accepted) }, predictive());
            drive_with(&mut driver, |_| 0.8, &late, 25.0)
        };
        let (with, without) = (worst_m(true), worst_m(false));
        assert!(with < 0.1 && with < 0.5 * without, "{late:?}: {with} m told, {without} m untold");
    }
}

#[test]
fn the_steering_is_never_faster_than_the_servo() {
    let mut settings = predictive();
    settings.predictive.most_rate_radps = 1.0;
    let mut driver = with(set(0.8, Trust::Accepted), settings);
    let mut before = None;
    for k in 0..100 {
        // Thrown from one edge to the other.
        let car = on_the_line(&driver, 5.0 + 0.03 * f64::from(k), 3.0);
        let aside = if k % 20 < 10 { 0.3 } else { -0.3 };
        let (sin, cos) = car.heading_rad.sin_cos();
        let stamp_s = 0.01 * f64::from(k);
        let car = CarState { stamp_s, x_m: car.x_m - aside * sin, y_m: car.y_m + aside * cos, ..car };
        let steering_rad = driver.command(&car, stamp_s).steering_rad;
        let turned = before.replace(steering_rad).map_or(0.0, |before: f64| (steering_rad - before).abs());
        assert!(turned < 0.0101, "{turned} rad in 10 ms");
    }
    assert!(driver.solves().unwrap().solved > 20);
}
