//! The loop over topics: the driver at the wheel of the live car, tire sets from a peer.

use std::path::Path;
use std::time::{Duration, Instant};

use gripsight_identification::vehicle_hash;
use gripsight_msgs::{IdentificationProgress, Message, PacejkaParams};
use gripsight_tests::domain::Domain;
use gripsight_tests::peers::{PATIENCE, available, cyclone, start_cyclone};
use gripsight_tests::process::{Process, node};
use gripsight_vehicle::VehicleParameters;
use serde_json::json;

const SET: &str = "gripsight_msgs/msg/PacejkaParams";
/// Two laps at the start's speed, on a busy machine.
const LAPS: Duration = Duration::from_secs(120);

/// Publishes a set as the identifier would.
fn publish(domain: &Domain, python: &Path, hash: &str, status: u8) {
    // The plant's on a road of 0.9, projected on Phi_p; its front axle gives way at this slip.
    let front = json!({"b": 9.68, "c": 1.041, "d": 0.830, "e": -0.876});
    let rear = json!({"b": 11.72, "c": 1.0, "d": 0.857, "e": -0.738});
    let peak = |peak: f64| json!({"friction": {"value": peak, "low": 0.98 * peak, "high": 1.02 * peak}, "reached": true});
    let set = json!({
        "handshake": {"vehicle_hash": hash, "sequence_id": 7}, "status": status, "reason": "as a peer says",
        "front": front, "rear": rear, "front_peak": peak(0.806), "rear_peak": peak(0.857), "front_valid_slip_rad": 0.231,
        "signals": {"steering_gain": 1.0}
    });
    let mut peer =
        start_cyclone(domain, python, &["publish", "/identifier/pacejka", SET, "--qos", "latched"]);
    peer.feed(&set.to_string());
    assert!(peer.wait(PATIENCE).success());
}

/// Says that six tenths are left of what a set promises.
fn warn(domain: &Domain, python: &Path, hash: &str, sequence: u64) {
    let grip = json!({
        "handshake": {"vehicle_hash": hash, "sequence_id": sequence}, "fallen": true, "share": 0.6, "text": "as a peer says"
    });
    let kind = "gripsight_msgs/msg/Grip";
    let mut peer = start_cyclone(domain, python, &["publish", "/identifier/grip", kind, "--qos", "latched"]);
    peer.feed(&grip.to_string());
    assert!(peer.wait(PATIENCE).success());
}

/// Says where the identification stands, and what it wants to be driven next.
fn ask(domain: &Domain, python: &Path, hash: &str, stage: u8, manoeuvre: &str) {
    let next = json!({"manoeuvre": manoeuvre, "v_x_mps": 5.0, "a_y_mps2": 2.0, "why": "as a peer says"});
    let said = json!({"handshake": {"vehicle_hash": hash}, "stage": stage, "drive_next": [next]});
    let arguments = ["publish", "/identifier/progress", IdentificationProgress::TYPE, "--qos", "latched"];
    let mut peer = start_cyclone(domain, python, &arguments);
    peer.feed(&said.to_string());
    assert!(peer.wait(PATIENCE).success());
}

/// Names a delay that the car does not have, as a diagnosis would that is wrong.
fn name_a_delay(domain: &Domain, python: &Path, hash: &str) {
    let delay =
        json!({"name": "delay_s", "estimate": {"value": 0.2, "low": 0.19, "high": 0.21}, "unit": "s"});
    let effect =
        json!({"name": "steering_delay", "accepted": true, "parameters": [delay], "confidence": 0.99});
    let model = json!({"handshake": {"vehicle_hash": hash}, "verdict": "effects", "effects": [effect]});
    let kind = "gripsight_msgs/msg/ExtendedModel";
    let arguments = ["publish", "/gap_diagnosis/extended_model", kind, "--qos", "latched"];
    let mut peer = start_cyclone(domain, python, &arguments);
    peer.feed(&model.to_string());
    assert!(peer.wait(PATIENCE).success());
}

#[test]
fn the_driver_laps_the_live_car_takes_a_set_and_slows_when_it_is_withdrawn() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let python = cyclone.unwrap();
    let folder = tempfile::tempdir().unwrap();
    let domain = Domain::new();
    let write = format!("write_folder:={}", folder.path().display());
    let car = node(&domain, "sim_car", &["-p", "mu:=0.9", "-p", &write]);
    car.wait_for_log("f1tenth on its track", PATIENCE);
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (vehicle, parameters) = (file("vehicle.yaml"), file("driver.yaml"));
    let driver = node(
        &domain,
        "driver",
        &[
            "--params-file",
            &vehicle,
            "--params-file",
            &parameters,
            "-r",
            "pacejka:=identifier/pacejka",
            "-r",
            "grip:=identifier/grip",
            "-r",
            "progress:=identifier/progress",
            "-r",
            "extended_model:=gap_diagnosis/extended_model",
        ],
    );
    let text = std::fs::read_to_string(&vehicle).unwrap();
    let hash = vehicle_hash(&VehicleParameters::from_ros_yaml(&text).unwrap());
    // It waits for its first sequence; then it was refused.
    ask(&domain, &python, "", IdentificationProgress::WAITING, "");
    driver.wait_for_log("the identification asks for turn-ins", PATIENCE);
    // The car stands until the first command reaches it: that lap shows nothing.
    lap(&driver);
    let slow = lap(&driver);
    assert_eq!(slow.exits, 0, "off the track on the start's tires");
    ask(&domain, &python, &hash, IdentificationProgress::FINISHED, "corner_harder");
    driver.wait_for_log("the identification asks for turn-ins no more", PATIENCE);
    ask(&domain, &python, &hash, IdentificationProgress::FINISHED, "turn_ins");
    driver.wait_for_log("the identification asks for turn-ins", PATIENCE);

    publish(&domain, &python, "of another car", PacejkaParams::ACCEPTED);
    driver.wait_for_log("of a car with other parameters", PATIENCE);
    publish(&domain, &python, &hash, PacejkaParams::ACCEPTED);
    driver.wait_for_log("Accepted: planning with a grip of 0.788", PATIENCE);
    lap(&driver);
    let fast = lap(&driver);
    assert!(fast.time_s < 0.9 * slow.time_s, "{} s after {} s", fast.time_s, slow.time_s);
    assert_eq!(fast.exits, 0, "off the track on its own tires");

    name_a_delay(&domain, &python, &hash);
    driver.wait_for_log("the extended model is not taken: steering_delay: over", PATIENCE);

    let told = Instant::now();
    warn(&domain, &python, &hash, 6);
    driver.wait_for_log("planning with a grip of 0.46", PATIENCE);
    assert!(told.elapsed() < Duration::from_secs(3), "{:?} with the peer's own start", told.elapsed());
    publish(&domain, &python, &hash, PacejkaParams::ACCEPTED);
    driver.wait_for_log("Accepted: planning with a grip of 0.788", PATIENCE);

    let told = Instant::now();
    publish(&domain, &python, &hash, PacejkaParams::WITHDRAWN);
    driver.wait_for_log("is withdrawn, planning with a grip of 0.5", PATIENCE);
    assert!(told.elapsed() < Duration::from_secs(3), "{:?} with the peer's own start", told.elapsed());
    lap(&driver);
    let last = lap(&driver);
    // The root of the grips' ratio is 1.2; on the straights the motor is the limit.
    assert!(last.time_s > 1.1 * fast.time_s, "{} s after {} s", last.time_s, fast.time_s);
}

struct Lap {
    time_s: f64,
    exits: u32,
}

/// The driver's line about its next lap.
fn lap(driver: &Process) -> Lap {
    let line = driver.wait_for_log("to the line", LAPS);
    let words: Vec<&str> = line.split_whitespace().collect();
    let before = |unit: &str| {
        let at = words.iter().position(|w| *w == unit).unwrap();
        words[at - 1].parse::<f64>().unwrap()
    };
    Lap { time_s: before("s,"), exits: before("times") as u32 }
}
