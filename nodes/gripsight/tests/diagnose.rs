//! A diagnosis as a user runs it, and its extended model handed on.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

fn gripsight(folder: &Path, arguments: &str) -> (i32, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_gripsight"))
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .env_remove("RUST_LOG")
        .output()
        .unwrap();
    (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn diagnose_and_identify_take_the_extended_model_again() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run = |arguments: &str| assert_eq!(gripsight(folder, arguments).0, 0, "{arguments}");
    run("simulate --effect steering_delay=0.03 --duration 20 --seed 62 --out laps.mcap");
    run("diagnose laps.mcap --vehicle laps.vehicle.yaml --out first");
    assert_eq!(json(&folder.join("first/gap.json"))["effects"][0]["name"], "steering_delay");

    run(
        "diagnose laps.mcap --vehicle laps.vehicle.yaml --extended-model first/extended_model.yaml --out second",
    );
    let second = json(&folder.join("second/gap.json"));
    assert!(["no_gap", "tire_retune_only"].contains(&second["verdict"].as_str().unwrap()), "{second}");

    run("identify laps.mcap --vehicle laps.vehicle.yaml --residual none --prior-mu 0.75 --out plain");
    run(
        "identify laps.mcap --vehicle laps.vehicle.yaml --residual none --prior-mu 0.75 --extended-model first/extended_model.yaml --out corrected",
    );
    let delay_s = |name: &str| {
        json(&folder.join(name).join("identification.json"))["signals"]["steering_delay_s"].as_f64().unwrap()
    };
    assert!(delay_s("plain") > 0.025 && delay_s("corrected").abs() < 0.01, "{} s left", delay_s("corrected"));
    let page = fs::read_to_string(folder.join("corrected/report.html")).unwrap();
    assert!(page.contains("taken out of the signals"));

    let (code, error) =
        gripsight(folder, "diagnose laps.mcap --extended-model laps.vehicle.yaml --out third");
    assert_eq!(code, 1);
    assert!(
        error.contains("cannot use laps.vehicle.yaml") && error.contains("extended model file"),
        "{error}"
    );
}
