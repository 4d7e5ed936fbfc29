//! The whole suite as its users start it, by `launch_scripts/run_suite.sh`, with camera and diagnosis: results come, and then everything
//! ends. What it guards against has happened: two nodes that worked alone hung together.

use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use gripsight_msgs::{FrictionPrior, GapReport, Message, PacejkaParams};
use gripsight_tests::domain::Domain;
use gripsight_tests::peers::{PATIENCE, available, cyclone, start_cyclone};
use gripsight_tests::process::{Process, program_folder};
use serde_json::Value;

use super::identification::simulate;

/// The launcher's promise, on a busy machine: nodes within two seconds, what is stopped is killed half a second later.
const END: Duration = Duration::from_secs(6);
/// From the start to the last result, on a busy machine.
const RUN: Duration = Duration::from_secs(150);

fn in_tree(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// The launcher, in a process group of its own, so that what it leaves behind can be found.
fn launcher(domain: &Domain, arguments: &[&str]) -> Process {
    let mut command = Command::new(in_tree("launch_scripts/run_suite.sh"));
    command.arg("--bin").arg(program_folder()).args(arguments).process_group(0);
    Process::start(domain, command)
}

/// Programs that run in the process group, with their numbers.
fn members(group: u32) -> Vec<(String, String)> {
    let mut members = Vec::new();
    for entry in std::fs::read_dir("/proc").unwrap().flatten() {
        let Ok(stat) = std::fs::read_to_string(entry.path().join("stat")) else { continue };
        let Some((head, rest)) = stat.rsplit_once(") ") else { continue };
        let (Some((number, name)), fields) = (head.split_once(" ("), rest.split(' ').collect::<Vec<_>>())
        else {
            continue;
        };
        if fields[0] != "Z" && fields[2] == group.to_string() {
            members.push((name.to_owned(), number.to_owned()));
        }
    }
    members
}

/// Sends a signal to the program `name` of the process group.
fn signal(group: u32, name: &str, signal: &str) {
    let found = members(group).into_iter().find(|(member, _)| member == name).unwrap();
    assert!(Command::new("kill").args(["-s", signal, &found.1]).status().unwrap().success());
}

/// Ends the launcher by `signal` and looks that nothing is left.
fn ends(mut launcher: Process, signal: &str) {
    let start = Instant::now();
    launcher.signal(signal);
    launcher.wait(END + Duration::from_secs(6));
    let took = start.elapsed();
    println!("the suite ended {took:.2?} after SIG{signal}");
    assert!(took < END, "{took:?}");
    assert!(members(launcher.id()).is_empty(), "{:?}", members(launcher.id()));
}

#[test]
fn camera_and_diagnosis_run_beside_the_identification_and_all_end() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--duration", "33", "--seed", "11", "--pace", "0.9", "--camera", "2"];
    let (bag, vehicle) = simulate(folder.path(), &arguments);
    let domain = Domain::new();
    let timeout = RUN.as_secs().to_string();
    let listen = |topic: &str, kind: &str| {
        let qos = ["--qos", "reliable", "--count", "100", "--timeout", &timeout];
        start_cyclone(&domain, &python, &[&["subscribe", topic, kind][..], &qos].concat())
    };
    let tires = listen("/identifier/pacejka", PacejkaParams::TYPE);
    let gap = listen("/gap_diagnosis/report", GapReport::TYPE);
    let friction = listen("/camera_prior/friction", FrictionPrior::TYPE);
    let start = Instant::now();
    let suite = launcher(
        &domain,
        &[
            "--vehicle",
            vehicle.to_str().unwrap(),
            "--bag",
            bag.to_str().unwrap(),
            "--rate",
            "10",
            "--linger",
            "150",
            "--camera",
            "--gap",
        ],
    );
    let json = |peer: &Process| {
        // Python writes NaN ("not stated") and Infinity (no limit), which are no JSON.
        let line = peer.line(RUN).replace("NaN", "null").replace("Infinity", "null").replace("-null", "null");
        serde_json::from_str::<Value>(&line).unwrap()
    };
    assert!(json(&friction)["sigma"].as_f64().unwrap() > 0.0);
    let set = json(&tires);
    assert!(set["front"]["d"].as_f64().unwrap() > 0.0, "{set}");
    let report = json(&gap);
    assert!(!report["verdict"].as_str().unwrap().is_empty(), "{report}");
    println!("every result within {:.1?}", start.elapsed());
    ends(suite, "INT");
}

#[test]
fn one_node_s_end_ends_the_suite_and_a_wrong_path_starts_nothing() {
    let vehicle = in_tree("bags/demo_f1tenth.vehicle.yaml");
    let vehicle = vehicle.to_str().unwrap();
    let domain = Domain::new();
    let mut wrong = launcher(&domain, &["--vehicle", "no_such_car.yaml"]);
    wrong.wait_for_log("no file 'no_such_car.yaml'", PATIENCE);
    assert_eq!(wrong.wait(PATIENCE).code(), Some(2));

    let mut suite = launcher(&domain, &["--vehicle", vehicle]);
    suite.wait_for_log("nothing arrives on /car_state/odom", PATIENCE);
    signal(suite.id(), "s4_residual", "KILL");
    suite.wait_for_log("s4_residual ended (exit code 137): the suite stops", PATIENCE);
    assert_eq!(suite.wait(END).code(), Some(1));
    assert!(members(suite.id()).is_empty(), "{:?}", members(suite.id()));

    // In a namespace; and a node that takes no signal does not hold the end up.
    let suite = launcher(&domain, &["--vehicle", vehicle, "--namespace", "car1"]);
    suite.wait_for_log("nothing arrives on /car1/car_state/odom", PATIENCE);
    signal(suite.id(), "identifier", "STOP");
    ends(suite, "TERM");
}
