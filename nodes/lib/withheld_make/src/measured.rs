//! Drives that others made: recorded bags, and plants that this project did not write. Effects of sensors and actuators are put
//! into them exactly, by the code of `gripsight bag inject`; what they have of their own is the background.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use gripsight_bag::effect::{Effect, Series};
use gripsight_bag::{TopicMap, read_measurements};
use gripsight_reference_car::EffectSetting;
use gripsight_signals::Measurement;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::drive::{MARGIN_S, cut, ns};
use crate::tires::{Axle, fitted};
use crate::{WithheldError, files};

/// A folder of drives, and how many cases are made of them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeasuredDrives {
    /// Folder with a folder for every drive: one `.mcap` file, `vehicle.yaml`; optionally `truth_axle_forces.csv`, of which the
    /// tires are made that are handed over, and `about.json`, whose `contained` lists the effects that the drive has of its own.
    pub folder: PathBuf,
    /// Cases.
    pub cases: usize,
}

/// One drive, read.
#[derive(Debug, Clone)]
pub(crate) struct MeasuredDrive {
    pub(crate) name: String,
    pub(crate) contained: Vec<String>,
    pub(crate) vehicle: String,
    pub(crate) wheelbase_m: f64,
    pub(crate) axles: Option<[Axle; 2]>,
    path: PathBuf,
    measurements: Vec<Measurement>,
}

/// The parts of vehicle.yaml that matter here.
struct Car {
    l_f_m: f64,
    l_r_m: f64,
    mass_kg: f64,
}

const TRUTH: &str = "truth_axle_forces.csv";
const GRAVITY_MPS2: f64 = 9.81;

/// Reads all drives of a folder, by name.
pub(crate) fn read(folder: &Path, with_tires: bool) -> Result<Vec<MeasuredDrive>, WithheldError> {
    let mut folders: Vec<PathBuf> = fs::read_dir(folder)
        .map_err(WithheldError::io(folder))?
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .filter(|path| path.is_dir())
        .collect();
    folders.sort();
    let drives: Vec<MeasuredDrive> = folders.iter().map(|f| one(f, with_tires)).collect::<Result<_, _>>()?;
    if drives.is_empty() {
        let why =
            "no drive there: expected a folder for each, with its .mcap file and vehicle.yaml".to_owned();
        return Err(WithheldError::Source { path: folder.to_owned(), why });
    }
    Ok(drives)
}

fn one(folder: &Path, with_tires: bool) -> Result<MeasuredDrive, WithheldError> {
    let refuse = |why: &str| WithheldError::Source { path: folder.to_owned(), why: why.to_owned() };
    let bag = fs::read_dir(folder)
        .map_err(WithheldError::io(folder))?
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .find(|path| path.extension().is_some_and(|e| e == "mcap"))
        .ok_or_else(|| refuse("it holds no .mcap file"))?;
    let path = folder.join(files::VEHICLE);
    let vehicle = fs::read_to_string(&path).map_err(WithheldError::io(&path))?;
    let number = |key: &str| {
        let line = vehicle.lines().find_map(|l| l.trim().strip_prefix(key)?.strip_prefix(':'));
        let value = line.and_then(|v| v.trim().parse::<f64>().ok());
        value.ok_or_else(|| WithheldError::content(&path, &format!("{key} is missing")))
    };
    let car = Car { l_f_m: number("l_f_m")?, l_r_m: number("l_r_m")?, mass_kg: number("mass_kg")? };
    let truth = folder.join(TRUTH);
    let axles = (with_tires && truth.exists()).then(|| true_axles(&truth, &car)).transpose()?;
    let about = folder.join("about.json");
    let contained = if about.exists() {
        let text = fs::read_to_string(&about).map_err(WithheldError::io(&about))?;
        let value: BTreeMap<String, Value> =
            serde_json::from_str(&text).map_err(|e| WithheldError::content(&about, &e))?;
        let names = value.get("contained").cloned().unwrap_or_else(|| Value::Array(Vec::new()));
        serde_json::from_value(names).map_err(|e| WithheldError::content(&about, &e))?
    } else {
        Vec::new()
    };
    let (measurements, _) = read_measurements(&bag, &TopicMap::default())?;
    Ok(MeasuredDrive {
        name: folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        contained,
        wheelbase_m: car.l_f_m + car.l_r_m,
        vehicle,
        axles,
        path: bag,
        measurements,
    })
}

/// The Magic Formula of the axle forces that the plant's author wrote down, over static loads.
fn true_axles(path: &Path, car: &Car) -> Result<[Axle; 2], WithheldError> {
    let content = |why: String| WithheldError::content(path, &why);
    let mut reader = csv::Reader::from_path(path).map_err(|e| content(e.to_string()))?;
    let weight_n = car.mass_kg * GRAVITY_MPS2 / (car.l_f_m + car.l_r_m);
    let (mut front, mut rear) = (Vec::new(), Vec::new());
    for row in reader.deserialize::<BTreeMap<String, f64>>() {
        let row = row.map_err(|e| content(e.to_string()))?;
        let get = |name: &str| row.get(name).copied().ok_or_else(|| content(format!("no column {name}")));
        let (v_x, v_y, rate) = (get("v_x_mps")?, get("v_y_mps")?, get("yaw_rate_radps")?);
        let alpha_f = get("steering_rad")? - ((v_y + car.l_f_m * rate) / v_x).atan();
        let alpha_r = -((v_y - car.l_r_m * rate) / v_x).atan();
        front.push((alpha_f, get("f_y_front_n")? / (weight_n * car.l_r_m)));
        rear.push((alpha_r, get("f_y_rear_n")? / (weight_n * car.l_f_m)));
    }
    Ok([fitted(&front), fitted(&rear)])
}

impl MeasuredDrive {
    /// Whether an effect can be put into it.
    pub(crate) fn takes(&self, effect: &Effect) -> bool {
        let role = effect.stream().name();
        self.measurements.iter().any(|m| m.stream() == role)
    }

    /// A setting whose effect leaves no trace in the stamps: a delay of the command is made a multiple of its period, so that the
    /// stamps of command and odometry lie to each other as they did.
    pub(crate) fn unseen(&self, mut setting: EffectSetting) -> EffectSetting {
        let period_s = self.command_period_s();
        if setting.name == "steering_delay" && period_s > 0.0 {
            for delay_s in setting.parameters.values_mut() {
                *delay_s = (*delay_s / period_s).round().max(1.0) * period_s;
            }
        }
        setting
    }

    /// Middle one of the steps between drive commands.
    fn command_period_s(&self) -> f64 {
        let commands = self.measurements.iter().filter(|m| matches!(m, Measurement::Drive(_)));
        let stamps: Vec<i64> = commands.map(Measurement::stamp_ns).collect();
        let mut steps: Vec<i64> = stamps.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_unstable();
        steps.get(steps.len() / 2).map_or(0.0, |step| *step as f64 / gripsight_signals::NS_PER_S)
    }

    /// Two stretches of the drive, each with its effects put in; they do not overlap, or are one and the `same`.
    pub(crate) fn stretches(
        &self,
        effects: [&[Effect]; 2],
        same: bool,
        duration_s: f64,
        random: &mut ChaCha8Rng,
    ) -> Result<[Vec<Measurement>; 2], WithheldError> {
        let stamps = self.measurements.iter().map(Measurement::stamp_ns);
        let (first, last) = (stamps.clone().min().unwrap_or(0), stamps.max().unwrap_or(0));
        let margin_ns = ns(MARGIN_S);
        let spare_ns = last - first - 2 * ns(duration_s) - 3 * margin_ns;
        if spare_ns < 0 {
            let why = format!(
                "{:.0} s are too short for two stretches of {duration_s} s",
                (last - first) as f64 * 1e-9
            );
            return Err(WithheldError::Source { path: self.path.clone(), why });
        }
        let early = first + margin_ns + random.random_range(0..=spare_ns / 2);
        let late = early + ns(duration_s) + margin_ns + random.random_range(0..=spare_ns / 2);
        let mut from = [early, late];
        if random.random_bool(0.5) {
            from.reverse();
        }
        if same {
            from[1] = from[0];
        }
        let stretch = |i: usize| cut(&injected(&self.measurements, effects[i]), from[i], duration_s);
        Ok([stretch(0), stretch(1)])
    }
}

/// The effect as the code of `gripsight bag inject` knows it.
pub(crate) fn effect(setting: &EffectSetting) -> Result<Effect, WithheldError> {
    let values: Vec<String> =
        setting.parameters.iter().map(|(name, value)| format!("{name}:{value:?}")).collect();
    Ok(format!("{}={}", setting.name, values.join(",")).parse()?)
}

fn injected(measurements: &[Measurement], effects: &[Effect]) -> Vec<Measurement> {
    let mut series = Series::default();
    let mut wheels = Vec::new();
    for measurement in measurements {
        match measurement {
            Measurement::Odometry(m) => series.odometry.push(*m),
            Measurement::Drive(m) => series.drive.push(*m),
            Measurement::Imu(m) => series.imu.push(*m),
            Measurement::Wheels(m) => wheels.push(*m),
            Measurement::Mapped(_) => {}
        }
    }
    effects.iter().for_each(|effect| effect.apply(&mut series));
    let odometry = series.odometry.into_iter().map(Measurement::Odometry);
    let drive = series.drive.into_iter().map(Measurement::Drive);
    let imu = series.imu.into_iter().map(Measurement::Imu);
    odometry.chain(drive).chain(imu).chain(wheels.into_iter().map(Measurement::Wheels)).collect()
}
