//! From drives with pictures to what a track has taught, by the commands alone. Needs the library that `launch_scripts/fetch_onnxruntime.sh` fetches; where it
//! is absent the test says that it skips.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::Command;

use serde_json::Value;

fn gripsight(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_gripsight"))
        .args(arguments)
        .env_remove("RUST_LOG")
        .output()
        .unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

/// Median of what is said of a drive's pictures, and whether most of them show a new floor.
fn readings(bag: &str, more: &[&str]) -> (f64, bool) {
    let (code, out, log) = gripsight(&[&["friction", "--json", bag][..], more].concat());
    assert_eq!(code, Some(0), "{log}");
    let read: Value = serde_json::from_str(&out).unwrap();
    let valid: Vec<&Value> = read.as_array().unwrap().iter().filter(|r| r["valid"] == true).collect();
    let mut mu: Vec<f64> = valid.iter().map(|r| r["mu_hat"].as_f64().unwrap()).collect();
    mu.sort_by(f64::total_cmp);
    let new = valid.iter().filter(|r| r["new_floor"] == true).count();
    (mu[mu.len() / 2], 2 * new > valid.len())
}

/// A drive on the same floor without a camera.
fn simulate_without(bag: &str) -> String {
    let drive = ["--mu", "0.45", "--track", "bean", "--realistic", "--duration", "15", "--out", bag];
    let (code, _, log) = gripsight(&[&["simulate"][..], &drive].concat());
    assert_eq!(code, Some(0), "{log}");
    bag.to_owned()
}

#[test]
fn a_floor_that_lies_is_found_out_by_the_drives_on_it() {
    if gripsight_friction::find_library(None, Path::new(env!("CARGO_MANIFEST_DIR"))).is_err() {
        eprintln!("skipped: no ONNX Runtime; launch_scripts/fetch_onnxruntime.sh fetches it");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let simulate = |name: &str, more: &[&str]| {
        let bag = at(&format!("{name}.mcap"));
        let fixed = ["simulate", "--realistic", "--duration", "25", "--camera", "4", "--out", &bag];
        let (code, _, log) = gripsight(&[&fixed[..], more].concat());
        assert_eq!(code, Some(0), "{log}");
        bag
    };
    let identify = |name: &str, bag: &str| {
        let (vehicle, out) = (at(&format!("{name}.vehicle.yaml")), at(&format!("{name}_result")));
        let (code, _, log) =
            gripsight(&["identify", bag, "--vehicle", &vehicle, "--residual", "none", "--out", &out]);
        assert_eq!(code, Some(0), "{log}");
        out
    };
    // Drives at the limit on a road of 0.45 that looks dry, a stroll on another.
    let icy = ["--mu", "0.45", "--looks-like", "0.85", "--road", "3", "--track", "bean", "--pace", "1.1"];
    let first = simulate("first", &[&icy[..], &["--seed", "21"]].concat());
    let second = simulate("second", &[&icy[..], &["--seed", "22"]].concat());
    let stroll = simulate("stroll", &["--mu", "0.9", "--pace", "0.5", "--road", "8"]);
    let (taught, nothing) = (identify("first", &first), identify("stroll", &stroll));
    let learned = at("track.json");
    let results = |out: &str, bag: &str| format!("{out}={bag}");
    let (first, stroll) = (results(&taught, &first), results(&nothing, &stroll));

    // A drive that reached no peak teaches nothing, and says so.
    let (code, _, log) = gripsight(&["friction", "calibrate", "--results", &stroll, "--out", &learned]);
    assert_eq!(code, Some(1), "{log}");
    assert!(log.contains("at least") && log.contains("corner harder"), "{log}");

    let both = ["friction", "calibrate", "--results", &first, "--results", &stroll, "--out", &learned];
    let (code, said, log) = gripsight(&both);
    assert_eq!(code, Some(0), "{log}");
    assert!(said.contains("pictures"), "{said}");
    // Pictures of any of several bags make the prior.
    let (vehicle, out) = (at("first.vehicle.yaml"), at("both_result"));
    let dark = simulate_without(&at("dark.mcap"));
    let bags = ["identify", &dark, &second, "--camera", "--calibration", &learned];
    let (_, _, log) =
        gripsight(&[&bags[..], &["--vehicle", &vehicle, "--residual", "none", "--out", &out]].concat());
    assert!(log.contains("friction prior 0.4") && !log.contains("no friction prior"), "{log}");
    let (before, _) = readings(&second, &[]);
    let (after, new) = readings(&second, &["--calibration", &learned]);
    // The tires find 0.42 there: 0.45 less what load transfer takes.
    assert!(before > 0.7, "the network sees through it: {before}");
    assert!((after - 0.42).abs() < 0.08 && !new, "{after}, new: {new}");
}
