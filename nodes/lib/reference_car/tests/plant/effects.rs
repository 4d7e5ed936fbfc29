//! The table of effects: complete, absent at its null values, visible at its sizes, and exact where it is a sensor's.

use approx::assert_relative_eq;
use gripsight_reference_car::{
    CarParameters, Course, DriverKind, EFFECTS, EffectSetting, Recording, ReferenceCarError, Scenario,
    SensorSample, SensorSettings, Simulation,
};

/// The candidate effects by their canonical names.
const CANONICAL: [&str; 34] = [
    "tire_relaxation",
    "lateral_load_transfer",
    "longitudinal_load_transfer",
    "combined_slip",
    "grip_scale",
    "grip_balance",
    "low_grip_patch",
    "tire_wear",
    "steering_lag",
    "steering_delay",
    "steering_gain",
    "steering_offset",
    "steering_backlash",
    "steering_rate_limit",
    "aero_downforce",
    "aero_drag",
    "rolling_resistance",
    "mass_error",
    "yaw_inertia_error",
    "cog_shift",
    "road_bank",
    "road_slope",
    "compliance_steer",
    "roll_steer",
    "differential_yaw_moment",
    "gyro_scale",
    "gyro_bias",
    "v_y_lever_arm",
    "v_y_bias",
    "odometry_delay",
    "odometry_low_pass",
    "v_x_scale",
    "imu_lever_arm",
    "imu_tilt",
];

fn scenario(car: &str, effects: Vec<EffectSetting>) -> Scenario {
    let mut scenario = Scenario::new(CarParameters::by_name(car).unwrap())
        .course(Course::Track { name: "esses".to_owned(), reversed: false })
        .driver(DriverKind::Profile, 0.8)
        .sensors(SensorSettings::exact())
        .duration(20.0);
    scenario.effects = effects;
    scenario
}

fn drive(car: &str, effects: Vec<EffectSetting>) -> Recording {
    Simulation::new(scenario(car, effects)).unwrap().run(|_| {})
}

/// The run with and without a sensor effect: the motion is the same.
fn both(effect: &str) -> Vec<(SensorSample, SensorSample)> {
    let with = drive("f1tenth", vec![EffectSetting::parse(effect).unwrap()]);
    let without = drive("f1tenth", vec![]);
    assert_eq!(with.samples.len(), without.samples.len());
    with.samples.into_iter().zip(without.samples).collect()
}

#[test]
fn every_canonical_name_is_there_and_six_more() {
    for name in CANONICAL {
        assert!(EFFECTS.iter().any(|e| e.name == name), "{name} is missing");
    }
    let more = ["cross_wind", "tire_asymmetry", "steering_map", "gusts", "camber_thrust", "drive_lag"];
    for name in more {
        assert!(EFFECTS.iter().any(|e| e.name == name), "{name} is missing");
    }
    assert_eq!(EFFECTS.len(), CANONICAL.len() + more.len());
}

#[test]
fn null_values_leave_no_trace_and_typical_ones_do() {
    for car in ["f1tenth", "race_car"] {
        let without = drive(car, vec![]);
        for effect in EFFECTS {
            let nulls: Option<Vec<f64>> = effect.parameters.iter().map(|p| p.null.or(Some(1.0))).collect();
            let sized = effect.parameters[0].null.is_some();
            if sized {
                let null = drive(car, vec![EffectSetting::new(effect.name, &nulls.unwrap()).unwrap()]);
                assert!(null.samples == without.samples, "{car}: {} leaves a trace at null", effect.name);
            }
            let typical = drive(car, vec![EffectSetting::parse(effect.name).unwrap()]);
            assert!(typical.end.is_completed(), "{car} with {}: {}", effect.name, typical.end);
            assert!(typical.samples != without.samples, "{car}: {} does nothing", effect.name);
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_run() {
    let run = |seed| {
        let mut scenario = scenario("f1tenth", vec![EffectSetting::parse("gusts").unwrap()]).seed(seed);
        scenario.sensors = SensorSettings::for_car(&scenario.car);
        scenario.sensors.odometry.dropped = 0.05;
        Simulation::new(scenario).unwrap().run(|_| {})
    };
    assert!(run(3) == run(3));
    assert!(run(3).samples != run(4).samples);
}

#[test]
fn sensor_effects_are_exact() {
    for (with, without) in both("gyro_scale=0.05") {
        if let (SensorSample::Odometry(a), SensorSample::Odometry(b)) = (with, without) {
            assert_relative_eq!(a.yaw_rate_radps, 1.05 * b.yaw_rate_radps, epsilon = 1e-12);
            assert_relative_eq!(a.v_y_mps, b.v_y_mps, epsilon = 1e-12);
        }
    }
    for (with, without) in both("v_y_lever_arm=0.07") {
        if let (SensorSample::Odometry(a), SensorSample::Odometry(b)) = (with, without) {
            assert_relative_eq!(a.v_y_mps, b.v_y_mps + 0.07 * b.yaw_rate_radps, epsilon = 1e-12);
            assert_relative_eq!((a.x_m - b.x_m).hypot(a.y_m - b.y_m), 0.07, epsilon = 1e-9);
        }
    }
    for (with, without) in both("imu_tilt=0.03") {
        if let (SensorSample::Imu(a), SensorSample::Imu(b)) = (with, without) {
            let asked = b.a_y_mps2 * 0.03_f64.cos() + 9.81 * 0.03_f64.sin();
            assert_relative_eq!(a.a_y_mps2, asked, epsilon = 1e-12);
        }
    }
    let delayed = both("odometry_delay=0.05");
    let odometry: Vec<_> = delayed
        .iter()
        .filter_map(|pair| match pair {
            (SensorSample::Odometry(a), SensorSample::Odometry(b)) => Some((a.v_y_mps, b.v_y_mps)),
            _ => None,
        })
        .collect();
    for (now, late) in odometry.iter().zip(&odometry[5..]) {
        assert_relative_eq!(late.0, now.1, epsilon = 1e-9);
    }
}

#[test]
fn steering_effects_act_between_command_and_wheels() {
    let angles = |effect: &str| {
        let course = Course::SineSweep { speed_mps: 3.0, amplitude_rad: 0.1, from_hz: 0.5, to_hz: 0.5 };
        let scenario =
            scenario("f1tenth", vec![EffectSetting::parse(effect).unwrap()]).course(course).duration(6.0);
        let recording = Simulation::new(scenario).unwrap().run(|_| {});
        let commands: Vec<f64> = recording
            .samples
            .iter()
            .filter_map(|s| if let SensorSample::Drive(d) = s { Some(d.steering_rad) } else { None })
            .collect();
        let wheels: Vec<f64> = recording.truth.iter().map(|t| t.motion.steering_rad).collect();
        (commands, wheels)
    };
    let (command, wheel) = angles("steering_delay=0.04");
    for i in 4..wheel.len() {
        assert_relative_eq!(wheel[i], command[i - 4], epsilon = 1e-12);
    }
    let (command, wheel) = angles("steering_gain=0.1");
    for (c, w) in command.iter().zip(&wheel) {
        assert_relative_eq!(*w, 1.1 * c, epsilon = 1e-12);
    }
    let (command, wheel) = angles("steering_backlash=0.02");
    for (c, w) in command.iter().zip(&wheel) {
        assert!((c - w).abs() <= 0.02 + 1e-12);
    }
    let reach = |v: &[f64]| v.iter().copied().fold(0.0, f64::max);
    assert_relative_eq!(reach(&wheel), reach(&command) - 0.02, epsilon = 1e-3);
    let (_, wheel) = angles("steering_rate_limit=0.2");
    for pair in wheel.windows(2) {
        assert!((pair[1] - pair[0]).abs() <= 0.2 * 0.01 + 1e-12);
    }
    // A slow sine comes late by the lag's time constant.
    let (command, wheel) = angles("steering_lag=0.06");
    let error = |late: usize| -> f64 { (200..600).map(|i| (wheel[i] - command[i - late]).powi(2)).sum() };
    let best = (0..20).min_by(|a, b| error(*a).total_cmp(&error(*b))).unwrap();
    assert!((5..=7).contains(&best), "late by {best} samples");
}

#[test]
fn effects_are_read_from_words() {
    let patch = EffectSetting::parse("low_grip_patch=depth:0.3,start_m:5,length_m:2").unwrap();
    assert_eq!(patch, EffectSetting::new("low_grip_patch", &[0.3, 5.0, 2.0]).unwrap());
    assert_eq!(EffectSetting::parse("aero_downforce=1e-4,2e-4").unwrap().parameters["c_r"], 2e-4);
    assert!(matches!(EffectSetting::parse("warp_drive"), Err(ReferenceCarError::UnknownName { .. })));
    assert!(matches!(
        EffectSetting::parse("gyro_bias=fast"),
        Err(ReferenceCarError::UnreadableEffect { .. })
    ));
    assert!(matches!(EffectSetting::parse("gyro_bias=tau_s:1"), Err(ReferenceCarError::UnknownName { .. })));
    assert!(matches!(EffectSetting::parse("gyro_bias=1,2"), Err(ReferenceCarError::UnreadableEffect { .. })));
    let twice =
        vec![EffectSetting::parse("gyro_bias").unwrap(), EffectSetting::parse("gyro_bias=1").unwrap()];
    assert!(matches!(
        Simulation::new(scenario("f1tenth", twice)),
        Err(ReferenceCarError::RepeatedEffect { .. })
    ));
}
