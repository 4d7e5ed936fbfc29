//! The diagnosis on topics, behind the identification: a replayed drive with a known effect in, reports over a moving window out, within bounds.

use std::time::Duration;

use gripsight_msgs::{GapReport, Message, StateSequence, TirePosterior};
use gripsight_tests::domain::Domain;
use gripsight_tests::peers::{available, cyclone, start_cyclone};
use gripsight_tests::process::{Process, node};
use serde_json::{Value, json};

use super::identification::{play, simulate};

/// Two windows on one busy core.
const RUN: Duration = Duration::from_secs(240);
const EFFECT: &str = "steering_delay";
const DELAY_S: f64 = 0.03;
/// Of the whole process.
const MOST_MEMORY_MB: f64 = 150.0;

#[test]
fn a_moving_window_of_a_replayed_drive_is_diagnosed_within_bounds() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let effect = format!("{EFFECT}={DELAY_S}");
    // Quick movements tell a delay from a lag.
    let drive = ["--effect", &effect, "--dither", "0.01", "--duration", "48", "--seed", "12"];
    let (bag, vehicle) = simulate(folder.path(), &drive);
    let domain = Domain::new();
    let vehicle = ["--params-file", vehicle.to_str().unwrap()];
    let timeout = RUN.as_secs().to_string();
    let listen = ["--qos", "reliable", "--count", "2", "--timeout", &timeout];
    let listen = |topic: &str, kind: &str| {
        start_cyclone(&domain, &python, &[&["subscribe", topic, kind][..], &listen].concat())
    };
    let reports = listen("/gap_diagnosis/report", GapReport::TYPE);
    let sequences = listen("/telemetry/sequence", StateSequence::TYPE);
    let posterior = listen("/identifier/posterior", TirePosterior::TYPE);
    let joined = ["-r", "sequence:=telemetry/sequence", "-r", "posterior:=identifier/posterior"];
    let compare = ["-p", "compare_with_first:=true"];
    let diagnosis = node(&domain, "gap_diagnosis", &[&joined[..], &compare[..], &vehicle[..]].concat());
    let joined = ["-r", "sequence:=telemetry/sequence", "-r", "model:=s4_residual/model"];
    let _identifier = node(&domain, "identifier", &[&joined[..], &vehicle[..]].concat());
    let joined = ["-r", "sequence:=telemetry/sequence", "-r", "candidate:=identifier/candidate"];
    let _residual = node(&domain, "s4_residual", &[&joined[..], &vehicle[..]].concat());
    // The second window begins after the first: what the identifier learned of the car's own tires there is a prior for it.
    let window = ["-p", "window_s:=20.0", "-p", "hop_s:=23.0", "-p", "reliable_inputs:=true"];
    let topics = ["-r", "odom:=/car_state/odom", "-r", "imu:=/imu/data", "-r", "wheels:=/wheel_speeds"];
    let _telemetry = node(&domain, "telemetry", &[&window[..], &topics[..], &vehicle[..]].concat());
    let _player = play(&domain, &bag, "2.0");
    // The bag stands until both have said what they make of the first window, however slow the machine is.
    let pause = |paused: bool| {
        let value = json!({"type": 1, "bool_value": paused});
        let request = json!({"parameters": [{"name": "paused", "value": value}]}).to_string();
        let service = ["call", "/bag_player/set_parameters", "rcl_interfaces/srv/SetParameters", &request];
        start_cyclone(&domain, &python, &service).line(RUN)
    };
    sequences.line(RUN);
    pause(true);

    // Python writes NaN ("not stated") and Infinity (no limit), which are no JSON.
    let of = |peer: &Process| {
        let line = peer.line(RUN).replace("NaN", "null").replace("Infinity", "null");
        serde_json::from_str::<Value>(&line.replace("-null", "null")).unwrap()
    };
    let report = || of(&reports);
    let first = report();
    let tires = of(&posterior);
    pause(false);
    let second = report();
    let id = |report: &Value| report["handshake"]["sequence_id"].as_u64().unwrap();
    assert!(id(&first) < id(&second));
    // A loss of grip shows only against tires whose peak is known.
    let knows_the_peak = tires["status"] == "accepted";
    let hides_grip = |report: &Value| report["invisible"].as_array().unwrap().contains(&"grip_scale".into());
    assert!(hides_grip(&first), "{}", first["invisible"]);
    assert_eq!(hides_grip(&second), !knows_the_peak, "{} {}", tires["status"], second["invisible"]);
    // The second window is compared with the first, and it is the same car.
    let changes = |report: &Value| report["changes"].as_array().unwrap().clone();
    assert!(changes(&first).is_empty() && !changes(&second).is_empty(), "{second}");
    for change in changes(&second) {
        assert!(change["probability"].as_f64().unwrap() < 0.5, "{change}");
    }
    for report in [&first, &second] {
        let named = &report["effects"][0];
        assert_eq!((&named["name"], &named["accepted"]), (&EFFECT.into(), &true.into()), "{report}");
        let delay_s = |end: &str| named["parameters"][0]["estimate"][end].as_f64().unwrap();
        // The plant's command is held between samples, which a delay includes.
        assert!(delay_s("low") < DELAY_S + 0.01 && DELAY_S < delay_s("high"), "{named}");
        let left = |model: &str| report[model]["value"].as_f64().unwrap();
        assert!(left("gap_after") < left("gap_retuned"), "{report}");
    }
    let memory_mb = diagnosis.peak_memory_mb();
    println!("gap_diagnosis: peak {memory_mb:.0} MB");
    assert!(memory_mb < MOST_MEMORY_MB, "{memory_mb} MB");
}
