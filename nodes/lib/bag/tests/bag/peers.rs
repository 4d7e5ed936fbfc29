//! Our bags in the hands of the Python readers `rosbags` and `mcap-ros2-support`.

use std::path::{Path, PathBuf};
use std::process::Command;

use gripsight_bag::{BagWriter, sequence_to_messages};
use gripsight_msgs::Handshake;
use gripsight_signals::StateSequence;
use tempfile::TempDir;

use crate::support::{START_NS, drive, odometry, telemetry_bag, wheels};

/// The Python of the repository's virtual environment; `None` where the peers are left out on purpose.
fn python() -> Option<PathBuf> {
    if std::env::var_os("GRIPSIGHT_SKIP_PEERS").is_some_and(|v| v == "1") {
        eprintln!("SKIPPED: GRIPSIGHT_SKIP_PEERS=1");
        return None;
    }
    let python = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../.venv/bin/python")).to_owned();
    assert!(
        python.exists(),
        "no Python peers: run launch_scripts/setup.sh (it makes .venv from tests/requirements.txt), \
         or set GRIPSIGHT_SKIP_PEERS=1 to leave them out"
    );
    Some(python)
}

/// Runs the reader's script on a bag; gives one JSON object of what it read.
fn read_by(reader: &str, bag: &Path) -> Option<serde_json::Value> {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/bag/read_bag.py");
    let run = Command::new(python()?).arg(script).arg(reader).arg(bag).output().unwrap();
    assert!(run.status.success(), "{reader}: {}", String::from_utf8_lossy(&run.stderr));
    Some(serde_json::from_slice(&run.stdout).unwrap())
}

/// The last odometry, drive and wheels are what was written; counts too.
fn check(read: &serde_json::Value, samples: usize) {
    let (o, d, w) = (odometry(samples - 1), drive(samples - 1), wheels(samples - 1));
    for topic in ["/odom", "/drive", "/imu", "/wheels"] {
        assert_eq!(read["counts"][topic], samples, "{topic}");
    }
    assert_eq!(read["odom"]["stamp_ns"], o.stamp_ns);
    assert_eq!(read["odom"]["frames"], serde_json::json!(["map", "base_link"]));
    assert_eq!(read["odom"]["x"], o.x_m);
    assert_eq!(read["odom"]["v_y"], o.v_y_mps);
    assert_eq!(read["odom"]["yaw_rate"], o.yaw_rate_radps);
    assert_eq!(read["drive"]["steering_angle"], d.steering_angle_rad);
    assert_eq!(read["wheels"]["velocity"], serde_json::json!(w.speed));
    assert_eq!(read["wheels"]["name"][0], "wheel_fl");
}

#[test]
fn rosbags_reads_our_folder() {
    let folder = TempDir::new().unwrap();
    let bag = telemetry_bag(&folder.path().join("bag"), 400);
    if let Some(read) = read_by("rosbags", &bag) {
        check(&read, 400);
        assert_eq!(read["duration_ns"], 3_990_000_000i64 + 1);
    }
}

#[test]
fn mcap_ros2_support_reads_our_file() {
    let folder = TempDir::new().unwrap();
    let bag = telemetry_bag(&folder.path().join("bag.mcap"), 400);
    if let Some(read) = read_by("mcap_ros2", &bag) {
        check(&read, 400);
    }
}

#[test]
fn both_read_our_own_messages() {
    let folder = TempDir::new().unwrap();
    let sequence = StateSequence {
        sequence_id: 9,
        start_stamp_ns: START_NS,
        time_s: vec![0.0, 0.01, 0.02],
        v_x_mps: vec![1.5, 1.25, 1.125],
        v_y_mps: vec![0.0; 3],
        yaw_rate_radps: vec![0.5; 3],
        steering_rad: vec![-0.25; 3],
        ..StateSequence::default()
    };
    let handshake = Handshake { run_id: "run-1".to_owned(), seed: u64::MAX, ..Handshake::default() };
    for (reader, name) in [("rosbags", "bag"), ("mcap_ros2", "bag.mcap")] {
        let bag = folder.path().join(name);
        let mut writer = BagWriter::create(&bag).unwrap();
        for part in sequence_to_messages(&sequence, &handshake, "map") {
            writer.write("/telemetry/sequence", START_NS, &part).unwrap();
        }
        writer.finish().unwrap();
        let Some(read) = read_by(reader, &bag) else { return };
        assert_eq!(read["sequence"]["v_x_mps"], serde_json::json!([1.5, 1.25, 1.125]), "{reader}");
        assert_eq!(read["sequence"]["seed"], u64::MAX, "{reader}");
        assert_eq!(read["sequence"]["run_id"], "run-1", "{reader}");
        assert_eq!(read["sequence"]["a_x"], 0, "{reader}");
    }
}
