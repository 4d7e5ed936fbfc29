//! What a run records: stamps, noise, losses, the truth table, and a scenario as a file.

use approx::assert_relative_eq;
use gripsight_reference_car::{
    CarParameters, EffectSetting, Friction, Noise, RoadCamera, Scenario, SensorSample, SensorSettings,
    Simulation, truth_columns, write_truth_csv,
};

fn f1tenth() -> Scenario {
    Scenario::new(CarParameters::by_name("f1tenth").unwrap())
}

#[test]
fn truth_stands_at_every_odometry_stamp_and_names_its_columns() {
    let mut scenario = f1tenth().duration(5.0);
    scenario.sensors.odometry.jitter_s = 0.002;
    scenario.sensors.odometry.dropped = 0.1;
    let recording = Simulation::new(scenario).unwrap().run(|_| {});
    let stamps: Vec<f64> = recording
        .samples
        .iter()
        .filter_map(|s| if let SensorSample::Odometry(o) = s { Some(o.stamp_s) } else { None })
        .collect();
    let truths: Vec<f64> = recording.truth.iter().map(|t| t.motion.time_s).collect();
    assert_eq!(stamps, truths);
    assert!((420..480).contains(&stamps.len()), "{} of 501 samples survive", stamps.len());
    assert!(recording.samples.windows(2).all(|p| p[0].stamp_s() <= p[1].stamp_s()));
    let mut table = Vec::new();
    write_truth_csv(&mut table, &recording.truth, 1000.0).unwrap();
    let table = String::from_utf8(table).unwrap();
    let mut lines = table.lines();
    assert_eq!(lines.next().unwrap(), truth_columns().join(","));
    assert!(lines.clone().all(|l| l.split(',').count() == truth_columns().len()));
    assert_eq!(lines.count(), recording.truth.len());
    for name in
        ["f_y_front_n", "f_y_rear_n", "f_z_fl_n", "slip_angle_rr_rad", "slip_ratio_fl", "speed_rl_radps"]
    {
        assert!(truth_columns().iter().any(|c| c == name), "no column {name}: {:?}", truth_columns());
    }
}

#[test]
fn noise_has_the_size_that_was_asked_for() {
    let mut scenario = f1tenth().duration(60.0).sensors(SensorSettings::exact());
    scenario.sensors.v_x = Noise { white: 0.03, coloured: 0.04, correlation_s: 0.2, bias: 0.1 };
    let recording = Simulation::new(scenario).unwrap().run(|_| {});
    let errors: Vec<f64> = recording
        .samples
        .iter()
        .filter_map(|s| if let SensorSample::Odometry(o) = s { Some(o.v_x_mps) } else { None })
        .zip(&recording.truth)
        .map(|(v, t)| v - t.motion.v_x_mps)
        .collect();
    let count = errors.len() as f64;
    let mean = errors.iter().sum::<f64>() / count;
    let variance = errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / count;
    let next = errors.windows(2).map(|p| (p[0] - mean) * (p[1] - mean)).sum::<f64>() / count;
    assert_relative_eq!(mean, 0.1, epsilon = 0.01);
    assert_relative_eq!(variance.sqrt(), 0.05, max_relative = 0.1);
    // Ten milliseconds later only the coloured part is still there.
    assert_relative_eq!(next, 0.04_f64.powi(2) * (-0.01_f64 / 0.2).exp(), max_relative = 0.15);
}

#[test]
fn each_sensor_reports_at_its_own_rate() {
    let mut scenario = f1tenth().duration(10.0);
    scenario.sensors.imu.rate_hz = 200.0;
    scenario.sensors.wheels.rate_hz = 0.0;
    scenario.sensors.odometry.rate_hz = 33.0;
    scenario.driver.rate_hz = 50.0;
    let recording = Simulation::new(scenario).unwrap().run(|_| {});
    let count = |pick: fn(&SensorSample) -> bool| recording.samples.iter().filter(|s| pick(s)).count();
    assert_eq!(count(|s| matches!(s, SensorSample::Imu(_))), 2001);
    assert_eq!(count(|s| matches!(s, SensorSample::Wheels(_))), 0);
    assert_eq!(count(|s| matches!(s, SensorSample::Odometry(_))), 331);
    assert_eq!(count(|s| matches!(s, SensorSample::Drive(_))), 501);
}

#[test]
fn a_scenario_survives_being_written_and_read() {
    let mut scenario = f1tenth();
    scenario.effects = scenario.car.own_effects(0.9);
    let text = serde_json::to_string(&scenario).unwrap();
    assert_eq!(serde_json::from_str::<Scenario>(&text).unwrap(), scenario);
}

#[test]
fn the_camera_exposes_at_its_rate_and_disturbs_no_other_sensor() {
    let run = |camera_rate_hz: f64| {
        let mut scenario = f1tenth().duration(6.0);
        scenario.sensors.camera_rate_hz = camera_rate_hz;
        Simulation::new(scenario).unwrap().run(|_| {})
    };
    let (with, without) = (run(2.0), run(0.0));
    let stamps: Vec<f64> = with.exposures.iter().map(|e| e.stamp_s).collect();
    assert_eq!(stamps, (0..13).map(|k| f64::from(k) * 0.5).collect::<Vec<_>>());
    assert_eq!(without.exposures, []);
    assert_eq!((with.samples, &with.truth), (without.samples, &without.truth));
    for exposure in &with.exposures {
        let nearest = with.truth.iter().find(|t| t.motion.time_s >= exposure.stamp_s - 1e-6).unwrap();
        assert_relative_eq!(exposure.position_m, nearest.station_m, epsilon = 1e-3);
    }
}

#[test]
fn the_camera_sees_the_friction_of_the_road_at_the_car() {
    let run = |scenario: Scenario| {
        let mut scenario = scenario.duration(8.0);
        scenario.sensors.camera_rate_hz = 10.0;
        Simulation::new(scenario).unwrap().run(|_| {}).exposures
    };
    let changing = Friction::Changing { mu: 0.9, mu_after: 0.6, at_s: 4.0, over_s: 1.0 };
    for e in run(f1tenth().friction(changing)) {
        let expected = 0.9 - 0.3 * (e.stamp_s - 4.0).clamp(0.0, 1.0);
        assert_relative_eq!(e.mu, expected, epsilon = 1e-9);
    }
    let patch = EffectSetting::parse("low_grip_patch=depth:0.25,start_m:10,length_m:5").unwrap();
    let patched = run(f1tenth().effect(patch));
    let inside = |e: &&gripsight_reference_car::Exposure| (10.5..14.5).contains(&e.position_m);
    assert!(patched.iter().filter(inside).count() > 3);
    assert!(patched.iter().filter(inside).all(|e| (e.mu - 0.675).abs() < 1e-9));
    assert!(patched.iter().filter(|e| e.position_m < 10.0).all(|e| (e.mu - 0.9).abs() < 1e-9));
    // Worn tires do not change the road's looks.
    let worn = EffectSetting::parse("tire_wear").unwrap();
    assert!(run(f1tenth().effect(worn)).iter().all(|e| (e.mu - 0.9).abs() < 1e-9));
}

#[test]
fn pictures_are_the_same_bytes_for_the_same_seed_and_place() {
    let mut scenario = f1tenth().duration(1.0);
    scenario.sensors.camera_rate_hz = 2.0;
    let exposures = Simulation::new(scenario).unwrap().run(|_| {}).exposures;
    let files = |seed: u64| -> Vec<Vec<u8>> {
        let camera = RoadCamera::new(seed);
        exposures.iter().map(|e| camera.expose(e).unwrap()).collect()
    };
    let first = files(3);
    assert_eq!(first, files(3));
    assert!(first.iter().zip(files(4)).all(|(a, b)| *a != b));
    assert_ne!(first[1], first[2]);
    for file in &first {
        let picture = image::load_from_memory(file).unwrap();
        assert_eq!((picture.width(), picture.height()), (RoadCamera::SIDE_PX, RoadCamera::SIDE_PX));
        assert!(file.len() < 40_000, "{} bytes", file.len());
    }
}
