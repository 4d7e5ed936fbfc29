//! Energy, limits, mirror, standstill, wheel lift, convergence with the step, and the ways in which a run ends.

use approx::assert_relative_eq;
use gripsight_reference_car::{
    CAR_NAMES, CarParameters, Command, Course, DriverKind, EffectSetting, EndReason, Friction, GRAVITY_MPS2,
    ReferenceCarError, Scenario, SensorSettings, Simulation, TRACK_NAMES, TruthSample,
};

fn car(name: &str) -> CarParameters {
    CarParameters::by_name(name).unwrap()
}

fn exact(name: &str, course: Course, duration_s: f64) -> Scenario {
    Scenario::new(car(name)).course(course).sensors(SensorSettings::exact()).duration(duration_s)
}

fn with(mut scenario: Scenario, effects: &[&str]) -> Scenario {
    scenario.effects = effects.iter().map(|text| EffectSetting::parse(text).unwrap()).collect();
    scenario
}

fn realistic(mut scenario: Scenario) -> Scenario {
    scenario.effects = scenario.car.own_effects(scenario.friction.nominal());
    scenario
}

/// Power lost where a wheel slides over the road.
fn sliding_power_w(car: &CarParameters, t: &TruthSample) -> f64 {
    let m = &t.motion;
    let half = car.track_width_m / 2.0;
    let places = [(car.l_f_m, half), (car.l_f_m, -half), (-car.l_r_m, half), (-car.l_r_m, -half)];
    (0..4)
        .map(|i| {
            let (v_x, v_y) =
                (m.v_x_mps - m.yaw_rate_radps * places[i].1, m.v_y_mps + m.yaw_rate_radps * places[i].0);
            let (sin, cos) = if i < 2 { m.steering_rad.sin_cos() } else { (0.0, 1.0) };
            let along = v_x * cos + v_y * sin - m.wheel_radps[i] * car.drive.wheel_radius_m;
            let across = v_y * cos - v_x * sin;
            -(t.wheels[i].f_x_n * along + t.wheels[i].f_y_n * across)
        })
        .sum()
}

fn kinetic_energy_j(car: &CarParameters, t: &TruthSample) -> f64 {
    let m = &t.motion;
    let body = car.mass_kg * (m.v_x_mps.powi(2) + m.v_y_mps.powi(2))
        + car.yaw_inertia_kgm2 * m.yaw_rate_radps.powi(2);
    let wheels: f64 = m.wheel_radps.iter().map(|w| car.drive.wheel_inertia_kgm2 * w * w).sum();
    (body + wheels) / 2.0
}

#[test]
fn a_coasting_car_loses_exactly_what_its_tires_dissipate() {
    for name in CAR_NAMES {
        let car = car(name);
        let speed_mps = 0.5 * car.top_speed_mps;
        let mut run =
            with(exact(name, Course::RampSteer { speed_mps, rate_radps: 0.0 }, 5.0), &["combined_slip=1"]);
        run.sensors.odometry.rate_hz = 500.0;
        let mut run = Simulation::new(run).unwrap();
        let steering_rad = 0.7 * GRAVITY_MPS2 * car.wheelbase_m() / speed_mps.powi(2);
        run.command(Command { steering_rad, speed_mps: 0.0, acceleration_mps2: Some(0.0) });
        let mut seen = Vec::new();
        for _ in 0..3000 {
            run.step().unwrap();
            seen.push(*run.now().unwrap());
        }
        let lost = kinetic_energy_j(&car, &seen[0]) - kinetic_energy_j(&car, &seen[2999]);
        let dissipated: f64 = seen
            .windows(2)
            .map(|p| 0.0005 * (sliding_power_w(&car, &p[0]) + sliding_power_w(&car, &p[1])))
            .sum();
        assert!(lost > 0.01 * kinetic_energy_j(&car, &seen[0]), "{name} hardly slides");
        assert_relative_eq!(lost, dissipated, max_relative = 2e-3);
        let worst = seen.iter().map(|t| sliding_power_w(&car, t)).fold(f64::INFINITY, f64::min);
        assert!(worst > -1e-6 * car.mass_kg, "{name}: tires give energy to the car: {worst} W");
    }
}

#[test]
fn drag_and_rolling_resistance_slow_a_car_as_they_should() {
    let car = car("race_car");
    let course = Course::RampSteer { speed_mps: 50.0, rate_radps: 0.0 };
    let run = with(exact("race_car", course, 3.0), &["aero_drag=0.001", "rolling_resistance=0.02"]);
    let mut run = Simulation::new(run).unwrap();
    run.command(Command { steering_rad: 0.0, speed_mps: 0.0, acceleration_mps2: Some(0.0) });
    for _ in 0..1000 {
        run.step().unwrap();
    }
    let t = run.now().unwrap();
    // The wheels' inertia is carried along.
    let spin = 4.0 * car.drive.wheel_inertia_kgm2 / car.drive.wheel_radius_m.powi(2);
    let asked =
        -(0.001 * t.motion.v_x_mps.powi(2) + 0.02 * GRAVITY_MPS2) * car.mass_kg / (car.mass_kg + spin);
    assert_relative_eq!(t.motion.specific_x_mps2, asked, max_relative = 0.01);
}

#[test]
fn no_wheel_gives_more_than_its_friction() {
    for name in CAR_NAMES {
        for kind in [DriverKind::PurePursuit, DriverKind::Profile] {
            let course = Course::Track { name: "club".to_owned(), reversed: true };
            let run = realistic(exact(name, course, 30.0).driver(kind, 0.9));
            let grip = run.car.tire_front.grip.max(run.car.tire_rear.grip) * run.friction.nominal();
            let recording = Simulation::new(run).unwrap().run(|_| {});
            assert!(recording.end.is_completed(), "{name}: {}", recording.end);
            let weight = car(name).mass_kg * GRAVITY_MPS2;
            for t in &recording.truth {
                let load: f64 = t.wheels.iter().map(|w| w.f_z_n).sum();
                assert_relative_eq!(load, weight, max_relative = 1e-9);
                for w in &t.wheels {
                    // An unloaded tire of a degressive kind has at most the factor 1 + sensitivity more friction.
                    assert!(w.f_x_n.hypot(w.f_y_n) <= 1.51 * grip * w.f_z_n + 1e-9, "{name}: {w:?}");
                }
                let total = t.front_axle_n()[1] + t.rear_axle_n()[1];
                assert!(total.abs() < 1.02 * grip * weight, "{name}: {total} N across");
            }
        }
    }
}

#[test]
fn a_circle_at_growing_speed_ends_at_the_friction_limit() {
    for name in CAR_NAMES {
        let course = Course::by_name("steady_circle", &car(name), false).unwrap();
        let run = exact(name, course, 40.0).driver(DriverKind::PurePursuit, 1.15);
        let limit = run.friction.nominal() * GRAVITY_MPS2;
        let grips = [run.car.tire_front.grip, run.car.tire_rear.grip];
        let recording = Simulation::new(run).unwrap().run(|_| {});
        let most = recording.truth.iter().map(|t| t.motion.specific_y_mps2).fold(0.0, f64::max);
        assert!(most < 1.01 * limit * grips[0].max(grips[1]), "{name}: {most} of {limit}");
        // Of the front force, its cosine with the steering angle counts.
        assert!(most > 0.88 * limit * grips[0].min(grips[1]), "{name}: {most} of {limit}");
    }
}

#[test]
fn left_and_right_are_mirror_images() {
    for name in CAR_NAMES {
        let drive = |sign: f64| {
            let angle_rad = sign * 0.9 * GRAVITY_MPS2 * car(name).wheelbase_m()
                / (0.45 * car(name).top_speed_mps).powi(2);
            let course =
                Course::StepSteer { speed_mps: 0.45 * car(name).top_speed_mps, angle_rad, rise_s: 0.1 };
            let mut run = realistic(exact(name, course, 4.0));
            for text in [
                "compliance_steer",
                "roll_steer",
                "differential_yaw_moment",
                "camber_thrust",
                "steering_lag",
                "steering_backlash",
            ] {
                run.effects.push(EffectSetting::parse(text).unwrap());
            }
            Simulation::new(run).unwrap().run(|_| {}).truth
        };
        let (left, right) = (drive(1.0), drive(-1.0));
        assert_eq!(left.len(), right.len());
        for (l, r) in left.iter().zip(&right) {
            let (a, b) = (&l.motion, &r.motion);
            assert_relative_eq!(a.v_x_mps, b.v_x_mps, max_relative = 1e-9);
            assert_relative_eq!(a.v_y_mps, -b.v_y_mps, epsilon = 1e-9);
            assert_relative_eq!(a.yaw_rate_radps, -b.yaw_rate_radps, epsilon = 1e-9);
            assert_relative_eq!(a.roll_rad, -b.roll_rad, epsilon = 1e-9);
            assert_relative_eq!(l.wheels[0].f_z_n, r.wheels[1].f_z_n, max_relative = 1e-9);
            assert_relative_eq!(l.wheels[3].f_y_n, -r.wheels[2].f_y_n, epsilon = 1e-6);
        }
    }
}

#[test]
fn a_car_brakes_to_rest_and_stays() {
    for name in CAR_NAMES {
        let course = Course::RampSteer { speed_mps: 0.3 * car(name).top_speed_mps, rate_radps: 0.0 };
        let mut run = Simulation::new(realistic(exact(name, course, 5.0))).unwrap();
        run.command(Command { steering_rad: 0.1, speed_mps: 0.0, acceleration_mps2: None });
        for _ in 0..15_000 {
            run.step().unwrap();
        }
        let m = run.now().unwrap().motion;
        assert!(m.v_x_mps.abs() < 0.01 && m.v_y_mps.abs() < 0.01, "{name} creeps: {m:?}");
        assert!(m.wheel_radps.iter().all(|w| w.abs() < 0.5), "{name}'s wheels turn: {m:?}");
        // And it sets off again.
        run.command(Command { steering_rad: 0.0, speed_mps: 2.0, acceleration_mps2: None });
        for _ in 0..5_000 {
            run.step().unwrap();
        }
        assert_relative_eq!(run.now().unwrap().motion.v_x_mps, 2.0, max_relative = 0.1);
    }
}

#[test]
fn a_tall_car_lifts_its_inner_wheels_and_rolls_over() {
    let steer = |k: &str| {
        let course = Course::StepSteer { speed_mps: 20.0, angle_rad: 0.12, rise_s: 0.2 };
        let run = with(exact("passenger_car", course, 8.0), &[k]);
        Simulation::new(run).unwrap().run(|_| {})
    };
    let own = steer("lateral_load_transfer=0.2");
    assert!(own.end.is_completed(), "{}", own.end);
    assert!(own.truth.iter().all(|t| t.wheels.iter().all(|w| w.f_z_n > 0.0)));
    let mut tall = car("passenger_car");
    tall.h_cg_m = 1.6;
    let course = Course::StepSteer { speed_mps: 20.0, angle_rad: 0.12, rise_s: 0.2 };
    let run = Scenario::new(tall).course(course).sensors(SensorSettings::exact()).duration(8.0);
    let run = realistic(run.friction(Friction::Uniform { mu: 1.3 }));
    let recording = Simulation::new(run).unwrap().run(|_| {});
    assert!(matches!(recording.end, EndReason::Rollover { .. }), "{}", recording.end);
    assert!(
        recording.truth.iter().any(|t| t.wheels[0].f_z_n <= 0.0 && t.wheels[2].f_z_n <= 0.0),
        "no wheel lifts"
    );
    assert!(recording.truth.iter().all(|t| t.wheels.iter().all(|w| w.f_z_n >= 0.0)));
    assert!(recording.truth.len() > 100, "what was driven before is recorded");
}

#[test]
fn halving_the_step_quarters_the_error() {
    for name in CAR_NAMES {
        let drive = |step_s: f64| {
            let angle_rad =
                0.6 * GRAVITY_MPS2 * car(name).wheelbase_m() / (0.45 * car(name).top_speed_mps).powi(2);
            let course = Course::SineSweep {
                speed_mps: 0.45 * car(name).top_speed_mps,
                amplitude_rad: angle_rad,
                from_hz: 0.5,
                to_hz: 2.0,
            };
            let mut run = realistic(exact(name, course, 4.0));
            run.step_s = step_s;
            let truth = Simulation::new(run).unwrap().run(|_| {}).truth;
            truth.iter().map(|t| [t.motion.v_y_mps, t.motion.yaw_rate_radps]).collect::<Vec<_>>()
        };
        let distance = |a: &[[f64; 2]], b: &[[f64; 2]]| {
            a.iter().zip(b).map(|(x, y)| (x[0] - y[0]).hypot(x[1] - y[1])).fold(0.0, f64::max)
        };
        let (coarse, middle, fine) = (drive(0.001), drive(0.0005), drive(0.00025));
        let (first, second) = (distance(&coarse, &middle), distance(&middle, &fine));
        println!("{name}: 1 ms to 0.5 ms {first:.2e}, 0.5 ms to 0.25 ms {second:.2e}");
        assert!(first < 5e-3, "{name}: 1 ms is {first} off");
        assert!(second < 0.5 * first, "{name}: {first} then {second}");
    }
}

#[test]
fn all_cars_finish_all_tracks_in_both_directions() {
    for name in CAR_NAMES {
        for track in TRACK_NAMES {
            for (reversed, kind, pace) in
                [(false, DriverKind::PurePursuit, 0.8), (true, DriverKind::Profile, 0.9)]
            {
                let course = Course::Track { name: track.to_owned(), reversed };
                let recording = Simulation::new(realistic(exact(name, course, 40.0).driver(kind, pace)))
                    .unwrap()
                    .run(|_| {});
                assert!(recording.end.is_completed(), "{name} on {track}, {kind:?}: {}", recording.end);
            }
        }
    }
}

#[test]
fn runs_that_cannot_go_on_say_why_and_keep_what_they_have() {
    let ended = |scenario: Scenario| {
        let recording = Simulation::new(scenario).unwrap().run(|_| {});
        assert!(!recording.samples.is_empty());
        recording.end
    };
    let course = Course::StepSteer { speed_mps: 30.0, angle_rad: 0.15, rise_s: 0.1 };
    let spin = ended(with(exact("race_car", course, 20.0), &["grip_balance=0.3"]));
    assert!(matches!(spin, EndReason::Spin { .. }), "{spin}");
    let uphill = Course::RampSteer { speed_mps: 3.0, rate_radps: 0.0 };
    let reverse = ended(with(exact("passenger_car", uphill, 20.0), &["road_slope=0.6"]));
    assert!(matches!(reverse, EndReason::Reverse { .. }), "{reverse}");
    let still = Course::RampSteer { speed_mps: 1e-3, rate_radps: 0.0 };
    let standstill = ended(exact("f1tenth", still, 20.0));
    assert!(matches!(standstill, EndReason::Standstill { .. }), "{standstill}");
    let course = Course::Track { name: "club".to_owned(), reversed: false };
    let slippery = Friction::Changing { mu: 1.0, mu_after: 0.15, at_s: 5.0, over_s: 0.0 };
    let left = ended(exact("race_car", course, 40.0).driver(DriverKind::Profile, 0.95).friction(slippery));
    assert!(matches!(left, EndReason::LeftTrack { .. } | EndReason::Spin { .. }), "{left}");
    for end in [spin, reverse, standstill, left] {
        assert!(end.to_string().contains(" s"), "no time in {end}");
    }
}

#[test]
fn absurd_parameters_are_refused_or_end_with_a_reason() {
    let refused = |scenario: Scenario| {
        assert!(matches!(Simulation::new(scenario).err(), Some(ReferenceCarError::InvalidParameter { .. })));
    };
    let mut weightless = Scenario::new(car("f1tenth"));
    weightless.car.mass_kg = 0.0;
    refused(weightless);
    let mut nan = Scenario::new(car("f1tenth"));
    nan.car.l_f_m = f64::NAN;
    refused(nan);
    refused(Scenario::new(car("f1tenth")).duration(f64::INFINITY));
    refused(Scenario::new(car("f1tenth")).friction(Friction::Uniform { mu: -0.1 }));
    refused(with(Scenario::new(car("f1tenth")), &["cog_shift=5"]));
    refused(with(Scenario::new(car("f1tenth")), &["mass_error=-1"]));
    // Possible, and hopeless: whatever happens, numbers stay numbers.
    let mut extreme = Scenario::new(car("f1tenth")).duration(5.0);
    extreme.car.yaw_inertia_kgm2 = 1e-9;
    let recording = Simulation::new(extreme).unwrap().run(|_| {});
    assert!(recording.truth.iter().all(|t| t.motion.v_y_mps.is_finite() && t.motion.x_m.is_finite()));
}

#[test]
fn a_floor_that_changes_takes_hold_at_once_and_everywhere() {
    let course = Course::by_name("club", &car("f1tenth"), false).unwrap();
    let mut run = Simulation::new(exact("f1tenth", course, 60.0)).unwrap();
    let drive = |run: &mut Simulation, seconds: usize| {
        (0..1000 * seconds).try_for_each(|_| run.drive()).map(|()| *run.now().unwrap())
    };
    assert!(drive(&mut run, 2).unwrap().wheels.iter().all(|w| w.road_friction == 0.9));
    assert!(run.set_friction(0.0).is_err() && run.set_friction(f64::NAN).is_err());
    run.set_friction(0.2).unwrap();
    // The scenario's driver goes on as on the old floor.
    assert!(drive(&mut run, 20).is_err(), "a corner at 80 % of 0.9 is driven through at 0.2");
    assert!(run.now().unwrap().wheels.iter().all(|w| w.road_friction == 0.2));
}
