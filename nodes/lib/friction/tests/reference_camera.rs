//! The network on the reference car's road pictures: another renderer, whose pictures training never shows.

#![allow(clippy::unwrap_used)]

mod reference_roads;

use std::ops::Range;
use std::path::Path;

use gripsight_friction::{Estimate, find_library};
use reference_roads::{SIDES, estimator, read};

/// Roads of neither the development (5000 to 5039) nor the model card's measurement (9000 to 9039).
const SEEDS: Range<u64> = 7000..7020;

#[test]
fn its_roads_are_read_in_the_order_of_their_friction_and_dry_is_not_taken_for_slippery() {
    if find_library(None, Path::new(env!("CARGO_MANIFEST_DIR"))).is_err() {
        eprintln!("SKIPPED: no ONNX Runtime; run launch_scripts/fetch_onnxruntime.sh");
        return;
    }
    let mut estimator = estimator().unwrap();
    for side in SIDES {
        let mut means = vec![];
        for true_mu in [0.85, 0.60, 0.25, 0.10] {
            let all: Vec<Estimate> = read(&mut estimator, side, true_mu, SEEDS).collect();
            let usable: Vec<f64> = all.iter().filter(|e| e.valid()).map(|e| e.mu).collect();
            assert!(
                usable.len() as f64 >= 0.9 * all.len() as f64,
                "{side}, {true_mu}: {} usable",
                usable.len()
            );
            means.push(usable.iter().sum::<f64>() / usable.len() as f64);
            // What must never be: slippery, believed to be dry.
            let believed = all.iter().filter(|e| e.valid() && e.mu > 0.7).count();
            match true_mu {
                0.85 => assert!(believed as f64 >= 0.9 * all.len() as f64, "{side}: {believed} dry"),
                0.60 => {}
                _ => assert_eq!(believed, 0, "{side}, {true_mu}: taken for dry"),
            }
        }
        assert!(means.is_sorted_by(|a, b| a > b), "{side}: {means:?}");
    }
}
