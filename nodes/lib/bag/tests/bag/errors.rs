//! Every way in which a bag can be wrong gives its own error, with the place in its text.

use gripsight_bag::{Bag, BagError, BagWriter, TopicMap, encode, read_measurements, read_sequences};
use gripsight_msgs::standard::rosgraph_msgs::Clock;
use tempfile::TempDir;

use crate::support::{Channel, START_NS, WHOLE, drive, file, mcap_bytes, odometry, telemetry_bag};

fn read_with(bytes: &[u8], topics: &TopicMap) -> BagError {
    let folder = TempDir::new().unwrap();
    read_sequences(&file(&folder, bytes), topics, WHOLE).unwrap_err()
}

fn read(bytes: &[u8]) -> BagError {
    read_with(bytes, &TopicMap::default())
}

fn ros2(channels: &[Channel]) -> Vec<u8> {
    mcap_bytes("ros2", mcap::WriteOptions::new(), channels)
}

#[test]
fn no_such_file() {
    let error = Bag::open("/nowhere/at/all.mcap".as_ref()).unwrap_err();
    assert!(matches!(error, BagError::Io { .. }) && error.to_string().contains("/nowhere/at/all"), "{error}");
}

#[test]
fn not_a_bag() {
    for bytes in [&b""[..], b"SQLite format 3\0 and so on"] {
        assert!(matches!(read(bytes), BagError::NotABag { .. }));
    }
    let folder = TempDir::new().unwrap();
    assert!(matches!(Bag::open(folder.path()), Err(BagError::NotABag { .. })));
    for (metadata, why) in [
        ("storage_identifier: mcap\n  relative_file_paths: []", "no file"),
        ("storage_identifier: [", "metadata.yaml"),
    ] {
        let text = format!("rosbag2_bagfile_information:\n  {metadata}\n");
        std::fs::write(folder.path().join("metadata.yaml"), text).unwrap();
        let error = Bag::open(folder.path()).unwrap_err();
        assert!(matches!(error, BagError::NotABag { .. }) && error.to_string().contains(why), "{error}");
    }
}

#[test]
fn another_profile() {
    let error = read(&mcap_bytes("ros1", mcap::WriteOptions::new(), &[Channel::odom(), Channel::drive()]));
    assert!(matches!(&error, BagError::Profile { profile, .. } if profile == "ros1"), "{error}");
}

#[test]
fn missing_topic() {
    let error = read(&ros2(&[Channel::odom()]));
    assert!(matches!(error, BagError::MissingTopic { role: "drive", .. }), "{error}");
    assert!(error.to_string().contains("/odom (nav_msgs/msg/Odometry)"), "{error}");
    let topics = TopicMap { odom: Some("/ekf".to_owned()), ..TopicMap::default() };
    let error = read_with(&ros2(&[Channel::odom(), Channel::drive()]), &topics);
    assert!(matches!(&error, BagError::MissingTopic { wanted, .. } if wanted == "/ekf"), "{error}");
}

#[test]
fn predictions_beside_a_recording_are_not_taken_for_it() {
    let own = Channel { topic: "/gripsight/nominal/odom", ..Channel::odom() };
    let bytes = ros2(&[own, Channel::odom(), Channel::drive()]);
    // The one message of each topic is then too little to work on, which is the next thing to say.
    let error = read(&bytes);
    assert!(matches!(error, BagError::NothingAligned { .. }), "{error}");
    let error =
        read(&ros2(&[Channel { topic: "/gripsight/nominal/odom", ..Channel::odom() }, Channel::drive()]));
    assert!(matches!(error, BagError::MissingTopic { role: "odom", .. }), "{error}");
}

#[test]
fn several_topics_of_one_type() {
    let bytes = ros2(&[Channel::odom(), Channel { topic: "/ekf/odom", ..Channel::odom() }, Channel::drive()]);
    let error = read(&bytes);
    assert!(
        matches!(&error, BagError::AmbiguousTopic { candidates, .. } if candidates.len() == 2),
        "{error}"
    );
    assert!(error.to_string().contains("`odom: /ekf/odom`"), "{error}");
    let topics = TopicMap { odom: Some("/odom".to_owned()), ..TopicMap::default() };
    // The one message of each topic is then too little to work on, which is the next thing to say.
    let error = read_with(&bytes, &topics);
    assert!(matches!(error, BagError::NothingAligned { aligned: 1, .. }), "{error}");
}

#[test]
fn wrong_type() {
    let topics = TopicMap { odom: Some("/drive".to_owned()), ..TopicMap::default() };
    let error = read_with(&ros2(&[Channel::odom(), Channel::drive()]), &topics);
    assert!(
        matches!(&error, BagError::WrongType { topic, role: "odom", .. } if topic == "/drive"),
        "{error}"
    );
}

#[test]
fn not_cdr() {
    let error = read(&ros2(&[Channel { encoding: "json", ..Channel::odom() }, Channel::drive()]));
    assert!(matches!(&error, BagError::Encoding { encoding, .. } if encoding == "json"), "{error}");
}

#[test]
fn bytes_that_are_no_message() {
    let of = |data: Vec<u8>| match read(&ros2(&[Channel { data, ..Channel::odom() }, Channel::drive()])) {
        BagError::Message { topic, index: 0, error, .. } if topic == "/odom" => *error,
        other => panic!("{other}"),
    };
    assert!(matches!(of(vec![0, 1]), BagError::NoEncapsulation { len: 2 }));
    let xcdr2 = [vec![0, 7, 0, 0], Channel::odom().data[4..].to_vec()].concat();
    assert!(matches!(of(xcdr2), BagError::Encapsulation { identifier: 7 }));
    assert!(matches!(of(Channel::odom().data[..100].to_vec()), BagError::Body { len: 100, .. }));
    let mut huge_text = Channel::odom().data;
    huge_text[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(matches!(of(huge_text), BagError::Body { .. }));
}

#[test]
fn a_message_that_cannot_be_read_costs_itself() {
    let folder = TempDir::new().unwrap();
    let bad = Channel { data: vec![0, 1], ..Channel::odom() };
    let bytes = ros2(&[Channel::odom(), bad, Channel::odom(), Channel::drive()]);
    let (measurements, report) = read_measurements(&file(&folder, &bytes), &TopicMap::default()).unwrap();
    assert_eq!(measurements.len(), 3);
    let [unreadable] = &report.unreadable[..] else { panic!("{:?}", report.unreadable) };
    assert_eq!((&unreadable.topic[..], unreadable.messages), ("/odom", 1));
    assert!(unreadable.first.contains("message 1 "), "{}", unreadable.first);
}

#[test]
fn an_empty_bag() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("empty.mcap");
    let mut writer = BagWriter::create(&path).unwrap();
    writer.write("/log", START_NS, &Clock::default()).unwrap();
    writer.finish().unwrap();
    assert!(matches!(read_sequences(&path, &TopicMap::default(), WHOLE), Err(BagError::MissingTopic { .. })));
    // Topics without messages: the channels are declared, nothing was recorded.
    let bytes = {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let mut writer = mcap::WriteOptions::new().profile("ros2").create(&mut bytes).unwrap();
        for channel in [Channel::odom(), Channel::drive()] {
            let schema = writer.add_schema(channel.type_name, "ros2msg", b"").unwrap();
            writer.add_channel(schema, channel.topic, "cdr", &Default::default()).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        bytes.into_inner()
    };
    assert!(matches!(read(&bytes), BagError::Empty { .. }));
}

#[test]
fn unknown_compression() {
    let bytes = ros2(&[Channel::odom(), Channel::drive()]);
    let at = bytes.windows(4).position(|w| w == b"zstd").unwrap();
    let mut bytes = bytes;
    bytes[at..at + 4].copy_from_slice(b"blzx");
    let error = read(&bytes);
    assert!(matches!(&error, BagError::Compression { compression, .. } if compression == "blzx"), "{error}");
}

#[test]
fn a_damaged_chunk() {
    let plain = mcap::WriteOptions::new().compression(None);
    let mut bytes = mcap_bytes("ros2", plain, &[Channel::odom(), Channel::drive()]);
    let at = bytes.windows(9).position(|w| w == b"base_link").unwrap();
    bytes[at] = b'B';
    let error = read(&bytes);
    assert!(matches!(&error, BagError::Damaged { why, .. } if why.contains("checksum")), "{error}");
}

#[test]
fn lengths_beyond_the_file() {
    let plain = mcap::WriteOptions::new().compression(None).calculate_chunk_crcs(false);
    let bytes = mcap_bytes("ros2", plain, &[Channel::odom(), Channel::drive()]);
    // The length of the first record after the header's, and of the chunk's first record.
    let header_end = 8 + 9 + u64::from_le_bytes(bytes[9..17].try_into().unwrap()) as usize;
    for at in [header_end + 1, header_end + 9 + 40 + 1] {
        for (len, truncated) in [(u64::MAX, false), (1 << 29, at == header_end + 1)] {
            let mut bytes = bytes.clone();
            bytes[at..at + 8].copy_from_slice(&len.to_le_bytes());
            let folder = TempDir::new().unwrap();
            let error = Bag::open(&file(&folder, &bytes)).unwrap().messages().find_map(Result::err).unwrap();
            assert_eq!(matches!(error, BagError::Truncated { .. }), truncated, "{error}");
            assert!(truncated || matches!(error, BagError::Damaged { .. }), "{error}");
        }
    }
}

#[test]
fn samples_that_are_not_numbers_or_go_back() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, change: &dyn Fn(usize, &mut gripsight_signals::OdometrySample)| {
        let path = folder.path().join(name);
        let mut writer = BagWriter::create(&path).unwrap();
        for k in 0..50 {
            let mut sample = odometry(k);
            change(k, &mut sample);
            writer.write("/odom", odometry(k).stamp_ns, &encode::odometry(&sample)).unwrap();
            writer.write("/drive", odometry(k).stamp_ns, &encode::drive(&drive(k))).unwrap();
        }
        writer.finish().unwrap();
        let (mut sequences, report) = read_sequences(&path, &TopicMap::default(), WHOLE).unwrap();
        (sequences.remove(0).len(), report.taken)
    };
    let (samples, taken) = write("nan.mcap", &|k, s| s.v_y_mps = if k == 20 { f64::NAN } else { 0.0 });
    assert_eq!((samples, taken.not_finite), (49, 1));
    assert!(taken.first_problem.unwrap().contains("odom: v_y_mps is NaN"));
    let (samples, taken) = write("back.mcap", &|k, s| s.stamp_ns -= if k == 30 { 55_000_000 } else { 0 });
    assert_eq!((samples, taken.out_of_order), (49, 1));
    assert!((taken.most_back_s - 0.045).abs() < 1e-9, "{taken:?}");
    let (samples, taken) = write("unset.mcap", &|k, s| s.stamp_ns *= i64::from(k != 30));
    assert_eq!((samples, taken.out_of_order, taken.clock_jumps), (49, 1, 0));
}

#[test]
fn streams_on_different_clocks() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("clocks.mcap");
    let mut writer = BagWriter::create(&path).unwrap();
    for k in 0..50 {
        let unstamped = gripsight_signals::DriveSample { stamp_ns: 0, ..drive(k) };
        writer.write("/odom", odometry(k).stamp_ns, &encode::odometry(&odometry(k))).unwrap();
        writer.write("/drive", odometry(k).stamp_ns, &encode::drive(&unstamped)).unwrap();
    }
    writer.finish().unwrap();
    let error = read_sequences(&path, &TopicMap::default(), WHOLE).unwrap_err();
    assert!(
        matches!(error, BagError::NothingAligned { aligned: 0, without_drive: 50, duplicates: 49, .. }),
        "{error}"
    );
}

#[test]
fn a_truncated_bag_reads_to_its_end_and_says_so() {
    let folder = TempDir::new().unwrap();
    let bytes = std::fs::read(telemetry_bag(&folder.path().join("whole.mcap"), 500)).unwrap();
    let path = file(&folder, &bytes[..bytes.len() / 2]);
    let (sequences, report) = read_sequences(&path, &TopicMap::default(), WHOLE).unwrap();
    assert!(report.truncated.unwrap().contains("bag recover"));
    assert!((100..400).contains(&sequences[0].len()), "{}", sequences[0].len());
    let last = Bag::open(&path).unwrap().messages().last().unwrap().unwrap_err();
    let BagError::Truncated { messages, .. } = last else { panic!("{last}") };
    assert!(messages > 400);
}

#[test]
fn a_topics_file() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("topics.yaml");
    std::fs::write(&path, "odom: /ekf/odom\nimu: ''\n").unwrap();
    let topics = TopicMap::read(&path).unwrap();
    assert_eq!((topics.odom.as_deref(), topics.imu.as_deref()), (Some("/ekf/odom"), Some("")));
    std::fs::write(&path, "odometry: /ekf/odom\n").unwrap();
    let error = TopicMap::read(&path).unwrap_err();
    assert!(
        matches!(error, BagError::TopicsFile { .. }) && error.to_string().contains("odometry"),
        "{error}"
    );
}

#[test]
fn what_cannot_be_written() {
    let folder = TempDir::new().unwrap();
    assert!(matches!(BagWriter::create(folder.path()), Err(BagError::Write { .. })));
    let mut writer = BagWriter::create(&folder.path().join("bag.mcap")).unwrap();
    assert!(matches!(writer.write("/a", -1, &Clock::default()), Err(BagError::Write { .. })));
    writer.write("/a", 1, &Clock::default()).unwrap();
    assert!(matches!(writer.write("/a", 2, &encode::drive(&drive(0))), Err(BagError::Write { .. })));
}
