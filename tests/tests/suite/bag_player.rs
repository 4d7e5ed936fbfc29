//! The bag player, heard by CycloneDDS.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use byteorder::LittleEndian;
use gripsight_msgs::standard::ackermann_msgs::AckermannDriveStamped;
use gripsight_msgs::standard::builtin_interfaces::Time;
use gripsight_msgs::standard::diagnostic_msgs::DiagnosticArray;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::rosgraph_msgs::Clock;
use gripsight_msgs::standard::std_msgs::Header;
use gripsight_msgs::{Message, PacejkaParams, schema};
use gripsight_tests::domain::Domain;
use gripsight_tests::peers::{PATIENCE, available, cyclone, message, start_cyclone};
use gripsight_tests::process::{Process, node};
use gripsight_tests::samples;
use mcap::WriteOptions;
use mcap::records::MessageHeader;
use serde_json::Value;

const START_S: u32 = 1_700_000_000;
const DRIVE: &str = "ackermann_msgs/msg/AckermannDriveStamped";

/// A bag of `count` odometry and drive messages at 100 Hz and one parameter set.
fn write_bag(folder: &Path, count: u32) -> PathBuf {
    let path = folder.join("run.mcap");
    let file = std::io::BufWriter::new(std::fs::File::create(&path).unwrap());
    let mut writer = WriteOptions::new().profile("ros2").create(file).unwrap();
    let tires = channel::<PacejkaParams>(&mut writer, "/pacejka");
    let odom = channel::<Odometry>(&mut writer, "/odom");
    let drives = channel::<AckermannDriveStamped>(&mut writer, "/drive");
    write(&mut writer, tires, 0, &samples::pacejka(1));
    for index in 0..count {
        let odometry = Odometry { header: header(index), ..Odometry::default() };
        write(&mut writer, odom, index, &odometry);
        write(&mut writer, drives, index, &drive(index));
    }
    writer.finish().unwrap();
    path
}

type Writer = mcap::Writer<std::io::BufWriter<std::fs::File>>;

fn channel<M: Message>(writer: &mut Writer, topic: &str) -> u16 {
    let text = schema(M::TYPE).unwrap();
    let schema = writer.add_schema(M::TYPE, "ros2msg", text.as_bytes()).unwrap();
    writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap()
}

fn write<M: Message>(writer: &mut Writer, channel_id: u16, index: u32, message: &M) {
    let mut data = vec![0, 1, 0, 0];
    data.extend(cdr_encoding::to_vec::<M, LittleEndian>(message).unwrap());
    let time_ns = u64::from(START_S) * 1_000_000_000 + u64::from(index) * 10_000_000;
    let header = MessageHeader { channel_id, sequence: index, log_time: time_ns, publish_time: time_ns };
    writer.write_to_known_channel(&header, &data).unwrap();
}

fn header(index: u32) -> Header {
    let stamp = Time { sec: (START_S + index / 100) as i32, nanosec: index % 100 * 10_000_000 };
    Header { stamp, frame_id: "base_link".into() }
}

fn drive(index: u32) -> AckermannDriveStamped {
    let mut message = AckermannDriveStamped { header: header(index), ..AckermannDriveStamped::default() };
    message.drive.steering_angle = 0.001 * index as f32;
    message.drive.speed = 3.0;
    message
}

fn play(domain: &Domain, bag: &Path, more: &[&str]) -> Process {
    let bag = format!("bag:={}", bag.display());
    node(domain, "bag_player", &[&["-p", &bag, "-p", "linger_s:=0.5"][..], more].concat())
}

#[test]
fn every_message_arrives_at_ten_times_the_speed() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let python = cyclone.unwrap();
    let (domain, folder) = (Domain::new(), tempfile::tempdir().unwrap());
    let bag = write_bag(folder.path(), 1000);
    let listen = |topic: &str, type_name: &str, count: &str| {
        start_cyclone(&domain, &python, &["subscribe", topic, type_name, "--count", count])
    };
    let drives = listen("/car/drive", DRIVE, "1000");
    let tires = listen("/pacejka", "gripsight_msgs/msg/PacejkaParams", "1");
    // One every 10 ms of the machine, which a busy one does not keep up.
    let clock = listen("/clock", "rosgraph_msgs/msg/Clock", "20");
    let mut player = play(&domain, &bag, &["-p", "rate:=10.0", "-r", "/drive:=/car/drive"]);
    player.wait_for_log("subscribers are there", PATIENCE);
    let started = Instant::now();
    for index in 0..1000 {
        assert_eq!(message::<AckermannDriveStamped>(&drives), drive(index));
    }
    let elapsed_s = started.elapsed().as_secs_f64();
    assert!((0.8..4.0).contains(&elapsed_s), "9.99 s of bag took {elapsed_s} s");
    assert_eq!(message::<PacejkaParams>(&tires), samples::pacejka(1));
    let mut last = Time::default();
    for _ in 0..20 {
        let Clock { clock: now } = message(&clock);
        assert!(
            (now.sec, now.nanosec) >= (last.sec, last.nanosec)
                && (START_S..START_S + 10).contains(&(now.sec as u32))
        );
        last = now;
    }
    // Nobody listens to the odometry.
    player.wait_for_log("played 1001 messages, 9.99 s of the bag", PATIENCE);
    assert!(player.wait(PATIENCE).success());
}

#[test]
fn a_bag_that_is_cut_off_is_played_to_its_last_whole_message() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let (domain, folder) = (Domain::new(), tempfile::tempdir().unwrap());
    let whole = std::fs::read(write_bag(folder.path(), 40_000)).unwrap();
    let cut = folder.path().join("cut.mcap");
    std::fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    let drives = start_cyclone(&domain, &cyclone.unwrap(), &["subscribe", "/drive", DRIVE, "--count", "100"]);
    // Ten thousand messages a second are more than a busy peer's history holds.
    let mut player = play(&domain, &cut, &["-p", "rate:=40.0"]);
    for index in 0..100 {
        assert_eq!(message::<AckermannDriveStamped>(&drives), drive(index));
    }
    player.wait_for_log("played what is there", PATIENCE);
    assert!(player.wait(PATIENCE).success());
}

#[test]
fn the_player_waits_for_the_topics_it_is_told_to() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let python = cyclone.unwrap();
    let (domain, folder) = (Domain::new(), tempfile::tempdir().unwrap());
    let bag = write_bag(folder.path(), 10);
    let odometry =
        start_cyclone(&domain, &python, &["subscribe", "/odom", "nav_msgs/msg/Odometry", "--count", "10"]);
    let player = play(&domain, &bag, &["-p", "wait_for:=[/odom, /drive]", "-p", "settle_s:=0.2"]);
    std::thread::sleep(Duration::from_secs(2));
    let drives = start_cyclone(&domain, &python, &["subscribe", "/drive", DRIVE, "--count", "10"]);
    assert_eq!(message::<AckermannDriveStamped>(&drives), drive(0));
    assert_eq!(message::<Value>(&odometry)["header"]["stamp"]["nanosec"], 0);
    player.wait_for_log("played 20 messages", PATIENCE);
}

#[test]
fn a_node_under_simulated_time_follows_the_player() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let (domain, folder) = (Domain::new(), tempfile::tempdir().unwrap());
    let bag = write_bag(folder.path(), 400);
    let diagnostics = start_cyclone(
        &domain,
        &cyclone.unwrap(),
        &["subscribe", "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "--count", "20"],
    );
    let _node = node(&domain, "result_source", &["-p", "use_sim_time:=true"]);
    let _player = play(&domain, &bag, &[]);
    let follows = (0..20).any(|_| {
        let report: DiagnosticArray = message(&diagnostics);
        let now_s = u32::try_from(report.header.stamp.sec).unwrap();
        report.status[0].name == "result_source: transport" && (START_S..START_S + 5).contains(&now_s)
    });
    assert!(follows);
}

#[test]
fn what_cannot_be_played_is_one_clear_error() {
    let (domain, folder) = (Domain::new(), tempfile::tempdir().unwrap());
    let bag = write_bag(folder.path(), 1);
    let text = folder.path().join("notes.mcap");
    std::fs::write(&text, "no bag").unwrap();
    for (bag, more, part) in [
        (folder.path().join("none.mcap"), &[][..], "none.mcap"),
        (text, &[], "notes.mcap"),
        (bag.clone(), &["-p", "topics:=[/imu]"], "the bag has no topic /imu"),
        (bag, &["-p", "wait_for:=[/imu]"], "no topic /imu"),
    ] {
        let mut player = play(&domain, &bag, more);
        player.wait_for_log(part, PATIENCE);
        assert!(!player.wait(PATIENCE).success());
    }
}
