//! What is written is what is read.

use byteorder::BigEndian;
use gripsight_bag::{
    Bag, BagError, BagWriter, TopicMap, decode, encode, from_cdr, read_measurements, read_sequences, recover,
    to_cdr,
};
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::sensor_msgs::JointState;
use gripsight_signals::{Measurement, OdometrySample};
use proptest::prelude::*;
use tempfile::TempDir;

use crate::support::{START_NS, WHOLE, drive, file, imu, odometry, telemetry_bag, wheels};

#[test]
fn measurements_come_back_in_order() {
    let folder = TempDir::new().unwrap();
    for name in ["bag.mcap", "folder"] {
        let path = telemetry_bag(&folder.path().join(name), 300);
        let (measurements, report) = read_measurements(&path, &TopicMap::default()).unwrap();
        assert_eq!(report.counts, [300; 4]);
        assert_eq!(Bag::open(&path).unwrap().path(), path);
        for (k, m) in measurements.chunks(4).enumerate() {
            let Measurement::Odometry(o) = m[0] else { panic!("{m:?}") };
            let expected = odometry(k);
            approx::assert_abs_diff_eq!(o.yaw_rad, expected.yaw_rad, epsilon = 1e-15);
            assert_eq!(OdometrySample { yaw_rad: expected.yaw_rad, ..o }, expected);
            assert_eq!(m[1], Measurement::Drive(drive(k)));
            assert_eq!(m[2], Measurement::Imu(imu(k)));
            assert_eq!(m[3], Measurement::Wheels(wheels(k)));
        }
    }
}

#[test]
fn the_same_messages_give_the_same_bytes() {
    let folder = TempDir::new().unwrap();
    let bytes = |name: &str| std::fs::read(telemetry_bag(&folder.path().join(name), 500)).unwrap();
    assert_eq!(bytes("a.mcap"), bytes("b.mcap"));
}

#[test]
fn nothing_stands_under_the_name_before_the_bag_is_whole() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("bag.mcap");
    let mut writer = BagWriter::create(&path).unwrap();
    for k in 0..350 {
        writer.write("/odom", odometry(k).stamp_ns, &encode::odometry(&odometry(k))).unwrap();
    }
    assert!(!path.exists());
    // What a crash would leave: all but the last second of bag time.
    let left = folder.path().join("left.mcap");
    std::fs::copy(folder.path().join("bag.mcap.part"), &left).unwrap();
    let recovered = recover(&left, &folder.path().join("recovered.mcap")).unwrap();
    assert!(recovered.messages >= 300 && recovered.damage.len() == 1, "{recovered:?}");
    writer.finish().unwrap();
    assert!(path.exists() && !folder.path().join("bag.mcap.part").exists());
}

#[test]
fn a_truncated_bag_is_recovered_up_to_its_last_whole_message() {
    let folder = TempDir::new().unwrap();
    let whole = telemetry_bag(&folder.path().join("whole.mcap"), 250);
    let messages: Vec<_> = Bag::open(&whole).unwrap().messages().map(Result::unwrap).collect();
    let bytes = std::fs::read(&whole).unwrap();
    let out = folder.path().join("out.mcap");
    let mut before = 0;
    for cut in (1000..bytes.len()).step_by(bytes.len() / 23) {
        let recovered = match recover(&file(&folder, &bytes[..cut]), &out) {
            // The first block of compressed bytes is not whole yet.
            Err(BagError::Empty { .. }) if before == 0 => continue,
            other => other.unwrap(),
        };
        let back: Vec<_> = Bag::open(&out).unwrap().messages().map(Result::unwrap).collect();
        assert_eq!(back.len() as u64, recovered.messages);
        assert_eq!(recovered.damage.len(), 1);
        assert!(back.len() >= before, "a longer file gives no less");
        before = back.len();
        for (a, b) in back.iter().zip(&messages) {
            assert_eq!((&a.data, a.log_time, a.sequence), (&b.data, b.log_time, b.sequence));
            assert_eq!(a.channel.topic, b.channel.topic);
            assert_eq!(a.channel.schema.as_ref().unwrap().data, b.channel.schema.as_ref().unwrap().data);
        }
    }
    assert!(before >= 800, "all but the last second: {before}");
    let again = recover(&whole, &out).unwrap();
    assert_eq!((again.messages, again.damage.len()), (1000, 0));
    assert!(recover(&out, &out).is_err(), "a bag is not written over itself");
}

#[test]
fn a_folder_of_several_files_is_one_bag() {
    let folder = TempDir::new().unwrap();
    let whole = telemetry_bag(&folder.path().join("whole.mcap"), 300);
    let split = folder.path().join("split");
    std::fs::create_dir(&split).unwrap();
    let messages: Vec<_> = Bag::open(&whole).unwrap().messages().map(Result::unwrap).collect();
    // Twelve files, so that file 10 must not come before file 2.
    for (k, part) in messages.chunks(100).enumerate() {
        let mut writer = BagWriter::create(&split.join(format!("bag_{k}.mcap"))).unwrap();
        part.iter().for_each(|m| writer.copy(m).unwrap());
        writer.finish().unwrap();
    }
    let read = |path| read_sequences(path, &TopicMap::default(), WHOLE).unwrap();
    assert_eq!(read(&split), read(&whole));
}

#[test]
fn wheels_are_found_by_name() {
    let of = |names: &[&str]| {
        let message = JointState {
            name: names.iter().map(|&n| n.to_owned()).collect(),
            velocity: (0..names.len()).map(|v| v as f64).collect(),
            ..JointState::default()
        };
        decode::wheels(&message).unwrap().map(|w| w.speed)
    };
    assert_eq!(of(&["wheel_fl", "wheel_fr", "wheel_rl", "wheel_rr"]), Some([0.0, 1.0, 2.0, 3.0]));
    assert_eq!(of(&["rear_right", "rear_left", "front_right", "front_left"]), Some([3.0, 2.0, 1.0, 0.0]));
    let robot = ["steering", "Front-Left-Wheel", "Front-Right-Wheel", "back_left", "back_right"];
    assert_eq!(of(&robot), Some([1.0, 2.0, 3.0, 4.0]));
    assert_eq!(of(&["wheel_speed"]), None);
    assert_eq!(of(&["front_left", "front_right"]), None);
    let short = JointState {
        name: ["fl", "fr", "rl", "rr"].map(str::to_owned).to_vec(),
        velocity: vec![1.0; 3],
        ..JointState::default()
    };
    assert!(decode::wheels(&short).is_err());
    assert_eq!(decode::wheels(&JointState { velocity: Vec::new(), ..short }).unwrap(), None);
}

#[test]
fn a_sensor_that_says_not_measured_gives_no_sample() {
    let mut message = encode::imu(&imu(3));
    assert!(decode::imu(&message).is_some());
    assert_eq!(message.linear_acceleration.z, 9.806_65, "a sensor at rest reads gravity upward");
    message.linear_acceleration_covariance[0][0] = -1.0;
    assert_eq!(decode::imu(&message), None);
}

proptest! {
    #[test]
    fn stamps_and_headings_survive(stamp_ns in -2_000_000_000_000_000_000i64..2_000_000_000_000_000_000, yaw in -3.1f64..3.1) {
        let sample = OdometrySample { stamp_ns, yaw_rad: yaw, ..OdometrySample::default() };
        let back = decode::odometry(&encode::odometry(&sample));
        prop_assert_eq!(back.stamp_ns, stamp_ns);
        prop_assert!((back.yaw_rad - yaw).abs() < 1e-14);
    }

    #[test]
    fn both_byte_orders_read(x in any::<f64>(), frame in "[a-z_]{0,20}") {
        let mut message: Odometry = encode::odometry(&OdometrySample { x_m: x, stamp_ns: START_NS, ..OdometrySample::default() });
        message.header.frame_id = frame;
        let mut big = vec![0, 0, 0, 0];
        cdr_encoding::to_writer::<_, BigEndian, _>(&mut big, &message).unwrap();
        let little = to_cdr(&message).unwrap();
        prop_assert_eq!(little.len() % 4, 0);
        for bytes in [big, little] {
            let back: Odometry = from_cdr(&bytes).unwrap();
            prop_assert_eq!(back.pose.pose.position.x.to_bits(), x.to_bits());
            prop_assert_eq!(&back.header.frame_id, &message.header.frame_id);
        }
    }
}
