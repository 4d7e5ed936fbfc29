//! What the runtime promises, seen from outside by peers that share no code with it.

use std::time::Duration;

use byteorder::LittleEndian;
use gripsight_msgs::standard::diagnostic_msgs::{DiagnosticArray, DiagnosticStatus};
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::rcl_interfaces::Log;
use gripsight_msgs::{PacejkaParams, StateSequence};
use gripsight_tests::domain::Domain;
use gripsight_tests::peers::{
    PATIENCE, available, cyclone, cyclone_of_jazzy, fast_dds, message, start_built, start_cyclone,
};
use gripsight_tests::process::{Process, node};
use gripsight_tests::samples;
use serde_json::{Value, json};

const PACEJKA: &str = "gripsight_msgs/msg/PacejkaParams";
const SEQUENCE: &str = "gripsight_msgs/msg/StateSequence";

/// The node under test, once it is up.
pub(crate) fn source(domain: &Domain, ros_args: &[&str]) -> Process {
    let node = node(domain, "result_source", ros_args);
    node.wait_for_log("publishes as", PATIENCE);
    node
}

#[test]
fn both_peers_decode_every_field() {
    let (cyclone, fast_dds) = (cyclone(), fast_dds());
    if !available(&[cyclone.clone(), fast_dds.clone()]) {
        return;
    }
    let domain = Domain::new();
    let args = ["--qos", "latched"];
    let early = start_cyclone(
        &domain,
        &cyclone.unwrap(),
        &[&["subscribe", "/result_source/pacejka", PACEJKA][..], &args].concat(),
    );
    let early_fast = start_built(&domain, &fast_dds.unwrap(), "/result_source/pacejka", 1);
    let _node = source(&domain, &["-p", "seed:=11"]);
    let expected = samples::pacejka(11);
    assert_eq!(message::<PacejkaParams>(&early), expected, "CycloneDDS");
    assert_eq!(message::<PacejkaParams>(&early_fast), expected, "Fast DDS");
}

/// Tools of ROS 2 neither show nor record a topic that has two types.
#[test]
fn a_peer_sees_one_type_on_the_clock() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let domain = Domain::new();
    let arguments = ["types", "/clock", "rosgraph_msgs/msg/Clock", "--count", "2", "--timeout", "25"];
    let mut peer = start_cyclone(&domain, &cyclone.unwrap(), &arguments);
    // A node that gives the time, and one that takes it.
    let _giver = node(&domain, "sim_car", &["-p", "publish_clock:=true"]);
    let _taker = source(&domain, &["-p", "use_sim_time:=true"]);
    assert_eq!(message::<Vec<String>>(&peer), ["rosgraph_msgs/msg/Clock"]);
    assert!(peer.wait(PATIENCE).success());
}

#[test]
fn a_node_whose_time_stands_still_says_so() {
    let domain = Domain::new();
    let node = source(&domain, &["-p", "use_sim_time:=true"]);
    node.wait_for_log("nothing arrives on /clock", PATIENCE);
}

/// By their hash tools of ROS 2 tell types apart, and of an endpoint without one its middlewares warn, each time.
#[test]
fn endpoints_are_announced_with_the_hash_of_their_type() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let domain = Domain::new();
    let arguments = ["user_data", "/clock", "rosgraph_msgs/msg/Clock", "--count", "2", "--timeout", "25"];
    let mut peer = start_cyclone(&domain, &cyclone.unwrap(), &arguments);
    // A writer and a reader of one type.
    let _giver = node(&domain, "sim_car", &["-p", "publish_clock:=true"]);
    let _taker = source(&domain, &["-p", "use_sim_time:=true"]);
    let hash = gripsight_msgs::type_hash("rosgraph_msgs/msg/Clock").unwrap();
    assert_eq!(message::<Vec<String>>(&peer), [format!("typehash={hash};")]);
    assert!(peer.wait(PATIENCE).success());
}

#[test]
fn late_joiners_get_the_last_result() {
    let (cyclone, fast_dds) = (cyclone(), fast_dds());
    if !available(&[cyclone.clone(), fast_dds.clone()]) {
        return;
    }
    let domain = Domain::new();
    let _node = source(&domain, &[]);
    std::thread::sleep(Duration::from_secs(1));
    let expected = samples::pacejka(7);
    let late = start_cyclone(
        &domain,
        &cyclone.unwrap(),
        &["subscribe", "/result_source/pacejka", PACEJKA, "--qos", "latched"],
    );
    assert_eq!(message::<PacejkaParams>(&late), expected, "CycloneDDS");
    let late_fast = start_built(&domain, &fast_dds.unwrap(), "/result_source/pacejka", 1);
    assert_eq!(message::<PacejkaParams>(&late_fast), expected, "Fast DDS");
}

#[test]
fn sequences_of_140_kb_reach_cyclone() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let domain = Domain::new();
    let peer = start_cyclone(
        &domain,
        &cyclone.unwrap(),
        &["subscribe", "/result_source/sequence", "gripsight_msgs/msg/StateSequence", "--count", "5"],
    );
    let _node = source(&domain, &["-p", "samples:=7000"]);
    for _ in 0..5 {
        assert!(message::<StateSequence>(&peer) == samples::sequence(7000), "the sequence differs");
    }
}

/// Lengths of all four remainders modulo 4. Without padding CycloneDDS 0.10 gets none of them but
/// the multiples of 4, and stalls at the first that is not.
#[test]
fn fragments_of_any_length_reach_the_cyclone_of_jazzy() {
    let cyclone = cyclone_of_jazzy();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let domain = Domain::new();
    let peer = start_built(&domain, &cyclone.unwrap(), "/result_source/picture", 8);
    let _node = source(&domain, &[]);
    let lengths: Vec<usize> = (0..8)
        .map(|_| {
            let line = peer.line(PATIENCE);
            let (length, sum) = line.split_once(' ').unwrap();
            let length = length.parse().unwrap();
            let expected: u64 = samples::picture(length).data.into_iter().map(u64::from).sum();
            assert_eq!(sum.parse(), Ok(expected));
            length
        })
        .collect();
    let expected: Vec<usize> = (lengths[0]..lengths[0] + 8).map(|length| 100_000 + length % 4).collect();
    assert_eq!(lengths, expected);
}

#[test]
fn names_are_remapped() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let domain = Domain::new();
    let _node = source(&domain, &["-r", "__ns:=/car", "-r", "__node:=mpc_source", "-r", "~/pacejka:=tires"]);
    let python = cyclone.unwrap();
    let remapped = start_cyclone(&domain, &python, &["subscribe", "/car/tires", PACEJKA, "--qos", "latched"]);
    assert_eq!(message::<PacejkaParams>(&remapped), samples::pacejka(7));
    let diagnostics = start_cyclone(
        &domain,
        &python,
        &["subscribe", "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "--qos", "reliable"],
    );
    assert_eq!(message::<DiagnosticArray>(&diagnostics).status[0].name, "car/mpc_source: transport");
}

#[test]
fn no_sample_of_a_peer_is_lost() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let python = cyclone.unwrap();
    let domain = Domain::new();
    let _node = source(&domain, &["-p", "reliable_inputs:=true", "-r", "odom:=/car_state/odom"]);
    let odometry = "nav_msgs/msg/Odometry";
    let listener =
        start_cyclone(&domain, &python, &["subscribe", "/result_source/echo", odometry, "--count", "500"]);
    std::thread::sleep(Duration::from_secs(1));
    let mut publisher = start_cyclone(
        &domain,
        &python,
        &["publish", "/car_state/odom", odometry, "--qos", "reliable", "--period", "0.002"],
    );
    let sent: Vec<Value> = (0..500)
        .map(|index| {
            json!({
                "header": {"stamp": {"sec": index, "nanosec": 5}, "frame_id": "map"},
                "child_frame_id": "base_link",
                "twist": {"twist": {"linear": {"x": 0.1 * f64::from(index)}}},
            })
        })
        .collect();
    let text: String = sent.iter().map(|message| format!("{message}\n")).collect();
    publisher.feed(&text);
    for expected in &sent {
        let received: Value = message(&listener);
        assert_eq!(received["header"], expected["header"]);
        assert_eq!(received["twist"]["twist"]["linear"]["x"], expected["twist"]["twist"]["linear"]["x"]);
    }
    assert!(publisher.wait(PATIENCE).success());
}

/// A file of one message, as the Fast DDS peer plays it.
fn prepared_odometry() -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().unwrap();
    let mut message = vec![0, 1, 0, 0];
    message.extend(cdr_encoding::to_vec::<_, LittleEndian>(&Odometry::default()).unwrap());
    let length = u32::try_from(message.len()).unwrap().to_le_bytes();
    std::fs::write(file.path(), [&length[..], &message].concat()).unwrap();
    file
}

/// Fast DDS writes what the node hears, and hears what it answers; `launch_scripts/latency.sh` stands on it.
#[test]
fn fast_dds_writes_and_hears_the_answers() {
    let fast_dds = fast_dds();
    if !available(std::slice::from_ref(&fast_dds)) {
        return;
    }
    let domain = Domain::new();
    let _node = source(&domain, &[]);
    let file = prepared_odometry();
    let odometry = "nav_msgs/msg/Odometry";
    let answered = ["1", "/result_source/echo", odometry];
    let mut peer = std::process::Command::new(fast_dds.unwrap());
    peer.args(["play", "100", "2"]).args(answered).args(["/odom", odometry]).arg(file.path());
    let output = peer.envs(domain.environment()).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{text}");
    let timed: Vec<Vec<&str>> = text
        .lines()
        .map(|line| line.split(' ').collect())
        .filter(|words: &Vec<_>| words.len() == 3)
        .collect();
    let lost = timed.iter().filter(|words| words[2] == "-").count();
    // Best effort, on a machine that may be busy.
    assert!(timed.len() >= 150 && 2 * lost < timed.len(), "{lost} of {} lost", timed.len());
}

#[test]
fn messages_that_cannot_be_decoded_become_a_diagnostic() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let python = cyclone.unwrap();
    let domain = Domain::new();
    let _node = source(&domain, &[]);
    // RustDDS matches by the topic's name alone, so a sequence on `odom` reaches the decoder.
    let _wrong = source(&domain, &["-r", "__node:=wrong", "-r", "~/sequence:=/odom", "-p", "samples:=1"]);
    let listener = start_cyclone(
        &domain,
        &python,
        &["subscribe", "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "--count", "20"],
    );
    let is_warned = (0..20).any(|_| {
        let transport = &message::<DiagnosticArray>(&listener).status[0];
        transport.name == "result_source: transport"
            && transport.level == DiagnosticStatus::WARN
            && transport.values[0].key == "/odom"
    });
    assert!(is_warned);
}

#[test]
fn logs_reach_rosout_and_late_joiners() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let domain = Domain::new();
    let _node = source(&domain, &["-r", "__ns:=/car"]);
    let listener = start_cyclone(
        &domain,
        &cyclone.unwrap(),
        &["subscribe", "/rosout", "rcl_interfaces/msg/Log", "--qos", "latched"],
    );
    // That it publishes, or that it has started: the reader keeps one line of those that come at once.
    let line: Log = message(&listener);
    assert!(line.msg.contains("/car/result_source"), "{}", line.msg);
    assert_eq!((line.name.as_str(), line.level), ("car.result_source", Log::INFO));
}

#[test]
fn signals_end_the_node_cleanly() {
    for signal in ["INT", "TERM"] {
        let domain = Domain::new();
        let mut node = source(&domain, &[]);
        node.signal(signal);
        assert!(node.wait(Duration::from_secs(10)).success(), "SIG{signal}");
    }
}

#[test]
fn a_node_that_was_stopped_and_goes_on_is_heard_again() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let domain = Domain::new();
    let node = source(&domain, &[]);
    let hear = || {
        let listener = start_cyclone(&domain, &python, &["subscribe", "/result_source/sequence", SEQUENCE]);
        assert!(!message::<StateSequence>(&listener).time_s.is_empty());
    };
    hear();
    node.signal("STOP");
    std::thread::sleep(Duration::from_millis(500));
    node.signal("CONT");
    hear();
    assert!(!started_anew(&node), "it has forgotten what it knew");
}

fn started_anew(node: &Process) -> bool {
    std::fs::read_to_string(format!("/proc/{}/environ", node.id()))
        .unwrap()
        .contains("GRIPSIGHT_STARTED_ANEW")
}

/// Whatever DDS is doing at that moment.
#[test]
fn a_node_that_is_stopped_while_it_starts_starts() {
    for after_ms in (4..60).step_by(4) {
        let domain = Domain::new();
        let node = Process::start(
            &domain,
            std::process::Command::new(gripsight_tests::process::program("stubborn_node")),
        );
        std::thread::sleep(Duration::from_millis(after_ms));
        node.signal("STOP");
        std::thread::sleep(Duration::from_millis(50));
        node.signal("CONT");
        node.wait_for_log("up as", PATIENCE);
        // Were an event loop at its end, it would be noticed soon.
        std::thread::sleep(Duration::from_millis(300));
        assert!(!started_anew(&node), "stopped after {after_ms} ms");
    }
}

#[test]
fn enforced_security_stops_the_start() {
    let domain = Domain::new();
    let start = |strategy: &str| {
        let mut command = std::process::Command::new(gripsight_tests::process::program("stubborn_node"));
        command.env("ROS_SECURITY_ENABLE", "true").env("ROS_SECURITY_STRATEGY", strategy);
        Process::start(&domain, command)
    };
    let mut refused = start("Enforce");
    refused.wait_for_log("this node cannot authenticate or encrypt", PATIENCE);
    assert!(!refused.wait(PATIENCE).success());
    let open = start("Permissive");
    open.wait_for_log("runs open", PATIENCE);
    open.wait_for_log("up as", PATIENCE);
}

/// The range LOCALHOST keeps others on the network from writing, whatever they do; with SUBNET the same stranger is heard.
#[test]
fn a_stranger_on_the_network_writes_to_no_node_of_this_machine_only() {
    let fast_dds = fast_dds();
    if !available(std::slice::from_ref(&fast_dds)) {
        return;
    }
    let peer = fast_dds.unwrap();
    let apart = || std::process::Command::new("unshare");
    if !apart().args(["-n", "true"]).status().is_ok_and(|status| status.success()) {
        eprintln!("SKIPPED: network namespaces need root");
        return;
    }
    let file = prepared_odometry();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/peers/stranger.sh");
    let is_heard = |range: &str| {
        let mut command = apart();
        command.args(["-n", "bash", script, range]);
        command.arg(gripsight_tests::process::program("result_source")).arg(&peer).arg(file.path());
        let output = command.output().unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(text.starts_with("ready"), "{text}{}", String::from_utf8_lossy(&output.stderr));
        output.status.success()
    };
    assert!(is_heard("SUBNET"));
    assert!(!is_heard("LOCALHOST"));
}

/// Nodes of another domain neither hear nor are heard.
#[test]
fn a_peer_in_another_domain_hears_nothing() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let (domain, other) = (Domain::new(), Domain::new());
    let _node = source(&domain, &[]);
    let arguments = ["subscribe", "/result_source/sequence", SEQUENCE, "--timeout"];
    let mut apart = start_cyclone(&other, &python, &[&arguments[..], &["5"]].concat());
    let beside = start_cyclone(&domain, &python, &[&arguments[..], &["50"]].concat());
    assert!(!message::<StateSequence>(&beside).time_s.is_empty());
    assert!(!apart.wait(PATIENCE).success());
}
