//! Telemetry of the reference car, and of recorded cars where they are at hand.

#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};

use gripsight_reference_car::{
    CarParameters, Course, DriverKind, EffectSetting, Friction, Recording, Scenario, Simulation,
};
use gripsight_signals::{AlignConfig, Aligner, StateSequence, WindowConfig};
use gripsight_vehicle::VehicleParameters;

/// What a data sheet says of a built-in car.
pub(crate) fn vehicle(car: &CarParameters) -> VehicleParameters {
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
        ..VehicleParameters::f1tenth()
    }
}

/// A drive on a track.
pub(crate) fn scenario(car: &str, track: &str, mu: f64, pace: f64, seed: u64) -> Scenario {
    let car = CarParameters::by_name(car).unwrap();
    let course = Course::by_name(track, &car, seed % 2 == 1).unwrap();
    Scenario::new(car)
        .course(course)
        .driver(DriverKind::PurePursuit, pace)
        .friction(Friction::Uniform { mu })
        .seed(seed)
}

/// The same with the background that every real car has.
pub(crate) fn with_background(scenario: Scenario) -> Scenario {
    ["tire_relaxation", "lateral_load_transfer", "longitudinal_load_transfer", "combined_slip"]
        .iter()
        .fold(scenario, |s, name| s.effect(EffectSetting::parse(name).unwrap()))
}

/// Drives it.
pub(crate) fn drive(scenario: Scenario) -> (Recording, StateSequence, VehicleParameters) {
    let vehicle = vehicle(&scenario.car);
    let recording = Simulation::new(scenario).unwrap().run(|_| {});
    let mut aligner = Aligner::new(AlignConfig::default());
    let mut samples = Vec::new();
    for sample in &recording.samples {
        aligner.push(sample.measurement(1_000_000_000)).unwrap();
        while let Some(aligned) = aligner.poll() {
            samples.push(aligned);
        }
    }
    while let Some(aligned) = aligner.drain() {
        samples.push(aligned);
    }
    (recording, StateSequence::from_samples(&samples).unwrap(), vehicle)
}

/// A recorded bag, or `None` (said aloud) where the recordings are not at hand.
pub(crate) fn recorded(name: &str, length_s: f64) -> Option<(StateSequence, VehicleParameters)> {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../../shared/bags")).join(name);
    if !folder.exists() {
        println!("skipped: no recording {}", folder.display());
        return None;
    }
    Some(read(&folder.join(format!("{name}.mcap")), &folder.join("vehicle.yaml"), length_s))
}

/// A demo bag of this repository.
pub(crate) fn demo(name: &str) -> (StateSequence, VehicleParameters) {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../bags"));
    let [bag, vehicle] = ["mcap", "vehicle.yaml"].map(|end| folder.join(format!("{name}.{end}")));
    read(&bag, &vehicle, f64::INFINITY)
}

/// The first window of a bag.
fn read(bag: &Path, vehicle: &Path, length_s: f64) -> (StateSequence, VehicleParameters) {
    let vehicle = VehicleParameters::from_ros_yaml(&std::fs::read_to_string(vehicle).unwrap()).unwrap();
    let window = WindowConfig { length_s, hop_s: length_s };
    let (mut sequences, _) =
        gripsight_bag::read_sequences(bag, &gripsight_bag::TopicMap::default(), window).unwrap();
    (sequences.swap_remove(0), vehicle)
}
