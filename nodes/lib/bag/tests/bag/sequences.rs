//! State sequences over messages, in chunks, and out of bags.

use gripsight_bag::{
    Bag, BagError, BagWriter, CHUNK_LIMIT_BYTES, Reassembler, Role, TopicMap, read_recorded_sequences,
    read_sequences, sequence_to_messages, to_cdr,
};
use gripsight_msgs::Handshake;
use gripsight_signals::{Clock, Kind, Signal, StateSequence, WindowConfig};
use proptest::prelude::*;
use tempfile::TempDir;

use crate::support::{Channel, START_NS, WHOLE, file, mcap_bytes, telemetry_bag};

/// A sequence of `len` samples with every channel its own, some of them not recorded.
fn sequence(len: usize, recorded: bool) -> StateSequence {
    let channel =
        |c: u32| (0..len).map(|k| f32::from_bits(0x3f00_0000 + c * 0x1_0000 + k as u32)).collect::<Vec<_>>();
    let mut sequence =
        StateSequence { sequence_id: 77, start_stamp_ns: START_NS + 1, ..StateSequence::default() };
    for (c, (row, values)) in sequence.table_mut().into_iter().enumerate() {
        let share = if row.clock == Clock::Samples { len } else { len / 2 };
        if row.kind == Kind::Time && (recorded || row.required) {
            *values = (0..share).map(|k| k as f32 * 0.01).collect();
        } else if recorded || row.required {
            *values = channel(c as u32)[..share].to_vec();
        }
    }
    sequence
}

fn handshake() -> Handshake {
    Handshake { run_id: "run".to_owned(), vehicle_hash: "f".repeat(64), seed: 3, ..Handshake::default() }
}

#[test]
fn no_message_is_over_the_limit_and_chunks_are_few() {
    for (recorded, len, chunks) in [(true, 3000, 5), (false, 3000, 2), (true, 60_000, 90), (false, 2, 1)] {
        let messages = sequence_to_messages(&sequence(len, recorded), &handshake(), "map");
        let longest = messages.iter().map(|m| to_cdr(m).unwrap().len()).max().unwrap();
        assert!(longest <= CHUNK_LIMIT_BYTES, "{longest}");
        assert_eq!(messages.len(), chunks);
    }
}

#[test]
fn parts_that_do_not_fit_are_refused() {
    let [first, ..] = &sequence_to_messages(&sequence(5000, true), &handshake(), "map")[..] else { panic!() };
    let mut reassembler = Reassembler::default();
    for (chunk, chunks) in [(3, 3), (0, 0)] {
        let message = gripsight_msgs::StateSequence { chunk, chunks, ..first.clone() };
        assert!(matches!(reassembler.push(message), Err(BagError::Chunk { sequence_id: 77, .. })));
    }
    let mut uneven = gripsight_msgs::StateSequence { chunks: 1, ..first.clone() };
    uneven.v_y_mps.pop();
    assert!(matches!(reassembler.push(uneven), Err(BagError::Samples(_))));
}

proptest! {
    /// Repeated, late and mixed parts give each sequence once and exactly.
    #[test]
    fn parts_in_any_order(order in Just((0..11usize).collect::<Vec<_>>()).prop_shuffle(), repeats in prop::collection::vec(0..11usize, 0..20)) {
        let [a, b] = [1, 2].map(|id| StateSequence { sequence_id: id, ..sequence(3000 + id as usize, true) });
        let mut parts: Vec<_> = [&a, &b].iter().flat_map(|s| sequence_to_messages(s, &handshake(), "map")).collect();
        prop_assert_eq!(parts.len(), 10);
        parts.push(parts[2].clone());
        let mut reassembler = Reassembler::default();
        let mut whole = Vec::new();
        for k in order.into_iter().chain(repeats) {
            whole.extend(reassembler.push(parts[k].clone()).unwrap());
        }
        whole.sort_by_key(|r| r.sequence.sequence_id);
        let sequences: Vec<_> = whole.iter().map(|r| r.sequence.clone()).collect();
        prop_assert_eq!(sequences, vec![a, b]);
        prop_assert_eq!(&whole[0].handshake.run_id, "run");
    }
}

#[test]
fn lost_parts_are_forgotten_and_a_cleared_reassembler_starts_afresh() {
    let parts = |id| {
        sequence_to_messages(&StateSequence { sequence_id: id, ..sequence(4000, true) }, &handshake(), "map")
    };
    let mut reassembler = Reassembler::default();
    for id in 0..100 {
        assert_eq!(reassembler.push(parts(id)[0].clone()).unwrap(), None);
    }
    let mut complete = |id: u64| parts(id).into_iter().filter_map(|p| reassembler.push(p).unwrap()).count();
    assert_eq!((complete(99), complete(99), complete(0)), (1, 0, 1));
    reassembler.clear();
    let whole = parts(99).into_iter().filter_map(|p| reassembler.push(p).unwrap()).count();
    assert_eq!(whole, 1);
}

#[test]
fn recorded_sequences_come_back_bit_for_bit() {
    let folder = TempDir::new().unwrap();
    let raw = telemetry_bag(&folder.path().join("raw.mcap"), 1000);
    let window = WindowConfig { length_s: 4.0, hop_s: 2.0 };
    let (cut, _) = read_sequences(&raw, &TopicMap::default(), window).unwrap();
    assert_eq!(cut.len(), 3, "full windows only");
    let path = folder.path().join("recorded.mcap");
    let mut writer = BagWriter::create(&path).unwrap();
    for sequence in &cut {
        for part in sequence_to_messages(sequence, &handshake(), "map") {
            writer.write("/telemetry/sequence", sequence.start_stamp_ns, &part).unwrap();
        }
    }
    writer.finish().unwrap();
    let (back, report) = read_sequences(&path, &TopicMap::default(), WHOLE).unwrap();
    assert_eq!(back, cut);
    assert_eq!(report.recorded_sequences.as_deref(), Some("/telemetry/sequence"));
    let bag = gripsight_bag::Bag::open(&path).unwrap();
    let recorded = read_recorded_sequences(&bag, &TopicMap::default()).unwrap();
    assert!(
        recorded.iter().all(|r| r.handshake.seed == 3 && r.handshake.sequence_id == r.sequence.sequence_id)
    );
}

#[test]
fn a_command_of_another_known_type_is_found_where_it_is_the_only_one() {
    let folder = tempfile::tempdir().unwrap();
    let autoware = |topic| Channel {
        topic,
        type_name: "autoware_control_msgs/msg/Control",
        encoding: "cdr",
        data: Vec::new(),
    };
    let resolve = |channels: &[Channel]| {
        let path = file(&folder, &mcap_bytes("ros2", mcap::WriteOptions::new(), channels));
        TopicMap::default().resolve(&Bag::open(&path).unwrap())
    };
    let streams = resolve(&[Channel::odom(), autoware("/control/command/control_cmd")]).unwrap();
    assert_eq!(streams.topic(Role::Odom), Some("/odom"));
    assert_eq!(streams.topic(Role::Drive), None);
    let mapped = &streams.mapped()[0];
    assert_eq!(mapped.topic, "/control/command/control_cmd");
    assert!(mapped.signals.iter().any(|(signal, _)| *signal == Signal::Steering), "{:?}", mapped.signals);
    // Beside the stream's own type it is left alone; of two nobody knows which.
    let streams = resolve(&[Channel::odom(), Channel::drive(), autoware("/control_cmd")]).unwrap();
    assert!(streams.topic(Role::Drive) == Some("/drive") && streams.mapped().is_empty());
    let error = resolve(&[Channel::odom(), autoware("/a"), autoware("/b")]).unwrap_err();
    assert!(matches!(error, BagError::MissingTopic { role: "drive", .. }), "{error}");
}
