//! What was found goes out to other simulators.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Output};

fn gripsight(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gripsight")).args(arguments).env_remove("RUST_LOG").output().unwrap()
}

fn done(arguments: &[&str]) -> String {
    let output = gripsight(arguments);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn refused(arguments: &[&str], why: &str) {
    let output = gripsight(arguments);
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains(why), "{text}");
}

#[test]
fn an_identification_and_a_diagnosis_become_units_and_parameter_files() {
    let folder = tempfile::tempdir().unwrap();
    let of = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let file = |name: &str| root.join(name).to_str().unwrap().to_owned();
    let (bag, vehicle) = (file("bags/demo_f1tenth.mcap"), file("bags/demo_f1tenth.vehicle.yaml"));
    done(&["identify", &bag, "--vehicle", &vehicle, "--residual", "none", "--out", &of("identified")]);
    done(&["diagnose", &bag, "--vehicle", &vehicle, "--out", &of("diagnosed")]);

    let said = done(&["export", "fmu", &of("identified"), "--out", &of("car.fmu")]);
    assert!(said.contains("tires      front") && said.contains("car.fmu"), "{said}");
    let unit = std::fs::read(of("car.fmu")).unwrap();
    let has = |unit: &[u8], name: &str| unit.windows(name.len()).any(|w| w == name.as_bytes());
    assert!(has(&unit, "modelDescription.xml") && has(&unit, "binaries/x86_64-linux/gripsight_car.so"));

    done(&["export", "fmu", &of("diagnosed"), "--fmi", "2", "--out", &of("two.fmu")]);
    assert!(has(&std::fs::read(of("two.fmu")).unwrap(), "binaries/linux64/gripsight_car.so"));

    done(&["export", "slipx", &of("identified"), "--out", &of("slipx")]);
    assert!(Path::new(&of("slipx/tyres/rubber_rear.yaml")).is_file());
    let said = done(&["export", "commonroad", &of("diagnosed"), "--out", &of("commonroad")]);
    assert!(said.contains("one tire serves both axles"), "{said}");
    done(&["export", "ocd", &of("identified"), "--out", &of("vehicle.json")]);
    let text = std::fs::read_to_string(of("vehicle.json")).unwrap();
    let all: serde_json::Value = serde_json::from_str(&text).unwrap();
    // Its own tires where it has them, those found where it has not.
    let json = |name: &str| -> serde_json::Value {
        serde_json::from_str(&std::fs::read_to_string(of(name)).unwrap()).unwrap()
    };
    let rear_d = "vehicle_dynamics_single_track.z.tire_model.rear_left.lateral.D";
    let posterior = json("identified/posterior.json");
    let own = posterior["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "rear.d").unwrap();
    assert_eq!(all[rear_d], own["mean"]);
    std::fs::remove_file(of("identified/posterior.json")).unwrap();
    done(&["export", "ocd", &of("identified"), "--out", &of("vehicle.json")]);
    assert_eq!(json("vehicle.json")[rear_d], json("identified/identification.json")["found"]["rear"]["d"]);

    refused(
        &["export", "fmu", &of("slipx"), "--out", &of("no.fmu")],
        "is not the folder of an identification",
    );
    refused(
        &["export", "fmu", &of("identified"), "--library", &of("nowhere.so"), "--out", &of("no.fmu")],
        "nowhere.so",
    );
    assert!(!Path::new(&of("no.fmu")).exists());
    std::fs::remove_file(of("diagnosed/extended_model.yaml")).unwrap();
    refused(&["export", "ocd", &of("diagnosed"), "--out", &of("no.json")], "there is no model in it");
}
