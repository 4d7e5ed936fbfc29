//! Localisations, and signals that lie.

use gripsight_identification::PerAxle;
use gripsight_signals::StateSequence;
use gripsight_vehicle::{MagicFormula, PacejkaParameters, SingleTrack, State, VehicleParameters};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

/// A localisation with a topic of its own.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Localisation {
    rate_hz: f64,
    position_m: f64,
    heading_rad: f64,
    pub(crate) delay_s: f64,
    /// Every so many seconds it jumps and stays; infinite: never.
    jumps_every_s: f64,
    /// Whether the inertial unit is recorded.
    imu: bool,
}

const EXACT: Localisation = Localisation {
    rate_hz: 100.0,
    position_m: 0.001,
    heading_rad: 0.001,
    delay_s: 0.0,
    jumps_every_s: f64::INFINITY,
    imu: true,
};

/// The kinds tried.
pub(crate) const LOCALISATIONS: [(&str, Localisation); 4] = [
    ("motion capture 1 mm", EXACT),
    ("motion capture 1 mm; no IMU", Localisation { imu: false, ..EXACT }),
    (
        "40 Hz 2 cm 0.5 deg 50 ms",
        Localisation { rate_hz: 40.0, position_m: 0.02, heading_rad: 0.0087, delay_s: 0.05, ..EXACT },
    ),
    (
        "40 Hz 3 cm 1 deg 50 ms jumps",
        Localisation {
            rate_hz: 40.0,
            position_m: 0.03,
            heading_rad: 0.0175,
            delay_s: 0.05,
            jumps_every_s: 15.0,
            ..EXACT
        },
    ),
];

/// The sequence with the poses of a localisation in place of the odometry's.
pub(crate) fn localised(sequence: &StateSequence, l: Localisation, seed: u64) -> StateSequence {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = |sigma: f64| Normal::new(0.0, sigma).map_or(0.0, |n| n.sample(&mut random));
    let mut s = sequence.clone();
    let (x, y, yaw) =
        (std::mem::take(&mut s.x_m), std::mem::take(&mut s.y_m), std::mem::take(&mut s.yaw_rad));
    if !l.imu {
        (s.a_x_mps2, s.a_y_mps2, s.gyro_yaw_rate_radps) = Default::default();
    }
    let mut next_s = 0.0;
    let (mut shift, mut turn, mut jump_s) = ([0.0_f64; 2], 0.0_f64, l.jumps_every_s);
    for (k, &t) in sequence.time_s.iter().enumerate() {
        let t = f64::from(t);
        if t < next_s {
            continue;
        }
        next_s += 1.0 / l.rate_hz;
        if t > jump_s {
            jump_s += l.jumps_every_s;
            shift = [shift[0] + noise(0.3), shift[1] + noise(0.3)];
            turn += noise(0.03);
        }
        // A map that jumps turns about its origin.
        let (sin, cos) = turn.sin_cos();
        let (px, py) = (f64::from(x[k]), f64::from(y[k]));
        s.pose_time_s.push((t + l.delay_s) as f32);
        s.pose_x_m.push((cos * px - sin * py + shift[0] + noise(l.position_m)) as f32);
        s.pose_y_m.push((sin * px + cos * py + shift[1] + noise(l.position_m)) as f32);
        s.pose_yaw_rad.push((f64::from(yaw[k]) + turn + noise(l.heading_rad)) as f32);
    }
    s
}

/// v_y as an observer gives it: the single-track model on tires this much stiffer than the truth, driven by the recorded steering and v_x, corrected
/// slowly by the yaw rate.
fn observed(
    sequence: &StateSequence,
    vehicle: &VehicleParameters,
    truth: &PerAxle<MagicFormula>,
    stiffer: f64,
) -> Vec<f32> {
    let axle = |t: &MagicFormula| MagicFormula { b: t.b * stiffer, ..*t };
    let car =
        SingleTrack::new(vehicle, &PacejkaParameters { front: axle(&truth.front), rear: axle(&truth.rear) });
    let mut state = State { v_y_mps: 0.0, yaw_rate_radps: 0.0 };
    let mut out = Vec::with_capacity(sequence.len());
    for k in 0..sequence.len() {
        let dt = if k > 0 { f64::from(sequence.time_s[k] - sequence.time_s[k - 1]) } else { 0.0 };
        let input = gripsight_vehicle::Input {
            v_x_mps: f64::from(sequence.v_x_mps[k]).max(0.5),
            steering_rad: sequence.steering_rad[k].into(),
        };
        let steps = 10;
        for _ in 0..steps {
            let d = car.derivative(&state, &input);
            state.v_y_mps += d.v_y_mps * dt / f64::from(steps);
            state.yaw_rate_radps += d.yaw_rate_radps * dt / f64::from(steps);
        }
        state.yaw_rate_radps += 0.3 * (f64::from(sequence.yaw_rate_radps[k]) - state.yaw_rate_radps);
        out.push(state.v_y_mps as f32);
    }
    out
}

/// What each lie does to a sequence.
pub(crate) fn lies(
    sequence: &StateSequence,
    vehicle: &VehicleParameters,
    truth: &PerAxle<MagicFormula>,
    seed: u64,
) -> Vec<(String, StateSequence)> {
    let scaled = |v: &mut Vec<f32>, by: f32| v.iter_mut().for_each(|v| *v *= by);
    let stiff = observed(sequence, vehicle, truth, 1.6);
    type Lie<'a> = (&'a str, Box<dyn Fn(&mut StateSequence) + 'a>);
    let all: Vec<Lie<'_>> = vec![
        ("honest", Box::new(|_| {})),
        ("v_y of an observer 60 % too stiff", Box::new(|s| s.v_y_mps.clone_from(&stiff))),
        ("v_x times 1.1", Box::new(|s| scaled(&mut s.v_x_mps, 1.1))),
        ("v_x times 0.9", Box::new(|s| scaled(&mut s.v_x_mps, 0.9))),
        ("steering times 0.8", Box::new(|s| steer(s, 0.8))),
        ("yaw rate times 1.1", Box::new(|s| scaled(&mut s.yaw_rate_radps, 1.1))),
        (
            "yaw rate and gyroscope times 1.1",
            Box::new(|s| {
                scaled(&mut s.yaw_rate_radps, 1.1);
                scaled(&mut s.gyro_yaw_rate_radps, 1.1);
            }),
        ),
        ("v_y turned", Box::new(|s| scaled(&mut s.v_y_mps, -1.0))),
        ("yaw rate turned", Box::new(|s| scaled(&mut s.yaw_rate_radps, -1.0))),
        ("steering turned", Box::new(|s| steer(s, -1.0))),
        ("steering in degrees", Box::new(|s| steer(s, 57.295_78))),
        ("v_x in km/h", Box::new(|s| scaled(&mut s.v_x_mps, 3.6))),
        (
            "inertial unit in g and deg/s",
            Box::new(|s| {
                scaled(&mut s.a_x_mps2, 1.0 / 9.806_65);
                scaled(&mut s.a_y_mps2, 1.0 / 9.806_65);
                scaled(&mut s.gyro_yaw_rate_radps, 57.295_78);
            }),
        ),
    ];
    let mut out = Vec::new();
    for (beside, localisation) in
        [("poses and IMU", Some(LOCALISATIONS[2].1)), ("IMU", None), ("nothing", None)]
    {
        for (name, lie) in &all {
            let mut s = match localisation {
                Some(localisation) => localised(sequence, localisation, seed),
                None => sequence.clone(),
            };
            if localisation.is_none() {
                (s.x_m, s.y_m, s.yaw_rad) = Default::default();
            }
            if beside == "nothing" {
                (s.a_x_mps2, s.a_y_mps2, s.gyro_yaw_rate_radps) = Default::default();
                if name.contains("inertial") {
                    continue;
                }
            }
            lie(&mut s);
            out.push((format!("{name}; beside it {beside}"), s));
        }
    }
    out
}

fn steer(s: &mut StateSequence, by: f32) {
    s.steering_rad.iter_mut().chain(&mut s.command_steering_rad).for_each(|v| *v *= by);
}
