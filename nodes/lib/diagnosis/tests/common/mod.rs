//! Drives of the reference car as the diagnosis gets them.

use gripsight_diagnosis::Diagnosis;
use gripsight_reference_car::{
    CarParameters, Course, DriverKind, EffectSetting, Friction, Scenario, SensorSample, Simulation,
};
use gripsight_signals::{
    AlignConfig, Aligner, DriveSample, ImuSample, Measurement, OdometrySample, StateSequence, TelemetrySample,
};
use gripsight_vehicle::VehicleParameters;

/// The diagnosis as the terminal shows it.
#[allow(dead_code, reason = "not every user of this module shows one")]
pub(crate) fn text(diagnosis: &Diagnosis) -> String {
    gripsight_report::gap_text(diagnosis, None, &[])
}

const MU: f64 = 0.95;

/// [`drive_at`] 88 % of the grip.
#[allow(dead_code, reason = "not every user of this module drives at one pace")]
pub(crate) fn drive(
    car: &CarParameters,
    effects: &[&str],
    duration_s: f64,
    seed: u64,
) -> anyhow::Result<StateSequence> {
    drive_at(car, effects, 0.88, duration_s, seed)
}

/// One lap after the other on the club track, with steering dither.
pub(crate) fn drive_at(
    car: &CarParameters,
    effects: &[&str],
    pace: f64,
    duration_s: f64,
    seed: u64,
) -> anyhow::Result<StateSequence> {
    let mut scenario = Scenario::new(car.clone())
        .course(Course::by_name("club", car, false)?)
        .driver(DriverKind::Profile, pace)
        .dither(0.02)
        .friction(Friction::Uniform { mu: MU })
        .duration(duration_s)
        .seed(seed);
    for text in effects {
        scenario = scenario.effect(EffectSetting::parse(text)?);
    }
    let recording = Simulation::new(scenario)?.run(|_| {});
    anyhow::ensure!(recording.end.is_completed(), "the drive ended early: {}", recording.end);
    let mut aligner = Aligner::new(AlignConfig::default());
    let mut samples: Vec<TelemetrySample> = Vec::new();
    for sample in &recording.samples {
        aligner.push(measurement(sample))?;
        samples.extend(std::iter::from_fn(|| aligner.poll()));
    }
    samples.extend(std::iter::from_fn(|| aligner.drain()));
    Ok(StateSequence::from_samples(&samples)?)
}

fn measurement(sample: &SensorSample) -> Measurement {
    let stamp_ns = (sample.stamp_s() * 1e9).round() as i64;
    match sample {
        SensorSample::Odometry(s) => Measurement::Odometry(OdometrySample {
            stamp_ns,
            x_m: s.x_m,
            y_m: s.y_m,
            yaw_rad: s.heading_rad,
            v_x_mps: s.v_x_mps,
            v_y_mps: s.v_y_mps,
            yaw_rate_radps: s.yaw_rate_radps,
        }),
        SensorSample::Drive(s) => Measurement::Drive(DriveSample {
            stamp_ns,
            steering_angle_rad: s.steering_rad,
            speed_mps: s.speed_mps,
            acceleration_mps2: s.acceleration_mps2,
        }),
        SensorSample::Imu(s) => Measurement::Imu(ImuSample {
            stamp_ns,
            a_x_mps2: s.a_x_mps2,
            a_y_mps2: s.a_y_mps2,
            yaw_rate_radps: s.yaw_rate_radps,
        }),
        SensorSample::Wheels(s) => Measurement::Wheels(gripsight_signals::WheelsSample {
            stamp_ns,
            speed: s.wheel_radps,
            effort_nm: None,
        }),
    }
}

/// What the diagnosis is told of a car.
pub(crate) fn nominal(car: &CarParameters) -> VehicleParameters {
    VehicleParameters {
        name: Some(car.name.clone()),
        mass_kg: car.mass_kg,
        yaw_inertia_kgm2: car.yaw_inertia_kgm2,
        l_f_m: car.l_f_m,
        l_r_m: car.l_r_m,
        h_cg_m: car.h_cg_m,
        track_width_m: Some(car.track_width_m),
        drive_front_share: Some(car.drive.drive_front_share),
        brake_front_share: Some(car.drive.brake_front_share),
        max_steering_rad: car.max_steering_rad,
        wheel_radius_m: Some(car.drive.wheel_radius_m),
        sigma: std::collections::BTreeMap::new(),
    }
}
