//! rosbag2's sqlite3 files, as rosbag2 lays them out, and what is read of them.

use std::path::{Path, PathBuf};

use gripsight_bag::{BagError, TopicMap, encode, info, propose, read_sequences, recover, to_cdr};
use gripsight_msgs::Message as _;
use gripsight_msgs::standard::{ackermann_msgs::AckermannDriveStamped, nav_msgs::Odometry};
use gripsight_signals::StateSequence;
use rusqlite::Connection;
use tempfile::TempDir;

use crate::support::{WHOLE, drive, odometry, stamp_ns, telemetry_bag};

/// Name and type of a topic, and its messages with their times.
pub(crate) type Topic<'a> = (&'a str, &'a str, Vec<(i64, Vec<u8>)>);

/// A file as rosbag2 of Humble writes it; of Jazzy where types have texts.
pub(crate) fn write(path: &Path, topics: &[Topic<'_>], packed: bool, texts: &[(&str, &str)]) -> PathBuf {
    let db = Connection::open(path).unwrap();
    db.execute_batch(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL, \
         offered_qos_profiles TEXT NOT NULL); \
         CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL);",
    )
    .unwrap();
    if !texts.is_empty() {
        db.execute_batch("CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT, encoding TEXT, encoded_message_definition TEXT)")
            .unwrap();
    }
    for (name, text) in texts {
        let sql = "INSERT INTO message_definitions(topic_type, encoding, encoded_message_definition) VALUES (?1, 'ros2msg', ?2)";
        db.execute(sql, (name, text)).unwrap();
    }
    let mut messages = Vec::new();
    for (id, (name, type_name, rows)) in topics.iter().enumerate() {
        db.execute("INSERT INTO topics VALUES (?1, ?2, ?3, 'cdr', '')", (id as i64 + 1, name, type_name))
            .unwrap();
        messages.extend(rows.iter().map(|(t, data)| (*t, id as i64 + 1, data)));
    }
    messages.sort_by_key(|m| m.0);
    db.execute_batch("BEGIN").unwrap();
    for (t, topic, data) in messages {
        let data = if packed { zstd::encode_all(data.as_slice(), 1).unwrap() } else { data.clone() };
        db.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?1, ?2, ?3)", (topic, t, data))
            .unwrap();
    }
    db.execute_batch("COMMIT").unwrap();
    path.to_owned()
}

pub(crate) fn standard(samples: usize) -> [Topic<'static>; 2] {
    let rows = |f: &dyn Fn(usize) -> Vec<u8>| (0..samples).map(|k| (stamp_ns(k), f(k))).collect();
    [
        ("/odom", Odometry::TYPE, rows(&|k| to_cdr(&encode::odometry(&odometry(k))).unwrap())),
        ("/drive", AckermannDriveStamped::TYPE, rows(&|k| to_cdr(&encode::drive(&drive(k))).unwrap())),
    ]
}

fn read(path: &Path, topics: &TopicMap) -> StateSequence {
    read_sequences(path, topics, WHOLE).unwrap().0.remove(0)
}

#[test]
fn sqlite_gives_what_mcap_gives_however_it_is_packed() {
    let folder = TempDir::new().unwrap();
    let mcap = telemetry_bag(&folder.path().join("bag.mcap"), 300);
    let without = TopicMap { imu: Some(String::new()), wheels: Some(String::new()), ..TopicMap::default() };
    let expected = read(&mcap, &without);
    let plain = write(&folder.path().join("plain.db3"), &standard(300), false, &[]);
    let packed = write(&folder.path().join("packed.db3"), &standard(300), true, &[]);
    let whole = folder.path().join("whole.db3.zstd");
    std::fs::write(&whole, zstd::encode_all(std::fs::read(&plain).unwrap().as_slice(), 1).unwrap()).unwrap();
    for path in [&plain, &packed, &whole] {
        assert_eq!(read(path, &TopicMap::default()), expected, "{}", path.display());
    }
    let bag = folder.path().join("bag");
    std::fs::create_dir(&bag).unwrap();
    std::fs::rename(&whole, bag.join("bag_0.db3.zstd")).unwrap();
    std::fs::write(
        bag.join("metadata.yaml"),
        "rosbag2_bagfile_information:\n  relative_file_paths: [bag_0.db3]\n",
    )
    .unwrap();
    assert_eq!(read(&bag, &TopicMap::default()), expected);
    assert_eq!(info(&bag, &TopicMap::default()).unwrap().messages, 600);
    let out = folder.path().join("out.mcap");
    assert_eq!(recover(&plain, &out).unwrap().messages, 600);
    assert_eq!(read(&out, &TopicMap::default()), expected);
}

#[test]
fn a_file_cut_short_gives_what_is_there_or_says_so() {
    let folder = TempDir::new().unwrap();
    let plain = write(&folder.path().join("plain.db3"), &standard(2000), false, &[]);
    let bytes = std::fs::read(&plain).unwrap();
    let cut = folder.path().join("cut.db3");
    std::fs::write(&cut, &bytes[..bytes.len() * 6 / 10]).unwrap();
    match read_sequences(&cut, &TopicMap::default(), WHOLE) {
        Ok((sequences, report)) => assert!(report.truncated.is_some() && sequences[0].len() < 2000),
        Err(error) => assert!(error.to_string().contains("cut.db3"), "{error}"),
    }
    std::fs::write(&cut, &bytes[..100]).unwrap();
    assert!(read_sequences(&cut, &TopicMap::default(), WHOLE).unwrap_err().to_string().contains("sqlite3"));
}

#[test]
fn a_bag_of_ros_1_is_refused_with_the_command_that_converts_it() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("drive.bag");
    std::fs::write(&path, b"#ROSBAG V2.0\n....").unwrap();
    let error = read_sequences(&path, &TopicMap::default(), WHOLE).unwrap_err();
    assert!(matches!(error, BagError::Ros1 { .. }));
    assert!(error.to_string().contains("rosbags-convert --src"), "{error}");
}

/// A header, then the fields of one's own.
fn own(k: usize, speed: f32, steering_deg: f64, names: &[&str], values: &[f64]) -> Vec<u8> {
    let mut cdr = vec![0, 1, 0, 0];
    let align = |cdr: &mut Vec<u8>, to: usize| cdr.resize((cdr.len() - 4).next_multiple_of(to) + 4, 0);
    let stamp = stamp_ns(k);
    cdr.extend(((stamp / 1_000_000_000) as i32).to_le_bytes());
    cdr.extend(((stamp % 1_000_000_000) as u32).to_le_bytes());
    cdr.extend(5_u32.to_le_bytes());
    cdr.extend(b"base\0");
    cdr.push(1);
    align(&mut cdr, 4);
    cdr.extend(speed.to_le_bytes());
    align(&mut cdr, 8);
    cdr.extend(steering_deg.to_le_bytes());
    cdr.extend((names.len() as u32).to_le_bytes());
    for name in names {
        align(&mut cdr, 4);
        cdr.extend((name.len() as u32 + 1).to_le_bytes());
        cdr.extend(name.bytes().chain([0]));
    }
    align(&mut cdr, 4);
    cdr.extend((values.len() as u32).to_le_bytes());
    for value in values {
        align(&mut cdr, 8);
        cdr.extend(value.to_le_bytes());
    }
    cdr
}

const OWN: &str = "std_msgs/Header header\nbool on # comment\nfloat32 speed_kmh\nfloat64 steering_deg\nuint8 LEFT=1\nstring[] name\nfloat64[] y\n";

fn own_topics(samples: usize) -> [Topic<'static>; 1] {
    let rows = (0..samples).map(|k| {
        let t = 0.01 * k as f64;
        let data = own(
            k,
            if k < 150 { 36.0 } else { 39.6 },
            10.0 * t.sin(),
            &["gyro", "wheel_fl"],
            &[0.5 * t.sin(), 33.0],
        );
        (stamp_ns(k) + 7_000_000, data)
    });
    [("/own", "car_msgs/msg/Own", rows.collect())]
}

#[test]
fn any_field_of_any_message_is_a_signal() {
    let folder = TempDir::new().unwrap();
    let path = write(&folder.path().join("own.db3"), &own_topics(200), false, &[("car_msgs/msg/Own", OWN)]);
    let topics = TopicMap::parse(
        "v_x: {topic: /own, field: speed_kmh, unit: km/h}\n\
         measured_steering: {topic: /own, field: steering_deg, unit: deg, gain: 2.0, offset: 1.0, sign: -1}\n\
         yaw_rate: {topic: /own, field: 'y[gyro]'}\n\
         wheel_speed_fl: {topic: /own, field: 'y[wheel_fl]', stamp: log}\n",
    )
    .unwrap();
    let sequence = read(&path, &topics);
    assert_eq!((sequence.len(), sequence.start_stamp_ns), (200, stamp_ns(0)));
    let (k, t) = (60, 0.6_f64);
    assert!((sequence.v_x_mps[k] - 10.0).abs() < 1e-5);
    assert!((f64::from(sequence.yaw_rate_radps[k]) - 0.5 * t.sin()).abs() < 1e-6);
    let steering = -(10.0 * t.sin() - 1.0).to_radians() / 2.0;
    assert!((f64::from(sequence.steering_rad[k]) - steering).abs() < 1e-6);
    assert_eq!(sequence.measured_steering_rad[k], sequence.steering_rad[k]);
    assert!(sequence.command_time_s.is_empty() && !sequence.has_v_y());
    assert_eq!(sequence.wheel_speed_fl_radps[k], 33.0);
    for (line, why) in [
        ("v_x: {topic: /own, field: speed}", "there are header, on, speed_kmh"),
        ("v_x: {topic: /own, field: header}", "go on to one of stamp, frame_id"),
        ("v_x: {topic: /own, field: y}", "is an array"),
        ("v_x: {topic: /own, field: speed_kmh, unit: furlong}", "known are m/s, km/h"),
        ("v_x: {topic: /other, field: x}", "/other"),
        ("v_x: {topic: /own}", "say which field"),
        ("v_x: {topic: /own, field: speed_kmh, gain: 0}", "gain is 0"),
        ("v_x: {topic: /own, field: speed_kmh, stamp: on}", "no `on` that is a time"),
    ] {
        let text = format!("{line}\nmeasured_steering: {{topic: /own, field: steering_deg, unit: deg}}\n");
        let error = read_sequences(&path, &TopicMap::parse(&text).unwrap(), WHOLE).unwrap_err().to_string();
        assert!(error.contains(why), "{line}: {error}");
    }
    assert!(TopicMap::parse("speed: /own").unwrap_err().contains("signals v_x, v_y"));
}

#[test]
fn a_pose_of_another_point_is_moved_to_the_centre_of_gravity() {
    let folder = TempDir::new().unwrap();
    let path = write(&folder.path().join("run.db3"), &standard(200), false, &[]);
    let of = |text: &str| read(&path, &TopicMap::parse(text).unwrap());
    let (here, there) =
        (of("odom: /odom\npose: /odom\n"), of("odom: /odom\npose: {topic: /odom, ahead_m: -0.2}\n"));
    assert!(!here.pose_time_s.is_empty() && here.pose_yaw_rad == there.pose_yaw_rad);
    for k in 0..here.pose_time_s.len() {
        let turned = |f: fn(f32) -> f32| 0.2 * (f(here.pose_yaw_rad[k]) - f(here.pose_yaw_rad[0]));
        assert!((there.pose_x_m[k] - here.pose_x_m[k] - turned(f32::cos)).abs() < 1e-5);
        assert!((there.pose_y_m[k] - here.pose_y_m[k] - turned(f32::sin)).abs() < 1e-5);
    }
    let refused = TopicMap::parse("odom: {topic: /odom, ahead_m: 0.1}").unwrap_err();
    assert!(refused.contains("a pose `ahead_m`"), "{refused}");
}

#[test]
fn the_text_of_a_type_may_lie_beside_the_bag_and_without_it_the_way_on_is_told() {
    let folder = TempDir::new().unwrap();
    let path = write(&folder.path().join("own.db3"), &own_topics(200), false, &[]);
    let line = "v_x: {topic: /own, field: speed_kmh, unit: km/h}\nsteering: {topic: /own, field: steering_deg, unit: deg}\n";
    let topics = TopicMap::parse(line).unwrap();
    let error = read_sequences(&path, &topics, WHOLE).unwrap_err().to_string();
    assert!(error.contains("lay its .msg file beside the bag"), "{error}");
    std::fs::create_dir_all(folder.path().join("car_msgs/msg")).unwrap();
    std::fs::write(folder.path().join("car_msgs/msg/Own.msg"), OWN).unwrap();
    assert_eq!(read(&path, &topics).len(), 200);
    let proposal = propose(&path).unwrap();
    assert!(proposal.text.contains("field: speed_kmh, unit: km/h"), "{}", proposal.text);
    assert!(
        proposal.text.contains("measured_steering: {topic: /own, field: steering_deg, unit: deg}"),
        "{}",
        proposal.text
    );
    assert_eq!(proposal.problem, None, "{}", proposal.text);
}

#[test]
fn every_shipped_stack_reads() {
    let stacks = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../params/stacks");
    let mut count = 0;
    for entry in std::fs::read_dir(stacks).unwrap() {
        let path = entry.unwrap().path();
        let topics = TopicMap::read(&path).unwrap();
        topics.live().unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        count += 1;
    }
    assert!(count >= 7, "{count}");
}
