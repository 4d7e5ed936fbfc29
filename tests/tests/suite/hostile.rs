//! Datagrams of strangers: recorded announcements, replayed and mutated tens of thousands of times. What RustDDS keeps of them is not bounded,
//! so the guard bounds the process; afterwards the node does its work as before.

use std::net::UdpSocket;
use std::time::{Duration, Instant};

use gripsight_msgs::PacejkaParams;
use gripsight_mutants::Mutants;
use gripsight_tests::domain::Domain;
use gripsight_tests::peers::{PATIENCE, available, cyclone, message, start_cyclone};
use gripsight_tests::samples;

use super::runtime::source;

const PACEJKA: &str = "gripsight_msgs/msg/PacejkaParams";
/// Datagrams sent, where no campaign asks for more.
const COUNT: usize = 40_000;
/// Memory that the node may hold (MB), and what it may hold for the quarter of a second that the guard needs to see it.
const LIMIT_MB: f64 = 100.0;
const SEEN_LATE_MB: f64 = 400.0;
/// Built-in readers of announcements (participants, writers, readers), and a user's.
const READERS: [[u8; 4]; 4] = [[0, 1, 0, 0xc7], [0, 0, 3, 0xc7], [0, 0, 4, 0xc7], [0, 0, 0x12, 0x04]];
/// Submessages that make a reader remember: DATA, DATA_FRAG, HEARTBEAT, GAP, HEARTBEAT_FRAG.
const KINDS: [u8; 5] = [0x15, 0x16, 0x07, 0x08, 0x13];

/// What a participant with this index in the domain receives: (discovery, data) (RTPS 2.5, 9.6.2.3).
fn ports(domain: &Domain, index: u16) -> [u16; 2] {
    let [(_, id), ..] = domain.environment();
    let first = 7400 + 250 * id.parse::<u16>().unwrap() + 2 * index;
    [first + 10, first + 11]
}

/// Changes bytes behind the header, adds submessages of any length, or makes the sender somebody new.
fn mutated(seed: &[u8], numbers: &mut Mutants) -> Vec<u8> {
    let mut datagram = seed.to_vec();
    if numbers.below(2) == 0 {
        datagram[8..20].iter_mut().for_each(|byte| *byte = numbers.byte());
    }
    for _ in 0..numbers.below(8) {
        let at = 8 + numbers.below(datagram.len() - 8);
        datagram[at] = numbers.byte();
    }
    for _ in 0..numbers.below(4) {
        let length = numbers.below(1200);
        let stated = if numbers.below(4) == 0 { numbers.below(65536) } else { length + 20 } as u16;
        datagram.extend([KINDS[numbers.below(KINDS.len())], numbers.byte() | 1]);
        datagram.extend(stated.to_le_bytes());
        datagram.extend([0, 0, 16, 0]);
        datagram.extend(READERS[numbers.below(READERS.len())]);
        datagram.extend([0, numbers.byte(), numbers.byte(), 0xc2]);
        datagram.extend((numbers.below(1 << 20) as u64).to_le_bytes());
        datagram.extend((0..length).map(|_| numbers.byte()));
    }
    datagram.truncate(60_000);
    datagram
}

#[test]
fn mutated_datagrams_cost_a_stated_amount_of_memory_and_the_node_goes_on() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let python = cyclone.unwrap();
    let domain = Domain::new();
    let limit = format!("memory_limit_mb:={LIMIT_MB}");
    let node = source(&domain, &["-p", "seed:=11", "-p", &limit]);
    let victim = ports(&domain, 0);

    // A peer announces itself to every participant that there may be, and so to this ear.
    let ear = UdpSocket::bind(("127.0.0.1", ports(&domain, 30)[0])).unwrap();
    ear.set_read_timeout(Some(Duration::from_secs(3))).unwrap();
    let listen = ["subscribe", "/result_source/pacejka", PACEJKA, "--qos", "latched"];
    let peer = start_cyclone(&domain, &python, &listen);
    let mut buffer = [0; 65_536];
    let mut seeds = Vec::new();
    while seeds.len() < 2 {
        let length = ear.recv(&mut buffer).expect("no announcement of the peer");
        if buffer.starts_with(b"RTPS") && length > 40 {
            seeds.push(buffer[..length].to_vec());
        }
    }
    assert_eq!(message::<PacejkaParams>(&peer), samples::pacejka(11));
    drop(peer);

    let mut numbers = Mutants::new(0x9e37_79b9_7f4a_7c15);
    let (start, mut most_mb) = (Instant::now(), 0.0_f64);
    let count = Mutants::count(COUNT);
    for index in 0..count {
        let datagram = mutated(&seeds[index % seeds.len()], &mut numbers);
        ear.send_to(&datagram, ("127.0.0.1", victim[numbers.below(2)])).ok();
        if index % 64 == 0 {
            // Faster than the node can read, the system drops them.
            std::thread::sleep(Duration::from_millis(10));
            most_mb = most_mb.max(node.peak_memory_mb());
        }
    }
    println!("{count} datagrams in {:.1?}: the node held {most_mb:.0} MB at most", start.elapsed());
    assert!(most_mb < LIMIT_MB + SEEN_LATE_MB, "{most_mb} MB");

    // It may have started anew several times, with pauses between.
    let listen = ["subscribe", "/result_source/pacejka", PACEJKA, "--qos", "latched", "--timeout", "60"];
    let late = start_cyclone(&domain, &python, &listen);
    let set: PacejkaParams = serde_json::from_str(&late.line(2 * PATIENCE)).unwrap();
    assert_eq!(set, samples::pacejka(11));
}
