//! What the examples share: runs with their truth, and the score against it.

pub(crate) mod picture;

use std::path::Path;

use anyhow::{Context, Result};
use gripsight_bag::{TopicMap, read_sequences};
use gripsight_identification::nelder_mead::{NelderMeadConfig, minimize};
use gripsight_identification::{PerAxle, tires::BOUNDS};
use gripsight_reference_car::Recording;
use gripsight_signals::{StateSequence, WindowConfig};
use gripsight_vehicle::{MagicFormula, PacejkaParameters, VehicleParameters};

/// True slips and normalised forces of an axle.
#[derive(Debug, Clone, Default)]
pub(crate) struct Truth {
    pub(crate) slip_rad: Vec<f64>,
    pub(crate) force: Vec<f64>,
    pub(crate) mean_load_n: f64,
}

impl Truth {
    /// Adds a lateral force and the load under it.
    fn push(&mut self, lateral_n: f64, load_n: f64) {
        self.force.push(lateral_n / load_n);
        self.mean_load_n += (load_n - self.mean_load_n) / self.force.len() as f64;
    }
}

/// A run with its truth.
pub(crate) struct Run {
    pub(crate) name: String,
    pub(crate) vehicle: VehicleParameters,
    pub(crate) sequence: StateSequence,
    pub(crate) truth: PerAxle<Truth>,
}

#[path = "../../tests/identification/support.rs"]
pub(crate) mod reference;

/// A drive of the reference car with its truth: `CAR TRACK MU PACE SEED`, all background effects on if asked.
pub(crate) fn reference_run(car: &str, track: &str, mu: f64, pace: f64, seed: u64, background: bool) -> Run {
    let plain = reference::scenario(car, track, mu, pace, seed);
    let scenario = if background { reference::with_background(plain) } else { plain };
    let (recording, sequence, vehicle) = reference::drive(scenario);
    let truth = truth_of(&recording, &vehicle);
    Run { name: format!("{car} {track} mu {mu} pace {pace} seed {seed}"), vehicle, sequence, truth }
}

/// What the plant's axles did, at the slips of the single-track car.
pub(crate) fn truth_of(recording: &Recording, vehicle: &VehicleParameters) -> PerAxle<Truth> {
    let mut truth = PerAxle::<Truth>::default();
    for t in &recording.truth {
        let m = &t.motion;
        if m.v_x_mps < 1.0 {
            continue;
        }
        let (f, r) = (t.front_axle_n(), t.rear_axle_n());
        truth
            .front
            .slip_rad
            .push(m.steering_rad - ((m.v_y_mps + vehicle.l_f_m * m.yaw_rate_radps) / m.v_x_mps).atan());
        truth.rear.slip_rad.push(-((m.v_y_mps - vehicle.l_r_m * m.yaw_rate_radps) / m.v_x_mps).atan());
        truth.front.push(f[1], f[2]);
        truth.rear.push(r[1], r[2]);
    }
    truth
}

/// The first window of a bag folder (`NAME/NAME.mcap`, `vehicle.yaml`).
pub(crate) fn read(folder: &Path, length_s: f64) -> Result<(VehicleParameters, StateSequence)> {
    let name = folder.file_name().context("no folder")?.to_string_lossy().into_owned();
    let vehicle = VehicleParameters::from_ros_yaml(&std::fs::read_to_string(folder.join("vehicle.yaml"))?)?;
    let window = WindowConfig { length_s, hop_s: length_s };
    let (sequences, _) = read_sequences(&folder.join(format!("{name}.mcap")), &TopicMap::default(), window)?;
    Ok((vehicle, sequences.into_iter().next().context("no sequence")?))
}

/// A bag folder with `truth_axle_forces.csv`.
pub(crate) fn read_with_truth(folder: &Path, length_s: f64) -> Result<Run> {
    let (vehicle, sequence) = read(folder, length_s)?;
    let mut truth = PerAxle::<Truth>::default();
    let mut csv = csv::Reader::from_path(folder.join("truth_axle_forces.csv"))?;
    let header = csv.headers()?.clone();
    let column = |name: &str| header.iter().position(|h| h == name);
    let wanted = ["stamp_s", "f_y_front_n", "f_y_rear_n"].map(|n| column(n).unwrap_or(0));
    let optional =
        ["f_z_front_n", "f_z_rear_n", "v_x_mps", "v_y_mps", "yaw_rate_radps", "steering_rad"].map(column);
    let mut at = 0;
    for row in csv.records() {
        let row = row?;
        let get = |i: usize| row[i].trim().parse::<f64>();
        let stamp_ns = (get(wanted[0])? * 1e9).round() as i64;
        let time_s = (stamp_ns - sequence.start_stamp_ns) as f64 * 1e-9;
        let maybe = |i: Option<usize>| i.map(get).transpose();
        let (v_x, v_y, yaw_rate, steering, loads);
        if let (Some(vx), Some(vy), Some(r), Some(d)) =
            (maybe(optional[2])?, maybe(optional[3])?, maybe(optional[4])?, maybe(optional[5])?)
        {
            (v_x, v_y, yaw_rate, steering) = (vx, vy, r, d);
            loads = [maybe(optional[0])?.unwrap_or(1.0), maybe(optional[1])?.unwrap_or(1.0)];
        } else {
            // No true states: the odometry at that stamp, and the static loads of the mass that the forces imply.
            while at + 1 < sequence.len() && f64::from(sequence.time_s[at]) < time_s - 1e-3 {
                at += 1;
            }
            if (f64::from(sequence.time_s[at]) - time_s).abs() > 1e-3 {
                continue;
            }
            (v_x, v_y) = (f64::from(sequence.v_x_mps[at]), f64::from(sequence.v_y_mps[at]));
            (yaw_rate, steering) =
                (f64::from(sequence.yaw_rate_radps[at]), f64::from(sequence.steering_rad[at]));
            let scale = 2033.0 / vehicle.mass_kg;
            loads = [vehicle.static_load_front_n() * scale, vehicle.static_load_rear_n() * scale];
        }
        if time_s > sequence.duration_s() || v_x < 1.0 {
            continue;
        }
        truth.front.slip_rad.push(steering - ((v_y + vehicle.l_f_m * yaw_rate) / v_x).atan());
        truth.rear.slip_rad.push(-((v_y - vehicle.l_r_m * yaw_rate) / v_x).atan());
        truth.front.push(get(wanted[1])?, loads[0]);
        truth.rear.push(get(wanted[2])?, loads[1]);
    }
    Ok(Run {
        name: folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        vehicle,
        sequence,
        truth,
    })
}

/// The same with the car's weight shared between the axles as the vehicle's l_f and l_r share it. A plant whose wheels carry at rest what the lever
/// arms of its yaw equation do not allow shows that in no motion.
pub(crate) fn balanced(truth: &PerAxle<Truth>, vehicle: &VehicleParameters) -> PerAxle<Truth> {
    let weight_n = truth.front.mean_load_n + truth.rear.mean_load_n;
    let axle = |t: &Truth, share: f64| {
        let mean_load_n = share * weight_n;
        let force = t.force.iter().map(|f| f * t.mean_load_n / mean_load_n).collect();
        Truth { slip_rad: t.slip_rad.clone(), force, mean_load_n }
    };
    let front_share = vehicle.l_r_m / vehicle.wheelbase_m();
    PerAxle { front: axle(&truth.front, front_share), rear: axle(&truth.rear, 1.0 - front_share) }
}

/// Root mean square error of F_y/F_z of an axle.
pub(crate) fn rmse(axle: &MagicFormula, truth: &Truth) -> f64 {
    let errors =
        truth.slip_rad.iter().zip(&truth.force).map(|(&a, f)| (axle.normalized_force(a) - f).powi(2));
    (errors.sum::<f64>() / truth.force.len() as f64).sqrt()
}

/// The best that four parameters can do: fitted to the true forces, from several starts.
pub(crate) fn floor(truth: &Truth) -> Result<(MagicFormula, f64)> {
    let axle = |x: &[f64]| MagicFormula { b: x[0], c: x[1], d: x[2], e: x[3] };
    let config = NelderMeadConfig { max_evaluations: 2000, ..NelderMeadConfig::default() };
    // A part of the samples says where; all say how much.
    let thin = Truth {
        slip_rad: truth.slip_rad.iter().copied().step_by(5).collect(),
        force: truth.force.iter().copied().step_by(5).collect(),
        ..*truth
    };
    let mut best = (axle(&[10.0, 1.4, 1.0, 0.0]), f64::INFINITY);
    for start in [[4.0, 1.3, 0.6, 0.0], [10.0, 1.4, 1.0, 0.0], [20.0, 1.8, 1.2, -1.0]] {
        let found = minimize(|x| rmse(&axle(x), &thin), &start, &BOUNDS, &config)?;
        if found.cost < best.1 {
            best = (axle(&found.x), found.cost);
        }
    }
    Ok((best.0, rmse(&best.0, truth)))
}

/// RMSE front and rear.
pub(crate) fn score(tires: &PacejkaParameters, truth: &PerAxle<Truth>) -> [f64; 2] {
    [rmse(&tires.front, &truth.front), rmse(&tires.rear, &truth.rear)]
}
