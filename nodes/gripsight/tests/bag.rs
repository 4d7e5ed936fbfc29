//! `gripsight bag` as a user runs it.

#![allow(clippy::unwrap_used, reason = "helpers of tests, not only test functions, may fail")]

use std::path::Path;
use std::process::{Command, Output};

use gripsight_bag::{BagWriter, encode};
use gripsight_signals::{DriveSample, OdometrySample};

fn gripsight(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gripsight")).arg("bag").args(arguments).output().unwrap()
}

/// Ten seconds at 50 Hz without inertial unit.
fn write_bag(path: &Path) {
    let mut writer = BagWriter::create(path).unwrap();
    for k in 0..500 {
        let stamp_ns = 1_700_000_000_000_000_000 + 20_000_000 * k;
        let odometry = OdometrySample { stamp_ns, v_x_mps: 3.0, x_m: 0.06 * k as f64, ..Default::default() };
        let drive = DriveSample { stamp_ns, steering_angle_rad: 0.001 * k as f64, ..Default::default() };
        writer.write("/odom", stamp_ns, &encode::odometry(&odometry)).unwrap();
        writer.write("/drive", stamp_ns, &encode::drive(&drive)).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn info_recover_and_inject() {
    let folder = tempfile::TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let (whole, cut, injected) = (path("whole.mcap"), path("cut.mcap"), path("injected.mcap"));
    write_bag(Path::new(&whole));

    let shown = gripsight(&["info", &whole, "--json"]);
    assert_eq!(shown.status.code(), Some(0));
    let info: serde_json::Value = serde_json::from_slice(&shown.stdout).unwrap();
    assert_eq!(info["messages"], 1000);
    assert_eq!(info["telemetry"]["sequences"]["report"]["streams"]["drive"], "/drive");
    assert_eq!(info["telemetry"]["sequences"]["report"]["counts"]["odom"], 500);
    let table = String::from_utf8(gripsight(&["info", &whole]).stdout).unwrap();
    assert!(table.contains("/odom") && table.contains("imu     not recorded"), "{table}");

    let bytes = std::fs::read(&whole).unwrap();
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    let recovered = gripsight(&["recover", &cut]);
    assert_eq!(recovered.status.code(), Some(0));
    assert!(String::from_utf8_lossy(&recovered.stdout).contains("cut.recovered.mcap"));
    assert!(String::from_utf8_lossy(&recovered.stderr).contains("cut off at byte"));

    let inject = |effect: &str| gripsight(&["inject", &whole, "--effect", effect, "--out", &injected]);
    let changed = inject("steering_gain=0.1");
    assert!(String::from_utf8_lossy(&changed.stdout).contains("499 messages changed"), "zero stays zero");
    assert_eq!(inject("imu_tilt=0.1").status.code(), Some(1));
    assert_eq!(inject("tire_wear=0.1").status.code(), Some(2));
}
