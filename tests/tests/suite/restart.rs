//! A node that was killed comes back with what it knew from disk.

use std::path::Path;
use std::time::{Duration, Instant};

use gripsight_identification::vehicle_hash;
use gripsight_msgs::{IdentificationProgress, Message, PacejkaParams};
use gripsight_tests::domain::Domain;
use gripsight_tests::peers::{PATIENCE, available, cyclone, parsed, start_cyclone};
use gripsight_tests::process::{Process, node};
use gripsight_vehicle::VehicleParameters;

use super::controller;
use super::identification::{accepted, drive, identifier, listen, play, suite, tell_prior};

const PACEJKA: &str = "/identifier/pacejka";
const CANDIDATE: &str = "/identifier/candidate";
/// Between the kill and the new start.
const AWAY: Duration = Duration::from_secs(2);

/// The age that a set states, s.
fn age_s(set: &PacejkaParams) -> f64 {
    let age = set.reason.strip_prefix("from disk: accepted ").and_then(|rest| rest.split(' ').next());
    age.unwrap_or_else(|| panic!("no age in {:?}", set.reason)).parse().unwrap()
}

/// What the identifier knows from disk: the set of before, and how long ago it was accepted at most.
fn assert_recalled(back: &PacejkaParams, before: &PacejkaParams, heard: Instant) {
    assert_eq!(back.status, PacejkaParams::PROVISIONAL, "{}", back.reason);
    assert_eq!((back.front, back.rear), (before.front, before.rear));
    assert_eq!(back.front_valid_slip_rad.to_bits(), before.front_valid_slip_rad.to_bits());
    assert_eq!(back.rear_valid_slip_rad.to_bits(), before.rear_valid_slip_rad.to_bits());
    assert_eq!(back.handshake, before.handshake);
    let age_s = age_s(back);
    assert!(age_s >= AWAY.as_secs_f64(), "{}", back.reason);
    // It was accepted up to a second before it was heard here, and ages are cut to whole seconds.
    assert!(age_s <= heard.elapsed().as_secs_f64() + 2.0, "{}", back.reason);
}

/// Starts an identifier that is told nothing; it must have nothing to tell on either topic.
fn assert_knows_nothing(
    domain: &Domain,
    python: &Path,
    vehicle: &Path,
    known: &[&str],
    warning: Option<&str>,
) {
    let quiet = |topic| {
        let listen = ["subscribe", topic, PacejkaParams::TYPE, "--qos", "latched", "--timeout", "8"];
        start_cyclone(domain, python, &listen)
    };
    let peers: [Process; 2] = [quiet(PACEJKA), quiet(CANDIDATE)];
    // Told just before a set from disk would be.
    let progress =
        listen(domain, python, "/identifier/progress", IdentificationProgress::TYPE, "latched", "1");
    let node = identifier(domain, vehicle, known);
    if let Some(warning) = warning {
        node.wait_for_log(warning, PATIENCE);
    }
    let waits: IdentificationProgress = parsed(&progress.line(PATIENCE));
    assert_eq!(waits.stage, IdentificationProgress::WAITING);
    for mut peer in peers {
        assert_eq!(peer.wait(PATIENCE).code(), Some(1), "it published a set of another car");
    }
}

#[test]
fn a_killed_identifier_comes_back_with_its_own_car_s_set_as_provisional_and_with_no_other() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let (bag, vehicle) = drive(folder.path());
    let known = folder.path().join("known");
    let kept = format!("output_folder:={}", known.display());
    let keeps = ["-p", kept.as_str()];
    let keeps_and_tells = ["-p", kept.as_str(), "-p", "publish_provisional:=true"];
    let domain = Domain::new();

    let tires = listen(&domain, &python, PACEJKA, PacejkaParams::TYPE, "latched", "1");
    let [_telemetry, _residual, unkept] = suite(&domain, &vehicle, "30.0");
    drop(unkept);
    let mpc = controller::peer(&domain, &python);
    let first = identifier(&domain, &vehicle, &[&keeps[..], &controller::OF_PEER].concat());
    tell_prior(&domain, &python);
    let _player = play(&domain, &bag, "10.0");
    let before = accepted(&tires);
    let heard = Instant::now();
    controller::assert_told(&mpc, &first, &before);
    // SIGKILL; the rest of the suite goes on.
    drop(first);
    std::thread::sleep(AWAY);

    // Where the MPC takes provisional sets it has one at once, and the run on the window that telemetry still has follows.
    let tires = listen(&domain, &python, PACEJKA, PacejkaParams::TYPE, "latched", "1");
    let own = node(&domain, "stubborn_node", &[]);
    let second = identifier(&domain, &vehicle, &[&keeps_and_tells[..], &controller::OF_OWN].concat());
    assert_recalled(&parsed(&tires.line(PATIENCE)), &before, heard);
    controller::assert_set(&domain, &python, &second, &before);
    drop(own);
    drop(second);
    drop((_telemetry, _residual));

    // Alone, it tells whoever looks at candidates, and the MPC's topic stays empty.
    let mpc = ["subscribe", PACEJKA, PacejkaParams::TYPE, "--qos", "latched", "--timeout", "8"];
    let mut mpc = start_cyclone(&domain, &python, &mpc);
    let candidates = listen(&domain, &python, CANDIDATE, PacejkaParams::TYPE, "latched", "1");
    let third = identifier(&domain, &vehicle, &keeps);
    let back: PacejkaParams = parsed(&candidates.line(PATIENCE));
    assert_eq!(back.status, PacejkaParams::PROVISIONAL, "{}", back.reason);
    assert_eq!(back.handshake.vehicle_hash, before.handshake.vehicle_hash);
    assert_eq!(mpc.wait(PATIENCE).code(), Some(1), "the MPC did not ask for provisional sets");
    drop(third);

    // A car that is a little heavier is another car, also where the file of the first one lies in its place.
    let text = std::fs::read_to_string(&vehicle).unwrap();
    let mass = VehicleParameters::from_ros_yaml(&text).unwrap().mass_kg;
    let heavier = folder.path().join("heavier.yaml");
    std::fs::write(&heavier, text.replacen(&format!("{mass}"), &format!("{}", mass * 1.25), 1)).unwrap();
    let other = VehicleParameters::from_ros_yaml(&std::fs::read_to_string(&heavier).unwrap()).unwrap();
    assert!(other.mass_kg > mass, "the mass is not in the vehicle file as {mass}");
    assert_knows_nothing(&domain, &python, &heavier, &keeps_and_tells, None);
    let place = |hash: &str| known.join(format!("last_set_{hash}.yaml"));
    std::fs::copy(place(&before.handshake.vehicle_hash), place(&vehicle_hash(&other))).unwrap();
    assert_knows_nothing(&domain, &python, &heavier, &keeps_and_tells, Some("it is of another car"));
}
