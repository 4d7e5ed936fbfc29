//! Whether the signals and the car file can be what they are said to be: a wrong unit or sign looks like a gap, and no effect explains it.

use gripsight_model::{HEADING, Recording, quantile};
use gripsight_vehicle::VehicleParameters;

/// Scale of an identity from which a unit, a sign or an axis is wrong rather than a sensor's scale.
const WRONG_SCALE: f64 = 0.2;
/// How near a ratio must come to that of two units.
const NEAR: f64 = 0.08;
/// Ratios of a signal to what it should be, and what makes them.
const UNITS: [(f64, &str); 7] = [
    (-1.0, "its sign seems to be turned: x points forward, y to the left, z up"),
    (1.0 / 9.81, "it seems to be in g, or what it is compared with ten times too large"),
    (1.0 / 3.6, "the speed seems to be in km/h"),
    (180.0 / std::f64::consts::PI, "it seems to be in degrees"),
    (std::f64::consts::PI / 180.0, "what it is compared with seems to be in degrees"),
    (1e3, "it seems to be in thousandths"),
    (1e-3, "what it is compared with seems to be in thousandths"),
];
/// Steering beyond this share of the wheels' limit is none.
const MOST_STEERING: f64 = 1.5;
/// The largest steering angles and their share of the samples.
const LARGE: f64 = 0.99;
/// Correlation of steering and yaw rate below which one of them is turned.
const TURNED: f64 = -0.4;
/// Wheelbases of road vehicles and of their models.
const WHEELBASE_M: [f64; 2] = [0.05, 6.0];
/// I_z/(m l_f l_r): near 1 for cars of any size.
const INERTIA_RATIO: [f64; 2] = [0.3, 4.0];

/// What cannot be right, in sentences.
pub(crate) fn doubts(recording: &Recording, vehicle: &VehicleParameters) -> Vec<String> {
    let mut doubts = Vec::new();
    for identity in recording.identities.iter().filter(|i| i.informative && i.scale.abs() > WRONG_SCALE) {
        let ratio = 1.0 + identity.scale;
        let side = if identity.name == HEADING { "the yaw rate" } else { "the accelerometer" };
        let unit = UNITS.iter().find(|(of, _)| (ratio / of - 1.0).abs() < NEAR);
        let why = unit.map_or("a unit, an axis or a sign is wrong", |(_, why)| why);
        doubts.push(format!("{side} reads {ratio:.3} times what {} asks for: {why}", identity.name));
    }
    let steering = || recording.runs.iter().flat_map(|run| run.steering_rad.iter().copied());
    let large_rad = quantile(steering().map(f64::abs).collect(), LARGE);
    if large_rad > MOST_STEERING * vehicle.max_steering_rad {
        doubts.push(format!(
            "the steering reaches {large_rad:.2} rad, the car file's limit is {:.2} rad: degrees, or the angle of the steering wheel?",
            vehicle.max_steering_rad
        ));
    }
    let yaw_rate = || recording.runs.iter().flat_map(|run| run.smooth[1].iter().copied());
    let sum = |f: &dyn Fn(f64, f64) -> f64| steering().zip(yaw_rate()).map(|(d, r)| f(d, r)).sum::<f64>();
    let correlation = sum(&|d, r| d * r) / (sum(&|d, _| d * d) * sum(&|_, r| r * r)).sqrt().max(1e-12);
    if correlation < TURNED {
        doubts.push(
            "the car turns right where the steering says left: the sign of one of them is turned, or it drifts throughout".to_owned(),
        );
    }
    let wheelbase_m = vehicle.wheelbase_m();
    if !(WHEELBASE_M[0]..WHEELBASE_M[1]).contains(&wheelbase_m) {
        doubts.push(format!("the car file's wheelbase is {wheelbase_m:.3} m: lengths are in metres"));
    }
    let ratio = vehicle.yaw_inertia_kgm2 / (vehicle.mass_kg * vehicle.l_f_m * vehicle.l_r_m);
    if !(INERTIA_RATIO[0]..INERTIA_RATIO[1]).contains(&ratio) {
        doubts.push(format!(
            "the car file's yaw inertia is {ratio:.3} times m l_f l_r, cars have about 1: check mass, inertia and lengths"
        ));
    }
    doubts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::drive;

    #[test]
    fn wrong_units_and_signs_are_told_and_right_ones_are_not() {
        let vehicle = VehicleParameters::f1tenth();
        let right = drive(&vehicle, 0.0);
        assert_eq!(doubts(&right, &vehicle), Vec::<String>::new());
        let told = |recording: &Recording, vehicle: &VehicleParameters, what: &str| {
            let doubts = doubts(recording, vehicle);
            assert!(doubts.len() == 1 && doubts[0].contains(what), "{doubts:?}");
        };
        let steered = |factor: f64| {
            let mut recording = right.clone();
            recording.runs.iter_mut().flat_map(|r| &mut r.steering_rad).for_each(|d| *d *= factor);
            recording
        };
        told(&steered(180.0 / std::f64::consts::PI), &vehicle, "degrees");
        let mut turned = right.clone();
        turned.runs.iter_mut().for_each(|r| r.steering_rad = r.smooth[1].iter().map(|r| -0.1 * r).collect());
        told(&turned, &vehicle, "sign");
        let millimetres =
            VehicleParameters { l_f_m: 1e3 * vehicle.l_f_m, l_r_m: 1e3 * vehicle.l_r_m, ..vehicle.clone() };
        assert!(doubts(&right, &millimetres).iter().any(|d| d.contains("metres")));
        told(&right, &VehicleParameters { mass_kg: 1e3 * vehicle.mass_kg, ..vehicle.clone() }, "check mass");
        let mut read = right.clone();
        read.identities = vec![gripsight_model::Identity {
            name: "a_y = v_y' + v_x r",
            informative: true,
            offset: 0.0,
            scale: 1.0 / 9.81 - 1.0,
            rms_over_noise: 1.0,
            finding: String::new(),
        }];
        told(&read, &vehicle, "in g");
    }
}
