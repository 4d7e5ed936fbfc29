//! A diagnosis as a user runs it, and its extended model handed on.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use gripsight_bag::Bag;
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

/// Messages of each topic.
fn messages(bag: &Path) -> BTreeMap<String, u64> {
    let mut counts = BTreeMap::new();
    for message in Bag::open(bag).unwrap().messages() {
        *counts.entry(message.unwrap().channel.topic.clone()).or_default() += 1;
    }
    counts
}

#[test]
fn a_recording_is_never_written_over_and_folders_are_looked_at_first() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    assert_eq!(gripsight(folder, "simulate --duration 1 --seed 1 --out a.mcap").0, 0);
    fs::copy(folder.join("a.mcap"), folder.join("b.mcap")).unwrap();
    fs::create_dir(folder.join("sub")).unwrap();
    fs::write(folder.join("file"), "").unwrap();
    std::os::unix::fs::symlink("a.mcap", folder.join("link.mcap")).unwrap();
    std::os::unix::fs::symlink("../b.mcap", folder.join("sub/gap.json")).unwrap();
    let before = fs::read(folder.join("a.mcap")).unwrap();
    for (arguments, why) in [
        ("a.mcap --out out --predictions a.mcap", "is a.mcap itself"),
        ("link.mcap --out out --predictions sub/../a.mcap", "is link.mcap itself"),
        ("a.mcap --out out --predictions link.mcap", "is a.mcap itself"),
        ("a.mcap b.mcap --out out --predictions b.mcap", "is b.mcap itself"),
        ("a.mcap --heldout b.mcap --out out --predictions b.mcap", "is b.mcap itself"),
        ("a.mcap b.mcap --out sub", "is b.mcap itself"),
        ("a.mcap --out file", "cannot make file"),
        ("a.mcap --out out --predictions none/there.mcap", "cannot write none/there.mcap"),
        ("a.mcap --out out --predictions sub", "there is a folder of that name"),
    ] {
        let (code, error) = gripsight(folder, &format!("diagnose {arguments}"));
        assert!(code == 1 && error.contains(why), "{arguments}: {error}");
    }
    assert_eq!(fs::read(folder.join("a.mcap")).unwrap(), before);
}

#[test]
fn what_does_not_go_with_two_drives_is_wrong_usage() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, why) in [
        ("a.mcap b.mcap --pacejka t.yaml", "--pacejka cannot be used with [BAG2]"),
        ("a.mcap b.mcap --posterior t.json", "--posterior cannot be used with [BAG2]"),
        ("a.mcap b.mcap c.mcap", "--same-state"),
        ("a.mcap --same-state", "<BAG2>"),
        ("a.mcap b.mcap --same-state --later c.mcap", "cannot be used with"),
    ] {
        let (code, error) = gripsight(folder.path(), &format!("diagnose {arguments} --out out"));
        assert!(code == 2 && error.contains(why), "{arguments}: {code} {error}");
    }
}

#[test]
fn an_effect_that_is_not_in_the_library_is_wrong_usage() {
    let folder = tempfile::tempdir().unwrap();
    for option in ["--without", "--only"] {
        let (code, error) =
            gripsight(folder.path(), &format!("diagnose none.mcap --out out {option} steering_dealy"));
        assert!(code == 2 && error.contains("a similar value exists: 'steering_delay'"), "{error}");
    }
}

#[test]
fn diagnose_and_identify_take_the_extended_model_again() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run = |arguments: &str| assert_eq!(gripsight(folder, arguments).0, 0, "{arguments}");
    // Quick movements tell a delay from a lag.
    run("simulate --effect steering_delay=0.03 --dither 0.01 --duration 20 --seed 62 --out laps.mcap");
    run("diagnose laps.mcap --vehicle laps.vehicle.yaml --out first --predictions first.mcap");
    let first = json(&folder.join("first/gap.json"));
    assert_eq!(first["effects"][0]["name"], "steering_delay");
    assert_eq!(first["gap"]["steps"][0]["effect"], "steering_delay");
    assert_eq!(
        first["data_notes"],
        serde_json::json!(["nothing recorded checks: scale and zero of steering_rad"])
    );
    let streams: Vec<&str> =
        first["topics"].as_array().unwrap().iter().map(|t| t["stream"].as_str().unwrap()).collect();
    assert_eq!(streams, ["odom", "drive", "imu", "wheels"]);
    assert!(first["topics"][2]["invisible_without"].as_array().unwrap().contains(&"imu_lever_arm".into()));

    // The recording once more, with the predictions of the first diagnosis in it.
    run(
        "diagnose first.mcap --vehicle laps.vehicle.yaml --extended-model first/extended_model.yaml --out second --predictions second.mcap",
    );
    let second = json(&folder.join("second/gap.json"));
    assert!(["no_gap", "tire_retune_only"].contains(&second["verdict"].as_str().unwrap()), "{second}");

    let (recorded, first, second) =
        (folder.join("laps.mcap"), folder.join("first.mcap"), folder.join("second.mcap"));
    let predicted = messages(&first)["/gripsight/extended/odom"];
    assert!(predicted > 1000, "{predicted}");
    let mut expected = messages(&recorded);
    for topic in ["/gripsight/nominal/odom", "/gripsight/extended/odom"] {
        expected.insert(topic.to_owned(), predicted);
    }
    assert_eq!((messages(&first), messages(&second)), (expected.clone(), expected));

    run("identify laps.mcap --vehicle laps.vehicle.yaml --residual none --prior-mu 0.75 --out plain");
    run(
        "identify laps.mcap --vehicle laps.vehicle.yaml --residual none --prior-mu 0.75 --extended-model first/extended_model.yaml --out corrected",
    );
    let delay_s = |name: &str| {
        json(&folder.join(name).join("identification.json"))["signals"]["steering_delay_s"].as_f64().unwrap()
    };
    assert!(delay_s("plain") > 0.025 && delay_s("corrected").abs() < 0.01, "{} s left", delay_s("corrected"));
    // The chain: the car's own tires from the identification cost the diagnosis no name.
    run("diagnose laps.mcap --vehicle laps.vehicle.yaml --posterior plain/posterior.json --out chain");
    assert_eq!(json(&folder.join("chain/gap.json"))["effects"][0]["name"], "steering_delay");
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
