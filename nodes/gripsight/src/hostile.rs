//! Damaged results that are read back: each is answered, in bounded memory, and the error names the file.

use std::fs;
use std::path::Path;

use gripsight_identification::SignalCorrections;
use gripsight_mutants::{Mutants, bombs, peak_memory_mb};
use gripsight_vehicle::{OwnTires, PacejkaParameters, PosteriorParameter, VehicleParameters};
use serde_json::{Value, json};

use crate::friction::calibrate::friction_found;
use crate::identify::previous;
use crate::{diagnose, export, verify};

/// Mutants of each file, where no campaign asks for more.
const COUNT: usize = 2000;
/// What a test may hold, this program with all that it links included (MB).
const MOST_MB: f64 = 400.0;

fn tires() -> PacejkaParameters {
    PacejkaParameters::from_array([9.0, 1.5, 1.0, 0.1, 8.0, 1.4, 0.9, -0.2])
}

fn identification() -> Value {
    let pair = |value: Value| json!({"front": value, "rear": value});
    let peak = json!({"value": 0.8, "low": 0.76, "high": 0.84, "reached": true, "from_prior": false});
    let change = json!({"before": 0.2, "after": 0.1});
    json!({
        "status": "accepted", "accepted": true,
        "phi_p": tires(), "found": tires(),
        "valid_within": {"slip_rad": pair(json!(0.2)), "force_n": pair(json!(12.5))},
        "signals": SignalCorrections::NONE,
        "nuisance": {"relaxation_m": 0.05, "combined_slip": 0.5, "load_transfer": 0.5},
        "peak_friction": pair(peak),
        "rmse": {"rollout": {"v_y_mps": change, "yaw_rate_radps": change}},
        "key": {"run_id": "r", "sequence_id": 3, "iteration": 2, "vehicle_hash": "c0ffee", "seed": 0},
        "vehicle": VehicleParameters::f1tenth(),
    })
}

fn posterior() -> Value {
    let parameters = PosteriorParameter::of_tires(&OwnTires::assumed(&tires()));
    let covariance = vec![vec![0.01; parameters.len()]; parameters.len()];
    json!({"status": "accepted", "vehicle_hash": "c0ffee", "parameters": parameters, "covariance": covariance, "data": ["a", "b"]})
}

const MODEL: &str = "
tires:
  front: {b: 9.1, c: 1.5, d: 0.98, e: 0.1}
  rear: {b: 11.0, c: 1.4, d: 1.02, e: 0.0}
effects:
  tire_relaxation: {sigma_m: 0.45}
usual:
  yaw_inertia_error: {ratio: 1.02}
";

/// Hands `read` the whole file, which it must take, and then its mutants; `read` gets the file's folder and its path.
fn assert_answered<T>(name: &str, text: &str, read: impl Fn(&Path, &Path) -> anyhow::Result<T>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let answer = |text: &str| {
        fs::write(&path, text).unwrap();
        read(folder.path(), &path).map(drop).map_err(|error| format!("{error:#}"))
    };
    answer(text).unwrap();
    let (mut mutants, mut refused) = (Mutants::new(0xbad), 0);
    let count = Mutants::count(COUNT);
    for mutant in (0..count).map(|_| mutants.text(text)).collect::<Vec<_>>().into_iter().chain(bombs()) {
        if let Err(error) = answer(&mutant) {
            refused += 1;
            assert!(error.contains(name), "{error}");
            assert!(error.len() < 8000, "{} bytes of text: {error:.300}", error.len());
        }
    }
    println!("{name}: {count} mutants, {refused} refused, held at most {:?} MB", peak_memory_mb());
    assert!(refused > count / 4, "{refused}");
    fs::File::create(&path).unwrap().set_len(1 << 40).unwrap();
    let error = read(folder.path(), &path).map(drop).unwrap_err();
    assert!(format!("{error:#}").contains(name), "{error:#}");
    assert!(peak_memory_mb().is_none_or(|peak_mb| peak_mb < MOST_MB), "{:?}", peak_memory_mb());
}

/// Whatever is taken can be computed with.
fn assert_tires(tires: &PacejkaParameters) {
    let [b, c, d, e, ..] = tires.to_array();
    assert!(b > 0.0 && c > 0.0 && d > 0.0 && e.is_finite() && tires.is_finite(), "{tires:?}");
}

#[test]
fn a_mutated_identification_is_answered_by_all_that_read_it() {
    let text = serde_json::to_string_pretty(&identification()).unwrap();
    let name = "identification.json";
    assert_answered(name, &text, |_, path| {
        previous::read(path).inspect(|set| {
            assert_tires(&set.phi_p);
            assert_tires(&set.promised);
        })
    });
    assert_answered(name, &text, |_, path| verify::read_set(path).inspect(|(tires, _)| assert_tires(tires)));
    assert_answered(name, &text, |folder, _| {
        export::car(folder).inspect(|(car, _)| assert_tires(&car.tires.assumed_effective()))
    });
    assert_answered(name, &text, |folder, _| friction_found(folder));
}

#[test]
fn a_mutated_posterior_is_answered() {
    let text = serde_json::to_string_pretty(&posterior()).unwrap();
    assert_answered("posterior.json", &text, |_, path| {
        diagnose::posterior(path).inspect(|posterior| assert!(posterior.tires().is_ok()))
    });
}

#[test]
fn a_mutated_diagnosis_is_answered() {
    let gap = json!({"verdict": "effects", "vehicle": VehicleParameters::f1tenth()}).to_string();
    assert_answered("gap.json", &gap, |folder, _| {
        fs::write(folder.join("extended_model.yaml"), MODEL)?;
        export::car(folder)
    });
    assert_answered("extended_model.yaml", MODEL, |_, path| diagnose::extended_model(path));
    assert_answered("extended_model.yaml", MODEL, |folder, _| {
        fs::write(folder.join("gap.json"), &gap)?;
        export::car(folder)
    });
}

#[test]
fn mutated_tires_and_cars_are_answered() {
    let mpc = "friction_coeff: 1.0\nBf: 9.0\nCf: 1.5\nDf: 0.9\nEf: 0.1\nBr: 8.0\nCr: 1.4\nDr: 0.95\nEr: -0.3\nfloor: lab\n";
    assert_answered("pacejka.yaml", mpc, |_, path| diagnose::tires(path).inspect(assert_tires));
    let car = "/**:\n  ros__parameters:\n    vehicle:\n      name: car\n      mass_kg: 3.54\n      yaw_inertia_kgm2: 0.0523\n      l_f_m: 0.162\n      l_r_m: 0.145\n      h_cg_m: 0.06\n      max_steering_rad: 0.42\n";
    assert_answered("car.yaml", car, |_, path| diagnose::vehicle(Some(path)));
}
