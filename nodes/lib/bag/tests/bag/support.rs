//! Bags made for the tests.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use gripsight_bag::{BagWriter, encode};
use gripsight_msgs::Message;
use gripsight_msgs::standard::{ackermann_msgs::AckermannDriveStamped, nav_msgs::Odometry};
use gripsight_signals::{DriveSample, ImuSample, OdometrySample, WheelsSample, WindowConfig};

/// One window over everything.
pub(crate) const WHOLE: WindowConfig = WindowConfig { length_s: f64::INFINITY, hop_s: f64::INFINITY };
pub(crate) const START_NS: i64 = 1_700_000_000_000_000_000;

pub(crate) fn stamp_ns(k: usize) -> i64 {
    START_NS + 10_000_000 * k as i64
}

pub(crate) fn odometry(k: usize) -> OdometrySample {
    let t = 0.01 * k as f64;
    OdometrySample {
        stamp_ns: stamp_ns(k),
        x_m: 3.0 * t,
        y_m: -t,
        yaw_rad: (0.7 * t).sin(),
        v_x_mps: 3.0 + 0.1 * t,
        v_y_mps: 0.05 * t.cos(),
        yaw_rate_radps: 0.4 * t.sin(),
    }
}

pub(crate) fn drive(k: usize) -> DriveSample {
    let steering_angle_rad = f64::from((0.2 * (0.05 * k as f64).sin()) as f32);
    DriveSample { stamp_ns: stamp_ns(k), steering_angle_rad, speed_mps: 3.0, acceleration_mps2: 0.5 }
}

pub(crate) fn imu(k: usize) -> ImuSample {
    let t = 0.01 * k as f64;
    ImuSample { stamp_ns: stamp_ns(k), a_x_mps2: 0.1, a_y_mps2: t.sin(), yaw_rate_radps: 0.4 * t.sin() }
}

pub(crate) fn wheels(k: usize) -> WheelsSample {
    let speed = [10.0, 10.5, 11.0, 11.5].map(|v| v + 0.01 * k as f64);
    WheelsSample { stamp_ns: stamp_ns(k), speed, effort_nm: Some([0.0, 0.0, 0.3, 0.4]) }
}

/// A bag of all four streams at 100 Hz.
pub(crate) fn telemetry_bag(path: &Path, samples: usize) -> PathBuf {
    let mut writer = BagWriter::create(path).unwrap();
    for k in 0..samples {
        writer.write("/odom", stamp_ns(k), &encode::odometry(&odometry(k))).unwrap();
        writer.write("/drive", stamp_ns(k), &encode::drive(&drive(k))).unwrap();
        writer.write("/imu", stamp_ns(k), &encode::imu(&imu(k))).unwrap();
        writer.write("/wheels", stamp_ns(k), &encode::wheels(&wheels(k))).unwrap();
    }
    writer.finish().unwrap();
    path.to_owned()
}

/// A topic of a bag written with the MCAP crate itself, where ours would refuse.
pub(crate) struct Channel {
    pub(crate) topic: &'static str,
    pub(crate) type_name: &'static str,
    pub(crate) encoding: &'static str,
    pub(crate) data: Vec<u8>,
}

impl Channel {
    pub(crate) fn odom() -> Self {
        let data = gripsight_bag::to_cdr(&encode::odometry(&odometry(0))).unwrap();
        Self { topic: "/odom", type_name: Odometry::TYPE, encoding: "cdr", data }
    }

    pub(crate) fn drive() -> Self {
        let data = gripsight_bag::to_cdr(&encode::drive(&drive(0))).unwrap();
        Self { topic: "/drive", type_name: AckermannDriveStamped::TYPE, encoding: "cdr", data }
    }
}

/// The bytes of an MCAP file with one message on each channel.
pub(crate) fn mcap_bytes(profile: &str, options: mcap::WriteOptions, channels: &[Channel]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = options.profile(profile).create(&mut bytes).unwrap();
    for channel in channels {
        let schema = writer.add_schema(channel.type_name, "ros2msg", b"").unwrap();
        let id = writer.add_channel(schema, channel.topic, channel.encoding, &BTreeMap::new()).unwrap();
        let time = START_NS as u64;
        let header =
            mcap::records::MessageHeader { channel_id: id, sequence: 0, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, &channel.data).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    bytes.into_inner()
}

/// A file with these bytes in a folder.
pub(crate) fn file(folder: &tempfile::TempDir, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join("bag.mcap");
    std::fs::write(&path, bytes).unwrap();
    path
}
