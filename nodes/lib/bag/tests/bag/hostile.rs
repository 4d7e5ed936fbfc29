//! Whatever the bytes, the answer is a result: nothing panics, hangs, or asks for more memory than the file is worth.

use std::sync::OnceLock;

use gripsight_bag::{Bag, Reassembler, TopicMap, from_cdr, info, read_sequences, recover};
use gripsight_msgs::StateSequence;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::sensor_msgs::JointState;
use proptest::prelude::*;
use tempfile::TempDir;

use crate::support::{Channel, WHOLE, file, mcap_bytes, telemetry_bag};

/// A few small bags, by kind of chunk.
fn seeds() -> &'static [Vec<u8>] {
    static SEEDS: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    SEEDS.get_or_init(|| {
        let folder = TempDir::new().unwrap();
        let options = mcap::WriteOptions::new;
        let channels = [Channel::odom(), Channel::drive()];
        let mut seeds = vec![std::fs::read(telemetry_bag(&folder.path().join("a.mcap"), 20)).unwrap()];
        for options in [
            options().compression(None),
            options().compression(None).calculate_chunk_crcs(false),
            options().calculate_chunk_crcs(false),
            options().compression(Some(mcap::Compression::Lz4)).calculate_chunk_crcs(false),
            options().use_chunks(false),
        ] {
            seeds.push(mcap_bytes("ros2", options, &channels));
        }
        seeds
    })
}

/// Everything that reads a bag.
fn read_all(bytes: &[u8]) {
    let folder = TempDir::new().unwrap();
    let path = file(&folder, bytes);
    if let Ok(bag) = Bag::open(&path) {
        let read = bag.messages().filter(Result::is_ok).count();
        assert!(read <= bytes.len() * 1000);
    }
    let _ = read_sequences(&path, &TopicMap::default(), WHOLE);
    let _ = info(&path, &TopicMap::default());
    let _ = recover(&path, &folder.path().join("out.mcap"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn changed_bytes(
        seed in 0usize..6,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
        lengths in prop::collection::vec((any::<prop::sample::Index>(), any::<u64>()), 0..3),
    ) {
        let mut bytes = seeds()[seed].clone();
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        for (at, value) in lengths {
            let at = at.index(bytes.len() - 8);
            bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
        }
        read_all(&bytes);
    }

    #[test]
    fn cut_and_spliced_bytes(seed in 0usize..6, cut in any::<prop::sample::Index>(), from in any::<prop::sample::Index>()) {
        let bytes = &seeds()[seed];
        let (cut, from) = (cut.index(bytes.len()), from.index(bytes.len()));
        read_all(&bytes[..cut]);
        read_all(&[&bytes[..cut], &bytes[from..]].concat());
    }

    #[test]
    fn any_bytes_as_messages(bytes in prop::collection::vec(any::<u8>(), 0..400), little in any::<bool>()) {
        let bytes = [&[0, u8::from(little), 0, 0], &bytes[..]].concat();
        let _ = from_cdr::<Odometry>(&bytes);
        let _ = from_cdr::<JointState>(&bytes).map(|m| gripsight_bag::decode::wheels(&m));
        let mut reassembler = Reassembler::default();
        let _ = from_cdr::<StateSequence>(&bytes).map(|m| reassembler.push(m));
    }
}
