//! The reference car as a simulator: the figures that are its parameters, and cars that are it with some of them changed.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use gripsight_reference_car::{Course, EffectSetting, Scenario, SensorSettings};
use rand::RngExt;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

use crate::batch::files;
use crate::draw::{self, Pool};
use crate::label::{CaseLabel, Family, Kind, OracleFit, SealedEffect};
use crate::oracle::{change_severities, structure_excess};
use crate::pairs::{AROUND, LEAST_EXCESS, LEAST_SEVERITY, SMALLEST, TRIES, around};
use crate::plan::Planned;
use crate::{WithheldError, drive};

/// A figure of the reference car that is a parameter of it as a simulator.
pub struct Figure {
    /// Its name.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Where in the car it acts.
    pub site: &'static str,
    /// Bounds and the largest change, as shares of its value.
    pub low: f64,
    /// The most.
    pub high: f64,
    change: f64,
    get: fn(&Scenario) -> Option<f64>,
    set: fn(&mut Scenario, f64),
}

impl Figure {
    /// Its value; none where the car has no such thing.
    #[must_use]
    pub fn of(&self, scenario: &Scenario) -> Option<f64> {
        (self.get)(scenario)
    }

    /// Gives it another value.
    pub fn put(&self, scenario: &mut Scenario, value: f64) {
        (self.set)(scenario, value);
    }
}

macro_rules! figure {
    ($name:literal, $unit:literal, $site:literal, [$low:literal, $high:literal], $change:literal, $($field:ident).+) => {
        Figure {
            name: $name,
            unit: $unit,
            site: $site,
            low: $low,
            high: $high,
            change: $change,
            get: |s| Some(s.car.$($field).+),
            set: |s, v| s.car.$($field).+ = v,
        }
    };
}

const RELAXATION: &str = "tire_relaxation";

/// The figures.
pub const FIGURES: [Figure; 9] = [
    figure!("mass_kg", "kg", "loads_and_body", [0.6, 1.6], 1.3, mass_kg),
    figure!("yaw_inertia_kgm2", "kg m2", "loads_and_body", [0.4, 2.5], 1.5, yaw_inertia_kgm2),
    figure!("l_f_m", "m", "loads_and_body", [0.7, 1.4], 0.88, l_f_m),
    figure!("l_r_m", "m", "loads_and_body", [0.7, 1.4], 0.88, l_r_m),
    figure!(
        "front_stiffness_per_rad",
        "1/rad",
        "front_axle",
        [0.4, 2.0],
        0.7,
        tire_front.cornering_stiffness_per_rad
    ),
    figure!(
        "rear_stiffness_per_rad",
        "1/rad",
        "rear_axle",
        [0.4, 2.0],
        1.4,
        tire_rear.cornering_stiffness_per_rad
    ),
    figure!("front_grip", "1", "front_axle", [0.5, 1.6], 0.8, tire_front.grip),
    figure!("rear_grip", "1", "rear_axle", [0.5, 1.6], 1.2, tire_rear.grip),
    Figure {
        name: "relaxation_m",
        unit: "m",
        site: "front_axle",
        low: 0.05,
        high: 5.0,
        change: 2.5,
        get: |s| s.effects.iter().find(|e| e.name == RELAXATION)?.parameters.get("sigma_m").copied(),
        set: |s, v| {
            for effect in s.effects.iter_mut().filter(|e| e.name == RELAXATION) {
                effect.parameters.insert("sigma_m".to_owned(), v);
            }
        },
    },
];

/// What a car has beyond a plain double track.
const TRANSIENTS: [&str; 4] =
    [RELAXATION, "lateral_load_transfer", "longitudinal_load_transfer", "combined_slip"];

/// The simulator's car in a folder: everything but its figures.
pub const CAR: &str = "car.json";
const FIGURES_FILE: &str = "parameters.yaml";

/// Makes a pair in a folder: the car is the simulator with something changed.
pub(crate) fn pair(
    case: String,
    planned: &Planned,
    duration_s: f64,
    folder: &Path,
    random: &mut ChaCha8Rng,
) -> Result<CaseLabel, WithheldError> {
    let run_s = duration_s + 2.0 * drive::MARGIN_S;
    for _ in 0..TRIES {
        let draw::Drive { scenario: mut given, mut circumstances, .. } =
            draw::drive(Pool::Development, run_s, random)?;
        given.effects = given.car.own_effects(given.friction.nominal());
        given.effects.retain(|e| TRANSIENTS.contains(&e.name.as_str()));
        given.sensors = plain(given.sensors);
        let (changes, cars) = changed(&given, planned.kind, random)?;
        let Some(car) = cars.first() else { continue };
        let mut held_out = draw::another(car, random);
        held_out.sensors = given.sensors;
        let (Ok(first), Ok(second)) = (drive::driven(car)?, drive::driven(&held_out)?) else { continue };
        let severities = change_severities(car, &cars[1..])?;
        if severities.iter().any(|(severity, _)| *severity < LEAST_SEVERITY) {
            continue;
        }
        if planned.kind == Kind::OutOfLibrary {
            given.effects.clear();
            let others = other_figures(&given)?;
            let excess = structure_excess(car, &given, &others)?;
            if excess < LEAST_EXCESS {
                continue;
            }
            circumstances.insert("excess".to_owned(), excess.into());
        }
        drive::write(&folder.join(files::BAG), &drive::between_margins(&first, duration_s))?;
        drive::write(&folder.join(files::HELD_OUT), &drive::between_margins(&second, duration_s))?;
        write_simulator(given, folder)?;
        let name = circumstances.insert("simulator".to_owned(), "reference_car".into());
        debug_assert!(name.is_none(), "no circumstance is lost");
        let effects = changes.into_iter().zip(severities);
        let effects = effects.map(|((name, key, value), (severity, chi2_per_residual))| {
            let parameters = BTreeMap::from([(key, value)]);
            let oracle = OracleFit { severity, size_ratio: 1.0, chi2_per_residual, excess_without: None };
            SealedEffect { name, library_parameters: parameters.clone(), parameters, oracle: Some(oracle) }
        });
        return Ok(CaseLabel {
            case,
            family: Family::Simulator,
            compared: false,
            kind: planned.kind,
            effects: effects.collect(),
            without: Vec::new(),
            race_pace: true,
            contained: Vec::new(),
            circumstances,
        });
    }
    Err(WithheldError::NothingShows {
        simulator: "reference_car".to_owned(),
        tries: TRIES,
        severity: LEAST_SEVERITY,
    })
}

/// The simulator with another figure each, and with an effect around it each.
fn other_figures(given: &Scenario) -> Result<Vec<Scenario>, WithheldError> {
    const STEP: f64 = 0.02;
    let mut out = Vec::new();
    for (figure, value) in FIGURES.iter().filter_map(|f| Some((f, f.of(given)?))) {
        let mut other = given.clone();
        figure.put(&mut other, value * (1.0 + STEP));
        out.push(other);
    }
    for effect in AROUND {
        out.push(given.clone().effect(EffectSetting::new(effect, &[0.01])?));
    }
    Ok(out)
}

/// White noise alone, every sample there: what the simulators of others are recorded with.
fn plain(sensors: SensorSettings) -> SensorSettings {
    let exact = SensorSettings::exact();
    let white = gripsight_reference_car::Noise::white;
    SensorSettings {
        position: white(sensors.position.white),
        heading: white(sensors.heading.white),
        v_x: white(sensors.v_x.white),
        v_y: white(sensors.v_y.white),
        yaw_rate: white(sensors.yaw_rate.white),
        acceleration: white(sensors.acceleration.white),
        wheel_speed: white(sensors.wheel_speed.white),
        ..exact
    }
}

/// Name of a change in gap.json, name of its size, its value.
type Change = (String, String, f64);

/// Changes, and the cars: with all of them, then with each left out.
fn changed(
    given: &Scenario,
    kind: Kind,
    random: &mut ChaCha8Rng,
) -> Result<(Vec<Change>, Vec<Scenario>), WithheldError> {
    let count = match kind {
        Kind::Single => 1,
        Kind::Pair => 2,
        _ => 0,
    };
    let mut changes: Vec<Change> = Vec::new();
    while changes.len() < count {
        let amount: f64 = random.random_range(SMALLEST.ln()..0.0_f64).exp();
        let change = if random.random_bool(0.6) {
            let Some((figure, value)) = FIGURES.choose(random).and_then(|f| Some((f, f.of(given)?))) else {
                continue;
            };
            let name = format!("simulator.{}", figure.name);
            (name, figure.name.to_owned(), value * figure.change.powf(amount))
        } else {
            let Some(effect) = AROUND.choose(random) else { continue };
            let (key, value) = around(effect, given.car.wheelbase_m() > 1.0, random);
            ((*effect).to_owned(), key.to_owned(), value)
        };
        if changes.iter().all(|other| other.0 != change.0) {
            changes.push(change);
        }
    }
    let with = |left_out: Option<usize>| -> Result<Scenario, WithheldError> {
        let mut car = given.clone();
        for (_, (name, _, value)) in changes.iter().enumerate().filter(|(i, _)| Some(*i) != left_out) {
            match FIGURES.iter().find(|f| name.strip_prefix("simulator.") == Some(f.name)) {
                Some(figure) => figure.put(&mut car, *value),
                None => car.effects.push(EffectSetting::new(name, &[*value])?),
            }
        }
        Ok(car)
    };
    let cars = std::iter::once(None).chain((0..changes.len()).map(Some)).map(with);
    let cars = cars.collect::<Result<_, _>>()?;
    Ok((changes, cars))
}

/// The simulator's files: the program that serves it, its car, and its figures as a parameter file.
fn write_simulator(mut given: Scenario, folder: &Path) -> Result<(), WithheldError> {
    let write = |name: &str, text: String| {
        let path = folder.join(name);
        fs::write(&path, text).map_err(WithheldError::io(&path))
    };
    let figures =
        FIGURES.iter().filter_map(|f| Some(format!("{}: {:?}   # {}\n", f.name, f.of(&given)?, f.unit)));
    write(FIGURES_FILE, "# The reference car.\n".to_owned() + &figures.collect::<String>())?;
    // Neither the drive nor its seed is the simulator's.
    given.course = Course::StepSteer { speed_mps: 5.0, angle_rad: 0.0, rise_s: 0.1 };
    given.sensors = SensorSettings::exact();
    (given.seed, given.duration_s) = (0, 1.0);
    let program = std::env::current_exe().map_err(WithheldError::io(folder))?;
    let car = serde_json::to_string_pretty(&given).map_err(|e| WithheldError::content(folder, &e))?;
    write(CAR, car + "\n")?;
    write(
        files::SIMULATOR,
        format!(
            "command: ['{}', withheld, simulator, {CAR}, '{{parameter_file}}']\nparameter_file: {FIGURES_FILE}\nprocesses: 1\n",
            program.display()
        ),
    )
}
