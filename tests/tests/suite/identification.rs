//! The whole suite on topics: a bag or a peer's messages in, Phi_p out to real peers, and the same Phi_p as offline.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use gripsight_bag::{BagWriter, Reassembler};
use gripsight_msgs::standard::ackermann_msgs::AckermannDriveStamped;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::{MagicFormula, Message, PacejkaParams, Residual, StateSequence};
use gripsight_tests::domain::Domain;
use gripsight_tests::peers::{
    PATIENCE, available, cyclone, fast_dds, message, parsed, start_built, start_cyclone,
};
use gripsight_tests::process::{Process, node, program};
use serde_json::{Value, json};

/// A run on one busy core.
const RUN: Duration = Duration::from_secs(180);
const PRIOR: (f64, f64) = (0.9, 0.2);

/// A drive of the reference car: bag and vehicle file.
pub(crate) fn drive(folder: &Path) -> (PathBuf, PathBuf) {
    simulate(folder, &["--duration", "32", "--seed", "11", "--pace", "0.9"])
}

/// Plays a drive once telemetry hears all of its topics.
pub(crate) fn play(domain: &Domain, bag: &Path, rate: &str) -> Process {
    let (path, speed) = (format!("bag:={}", bag.display()), format!("rate:={rate}"));
    let wait = "wait_for:=[/car_state/odom, /drive, /imu/data, /wheel_speeds]";
    node(domain, "bag_player", &["-p", &path, "-p", &speed, "-p", wait])
}

/// A drive as `gripsight simulate` makes it: bag and vehicle file.
pub(crate) fn simulate(folder: &Path, arguments: &[&str]) -> (PathBuf, PathBuf) {
    let bag = folder.join("drive.mcap");
    let output = Command::new(program("gripsight"))
        .arg("simulate")
        .args(arguments)
        .arg("--out")
        .arg(&bag)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    (bag, folder.join("drive.vehicle.yaml"))
}

/// telemetry, s4_residual and identifier, joined as the launchers join them.
pub(crate) fn suite(domain: &Domain, vehicle: &Path, window_s: &str) -> [Process; 3] {
    let (window, hop) = (format!("window_s:={window_s}"), format!("hop_s:={window_s}"));
    let window = ["-p", &window, "-p", &hop, "-p", "reliable_inputs:=true"];
    let topics = ["-r", "odom:=/car_state/odom", "-r", "imu:=/imu/data", "-r", "wheels:=/wheel_speeds"];
    let residual = ["-r", "sequence:=telemetry/sequence", "-r", "candidate:=identifier/candidate"];
    let follows = ["-r", "odom:=/car_state/odom", "-p", "reliable_inputs:=true"];
    [
        of_car(domain, "telemetry", vehicle, &[&window[..], &topics[..]].concat()),
        of_car(domain, "s4_residual", vehicle, &[&residual[..], &follows[..]].concat()),
        identifier(domain, vehicle, &[]),
    ]
}

/// The identifier, joined as the launchers join it.
pub(crate) fn identifier(domain: &Domain, vehicle: &Path, more: &[&str]) -> Process {
    let topics =
        ["sequence:=telemetry/sequence", "model:=s4_residual/model", "friction:=camera_prior/friction"];
    let topics = topics.iter().flat_map(|remap| ["-r", remap]).collect::<Vec<_>>();
    of_car(domain, "identifier", vehicle, &[&topics, more].concat())
}

fn of_car(domain: &Domain, name: &str, vehicle: &Path, arguments: &[&str]) -> Process {
    node(domain, name, &[arguments, &["--params-file", vehicle.to_str().unwrap()]].concat())
}

/// A peer tells the identifier the road's friction.
pub(crate) fn tell_prior(domain: &Domain, python: &Path) {
    let topic = ["publish", "/camera_prior/friction", "gripsight_msgs/msg/FrictionPrior", "--qos", "latched"];
    let mut peer = start_cyclone(domain, python, &topic);
    peer.feed(&json!({"source": 1, "valid": true, "mu": PRIOR.0, "sigma": PRIOR.1}).to_string());
    assert!(peer.wait(PATIENCE).success());
}

/// A peer that prints what it hears; `latched` keeps the last message only, `reliable` every one.
pub(crate) fn listen(
    domain: &Domain,
    python: &Path,
    topic: &str,
    kind: &str,
    qos: &str,
    count: &str,
) -> Process {
    let timeout = RUN.as_secs().to_string();
    start_cyclone(
        domain,
        python,
        &["subscribe", topic, kind, "--qos", qos, "--count", count, "--timeout", &timeout],
    )
}

/// The parts of the first sequence, as a peer received them.
fn parts(peer: &Process) -> Vec<StateSequence> {
    let mut parts: Vec<StateSequence> = vec![parsed(&peer.line(RUN))];
    while parts.len() < parts[0].chunks as usize {
        parts.push(message(peer));
    }
    parts
}

/// A set to compare by: what is not known is NaN, which is not equal to itself.
fn text(set: &PacejkaParams) -> String {
    format!("{set:?}")
}

pub(crate) fn accepted(peer: &Process) -> PacejkaParams {
    let set: PacejkaParams = parsed(&peer.line(RUN));
    assert!(
        [PacejkaParams::ACCEPTED, PacejkaParams::ACCEPTED_WITHIN].contains(&set.status),
        "{}",
        set.reason
    );
    set
}

/// What `gripsight identify` gives on recorded sequences.
fn offline(folder: &Path, parts: &[StateSequence], vehicle: &Path) -> Value {
    let bag = folder.join("recorded.mcap");
    let mut writer = BagWriter::create(&bag).unwrap();
    for part in parts {
        writer.write("/telemetry/sequence", 0, part).unwrap();
    }
    writer.finish().unwrap();
    let out = folder.join("out");
    let output = Command::new(program("gripsight"))
        .arg("identify")
        .arg(&bag)
        .args(["--prior-mu", &PRIOR.0.to_string(), "--prior-sigma", &PRIOR.1.to_string(), "--vehicle"])
        .arg(vehicle)
        .arg("--out")
        .arg(&out)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_str(&std::fs::read_to_string(out.join("identification.json")).unwrap()).unwrap()
}

fn numbers(axle: &MagicFormula) -> Value {
    json!({"b": axle.b, "c": axle.c, "d": axle.d, "e": axle.e})
}

#[test]
fn the_live_phi_p_is_the_offline_one_bit_for_bit_at_1x_and_at_10x() {
    let (Ok(python), Ok(fast)) = (cyclone(), fast_dds()) else {
        available(&[cyclone(), fast_dds()]);
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let (bag, vehicle) = drive(folder.path());
    for rate in ["1.0", "10.0"] {
        let domain = Domain::new();
        let sequences =
            listen(&domain, &python, "/telemetry/sequence", StateSequence::TYPE, "reliable", "1000");
        let tires = listen(&domain, &python, "/identifier/pacejka", PacejkaParams::TYPE, "latched", "1");
        let _suite = suite(&domain, &vehicle, "30.0");
        tell_prior(&domain, &python);
        let _player = play(&domain, &bag, rate);

        let parts = parts(&sequences);
        let live = accepted(&tires);
        let (joined, samples) = (joined(&parts), parts.iter().map(|p| p.time_s.len()).sum::<usize>());
        assert_eq!((joined.sequence_id, joined.len()), (live.handshake.sequence_id, samples));
        let offline = offline(folder.path(), &parts, &vehicle);
        assert_eq!(offline["phi_p"]["front"], numbers(&live.front), "at {rate}x");
        assert_eq!(offline["phi_p"]["rear"], numbers(&live.rear), "at {rate}x");

        // Late joiners, of both makes, get the set that the MPC has.
        let late = listen(&domain, &python, "/identifier/pacejka", PacejkaParams::TYPE, "latched", "1");
        assert_eq!(text(&accepted(&late)), text(&live));
        let late = start_built(&domain, &fast, "/identifier/pacejka", 1);
        assert_eq!(text(&message::<PacejkaParams>(&late)), text(&live));
    }
}

#[test]
fn who_takes_a_prior_s_peak_hears_first_what_the_drive_alone_shows() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    // Too gently driven for a peak.
    let (bag, vehicle) = simulate(folder.path(), &["--duration", "32", "--seed", "11", "--pace", "0.6"]);
    let domain = Domain::new();
    let tires = listen(&domain, &python, "/identifier/pacejka", PacejkaParams::TYPE, "reliable", "2");
    let [_telemetry, _residual, plain] = suite(&domain, &vehicle, "30.0");
    drop(plain);
    let _identifier = identifier(&domain, &vehicle, &["-p", "publish_provisional:=true"]);
    tell_prior(&domain, &python);
    let _player = play(&domain, &bag, "10.0");

    let shown: PacejkaParams = parsed(&tires.line(RUN));
    assert_eq!(shown.status, PacejkaParams::ACCEPTED_WITHIN, "{}", shown.reason);
    let prior: PacejkaParams = message(&tires);
    assert_eq!(prior.status, PacejkaParams::PROVISIONAL, "{}", prior.reason);
    assert_eq!(prior.handshake.sequence_id, shown.handshake.sequence_id);
    assert!(prior.front.d > shown.front.d, "{} {}", prior.front.d, shown.front.d);
}

#[test]
fn a_peer_gets_the_residual_of_every_sample_once_there_is_a_model() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let (bag, vehicle) = simulate(folder.path(), &["--duration", "25", "--seed", "11", "--pace", "0.9"]);
    let domain = Domain::new();
    let residuals = listen(&domain, &python, "/s4_residual/residual", Residual::TYPE, "reliable", "200");
    let _suite = suite(&domain, &vehicle, "9.0");
    let (path, wait) = (format!("bag:={}", bag.display()), "wait_for:=[/car_state/odom, /drive]");
    let _player = node(&domain, "bag_player", &["-p", &path, "-p", wait]);

    let mut last: Option<Residual> = None;
    let mut learned = 0.0_f64;
    for _ in 0..200 {
        let now: Residual = parsed(&residuals.line(RUN));
        assert!(now.handshake.sequence_id > 0 && now.handshake.run_id.starts_with("identifier-"));
        assert!((now.dt_s - 0.02).abs() < 0.005, "{now:?}");
        assert!(now.yaw_rate_nominal_radps.abs() < 0.5 && now.v_y_nominal_mps.abs() < 0.5, "{now:?}");
        learned = learned.max((now.yaw_rate_nominal_radps - now.yaw_rate_corrected_radps).abs());
        if let Some(last) = last.replace(now.clone()) {
            let ns = |r: &Residual| {
                i64::from(r.header.stamp.sec) * 1_000_000_000 + i64::from(r.header.stamp.nanosec)
            };
            // At the telemetry's 100 Hz, though the model's time step is 0.02 s.
            assert!((8_000_000..12_000_000).contains(&(ns(&now) - ns(&last))), "{last:?} {now:?}");
        }
    }
    assert!(learned > 1e-5, "the network says nothing");
}

fn joined(parts: &[StateSequence]) -> gripsight_signals::StateSequence {
    let mut reassembler = Reassembler::default();
    parts.iter().find_map(|p| reassembler.push(p.clone()).unwrap()).unwrap().sequence
}

#[test]
fn a_peer_s_odometry_and_drive_messages_are_identified_from() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let (bag, vehicle) = drive(folder.path());
    let domain = Domain::new();
    let tires = listen(&domain, &python, "/identifier/pacejka", PacejkaParams::TYPE, "latched", "1");
    let _suite = suite(&domain, &vehicle, "30.0");
    tell_prior(&domain, &python);
    // The drive commands first: odometry that comes before its command would have to do without.
    let kinds = [
        ("/drive", "ackermann_msgs/msg/AckermannDriveStamped"),
        ("/car_state/odom", "nav_msgs/msg/Odometry"),
    ];
    let lines = lines(&bag, kinds.map(|(topic, _)| topic));
    for ((topic, kind), lines) in kinds.into_iter().zip(lines) {
        let mut peer = start_cyclone(&domain, &python, &["publish", topic, kind, "--timeout", "60"]);
        peer.feed(&lines);
        assert!(peer.wait(RUN).success());
    }
    assert!(accepted(&tires).front.d > 0.0);
}

/// The messages of two topics of a bag as JSON lines, drive commands and odometry.
fn lines(bag: &Path, topics: [&str; 2]) -> [String; 2] {
    let mut lines = [String::new(), String::new()];
    for message in gripsight_bag::Bag::open(bag).unwrap().messages() {
        let message = message.unwrap();
        let Some(place) = topics.iter().position(|&topic| topic == message.channel.topic) else { continue };
        let json = if place == 0 {
            serde_json::to_value(gripsight_bag::from_cdr::<AckermannDriveStamped>(&message.data).unwrap())
                .unwrap()
        } else {
            let mut json =
                serde_json::to_value(gripsight_bag::from_cdr::<Odometry>(&message.data).unwrap()).unwrap();
            // Zero throughout, which is what the peer sends where nothing is given.
            json["pose"]["covariance"].take();
            json["twist"]["covariance"].take();
            json
        };
        lines[place].push_str(&json.to_string());
        lines[place].push('\n');
    }
    lines
}
