//! The recorded bags under `shared/bags`: real telemetry that nobody here made.

use std::path::PathBuf;

use gripsight_bag::{TopicMap, read_sequences};

use crate::support::WHOLE;

/// The bag's file, or `None` with a line that says so where the data are not at hand.
fn recorded(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../../shared/bags"));
    let path = path.join(name).join(format!("{name}.mcap"));
    if !path.exists() {
        eprintln!("SKIPPED: {name} is not there");
        return None;
    }
    Some(path)
}

/// Name, messages of each stream, rate and length as the bags' own description states them.
const BAGS: [(&str, [usize; 4], f64, f64); 4] = [
    ("rc10_mocap", [11815, 11815, 11815, 0], 100.0, 120.0),
    ("iac_putnam", [10149, 10149, 0, 10149], 25.0, 406.0),
    ("f1tenth_ds5", [5763, 5763, 5763, 5763], 50.0, 115.0),
    ("carmaker_experiment3", [9237, 9237, 9237, 0], 100.0, 92.0),
];

#[test]
fn every_recorded_bag_reads_whole() {
    for (name, counts, rate_hz, length_s) in BAGS {
        let Some(path) = recorded(name) else { continue };
        let (sequences, report) = read_sequences(&path, &TopicMap::default(), WHOLE).unwrap();
        let [sequence] = &sequences[..] else { panic!("{name}: {} sequences", sequences.len()) };
        assert_eq!(report.counts, counts, "{name}");
        assert_eq!(
            (report.taken.left_out(), report.taken.without_drive, &report.truncated),
            (0, 0, &None),
            "{name}"
        );
        assert_eq!(sequence.len(), counts[0], "{name}");
        assert!((sequence.duration_s() - length_s).abs() < 2.0, "{name}: {} s", sequence.duration_s());
        let health = gripsight_signals::DataHealth::of(sequence).unwrap();
        assert!((health.rate_hz / rate_hz - 1.0).abs() < 0.02, "{name}: {} Hz", health.rate_hz);
    }
}
