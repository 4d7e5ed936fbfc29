//! The unit as others load it: FMPy validates it, and it moves as the model does on a recorded drive. Skipped, and said so, without FMPy.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::Command;

use gripsight_bag::{TopicMap, read_sequences};
use gripsight_fmu::{LIBRARY, Version, write};
use gripsight_model::{BASE, CarFile, EffectId, ExtendedModel, Recording, TIRES, Window};
use gripsight_signals::WindowConfig;
use gripsight_vehicle::{OwnTires, PacejkaParameters, VehicleParameters};
use serde::Deserialize;

/// What `simulate.py` says.
#[derive(Debug, Deserialize)]
struct Said {
    problems: Vec<String>,
    samples: usize,
    apart: BTreeMap<String, f64>,
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../..")
}

/// The Python that launch_scripts/setup.sh makes, where it has FMPy.
fn python() -> Option<PathBuf> {
    let python = root().join(".venv/bin/python");
    let has = Command::new(&python).args(["-c", "import fmpy"]).output().is_ok_and(|o| o.status.success());
    if !has {
        eprintln!("skipped: {} has no FMPy (launch_scripts/setup.sh --tests)", python.display());
    }
    has.then_some(python)
}

fn library() -> PathBuf {
    let beside = std::env::current_exe().unwrap();
    beside.parent().unwrap().join(LIBRARY)
}

fn car() -> CarFile {
    let text = std::fs::read_to_string(root().join("bags/demo_f1tenth.vehicle.yaml")).unwrap();
    let own = |pairs: &[(&str, f64)]| pairs.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect();
    let effects: [(&str, BTreeMap<String, f64>); 6] = [
        ("steering_delay", own(&[("delay_s", 0.037)])),
        ("steering_lag", own(&[("tau_s", 0.03), ("q", 0.2)])),
        ("steering_backlash", own(&[("half_width_rad", 0.004)])),
        ("tire_relaxation", own(&[("sigma_m", 0.07)])),
        ("longitudinal_load_transfer", own(&[("h_m", 0.05), ("pitch_frequency_hz", 4.0)])),
        ("odometry_low_pass", own(&[("tau_s", 0.04)])),
    ];
    CarFile {
        vehicle: VehicleParameters::from_ros_yaml(&text).unwrap(),
        tires: OwnTires::assumed(&PacejkaParameters::from_array([9.0, 1.5, 0.95, 0.1, 10.0, 1.4, 1.0, -0.2])),
        effects: effects.into_iter().map(|(name, own)| (name.to_owned(), own)).collect(),
    }
}

/// A table as text, columns by name.
fn csv(names: &[&str], rows: impl Iterator<Item = Vec<f64>>) -> String {
    rows.fold(names.join(",") + "\n", |mut text, row| {
        let row: Vec<String> = row.iter().map(|v| format!("{v:?}")).collect();
        writeln!(text, "{}", row.join(",")).unwrap();
        text
    })
}

#[test]
fn fmpy_validates_the_unit_and_drives_it_like_the_model() {
    let Some(python) = python() else { return };
    let bag = root().join("bags/demo_f1tenth.mcap");
    let whole = WindowConfig { length_s: f64::INFINITY, hop_s: f64::INFINITY };
    let (sequences, _) = read_sequences(&bag, &TopicMap::default(), whole).unwrap();
    let mut recording = Recording::new(sequences.last().unwrap()).unwrap();
    // Before the first sample nothing is known: the wheels are held there.
    // The unit is told the smoothed acceleration, and the force from each sample on.
    recording.force_ahead = 0.0;
    let run = &mut recording.runs[0];
    run.steering_rad[1] = run.steering_rad[0];
    // The unit is told the steering in lines.
    run.held_steering_rad.clear();
    run.recorded_a_x_mps2.clone_from(&run.a_x_mps2);
    let run = run.clone();
    let car = car();
    let driven = car.driven().unwrap();
    let effects: Vec<EffectId> = driven.effects.iter().map(|e| e.0).collect();
    let mut parameters = car.tires.to_parameters().to_vec();
    assert_eq!((parameters.len(), BASE), (TIRES, TIRES + 1));
    parameters.push(0.0);
    parameters.extend(driven.effects.iter().flat_map(|e| e.1.clone()));
    let window = Window { segment: 0, from: 0, len: run.len() };
    assert!(run.len() > 2000, "{} samples", run.len());
    let start = [run.smooth[0][0], run.smooth[1][0]];
    let native = ExtendedModel::new(&recording, &car.vehicle, &effects, driven.substep_s).predict(
        &parameters,
        start,
        &window,
    );

    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let rate = |series: &[f64], k: usize| (series[(k + 1).min(run.len() - 1)] - series[k]) / run.dt_s;
    let names = [
        "time",
        "steering_rad",
        "steering_rate_radps",
        "force_x_mps2",
        "imposed.v_x_mps",
        "imposed.v_x_rate_mps2",
        "imposed.a_x_mps2",
        "imposed.a_x_rate_mps3",
        "lap_share",
    ];
    let row = |k: usize| {
        vec![
            k as f64 * run.dt_s,
            run.steering_rad[k],
            rate(&run.steering_rad, k),
            run.force_x_mps2[k],
            run.v_x_mps[k],
            rate(&run.v_x_mps, k),
            run.a_x_mps2[k],
            rate(&run.a_x_mps2, k),
            0.0,
        ]
    };
    std::fs::write(file("inputs.csv"), csv(&names, (0..run.len()).map(row))).unwrap();
    let seen = ["sensed.v_y_mps", "sensed.yaw_rate_radps", "sensed.a_y_mps2", "car.yaw_rad"];
    let expected = |k: usize| {
        vec![native.v_y_mps[k], native.yaw_rate_radps[k], native.a_y_mps2[k], native.heading_rad[k]]
    };
    std::fs::write(file("expected.csv"), csv(&seen, (0..run.len()).map(expected))).unwrap();
    for (version, name) in [(Version::Three, "three.fmu"), (Version::Two, "two.fmu")] {
        write(&file(name), version, &car, &library()).unwrap();
        let done = Command::new(&python)
            .arg(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/suite/simulate.py"))
            .args([file(name), file("inputs.csv"), file("expected.csv")])
            .arg(run.dt_s.to_string())
            .args(["speed_is_imposed=true".to_owned(), format!("force_is_known={}", recording.has_command)])
            .args([format!("start.v_y_mps={:?}", start[0]), format!("start.yaw_rate_radps={:?}", start[1])])
            .output()
            .unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let text = String::from_utf8(done.stdout).unwrap();
        // FMPy prints what the unit logs before.
        let said: Said = serde_json::from_str(text.lines().last().unwrap()).expect(&text);
        assert_eq!(text.lines().count(), 1, "{text}");
        assert!(said.problems.is_empty(), "{:?}", said.problems);
        assert!(said.samples + 1 >= run.len(), "{} of {}", said.samples, run.len());
        println!("{name}: {:?}", said.apart);
        assert_eq!(said.apart.len(), seen.len());
        assert!(said.apart.values().all(|apart| *apart < 1e-6), "{name}: {:?}", said.apart);
    }
}

#[test]
fn the_same_car_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let paths = ["a.fmu", "b.fmu"].map(|name| folder.path().join(name));
    let library = folder.path().join("library.so");
    std::fs::write(&library, b"not one").unwrap();
    paths.iter().for_each(|path| write(path, Version::Three, &car(), &library).unwrap());
    let [a, b] = paths.map(|path| std::fs::read(path).unwrap());
    assert!(a == b && a.len() > 1000);
    let mut car = car();
    car.effects.insert("magic".to_owned(), BTreeMap::new());
    let error = write(&folder.path().join("c.fmu"), Version::Two, &car, &library).unwrap_err();
    assert!(error.to_string().contains("unknown effect `magic`"), "{error}");
}
