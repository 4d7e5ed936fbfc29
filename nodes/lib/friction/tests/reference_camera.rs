//! The network on the reference car's road pictures: another renderer, whose pictures training never shows.

#![allow(clippy::unwrap_used)]

use std::ops::Range;
use std::path::Path;

use gripsight_friction::{
    Basis, Estimate, Frame, FrameData, FrictionEstimator, OnnxRuntime, RawPicture, Settings, find_library,
    find_model,
};
use gripsight_reference_car::RoadCamera;

/// Roads of neither the development (5000 to 5039) nor the model card's measurement (9000 to 9039).
const SEEDS: Range<u64> = 7000..7020;
/// What a camera of the reference car takes, and a larger one.
const SIDES: [u32; 2] = [RoadCamera::SIDE_PX, 256];

fn estimator() -> Option<FrictionEstimator> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let Ok(library) = find_library(None, here) else {
        eprintln!("SKIPPED: no ONNX Runtime; run launch_scripts/fetch_onnxruntime.sh");
        return None;
    };
    let network = OnnxRuntime::load(&library, &find_model(None, here).unwrap()).unwrap();
    Some(FrictionEstimator::new(Settings::default(), Basis::builtin().unwrap(), Some(Box::new(network))))
}

/// What is read off the roads of friction `true_mu`.
fn read(estimator: &mut FrictionEstimator, side: u32, true_mu: f64) -> Vec<Estimate> {
    let mut read = |seed| {
        let picture = RoadCamera::new(seed).picture(side, 3.0, true_mu);
        let raw = RawPicture {
            width: side,
            height: side,
            step: side * 3,
            encoding: "rgb8",
            big_endian: false,
            data: &picture.data,
        };
        estimator.read_single(&Frame { stamp_ns: 0, data: FrameData::Raw(raw) })
    };
    SEEDS.map(&mut read).collect()
}

#[test]
fn its_roads_are_read_in_the_order_of_their_friction_and_dry_is_not_taken_for_slippery() {
    let Some(mut estimator) = estimator() else { return };
    for side in SIDES {
        let mut means = vec![];
        for true_mu in [0.85, 0.60, 0.25, 0.10] {
            let all = read(&mut estimator, side, true_mu);
            let usable: Vec<f64> = all.iter().filter(|e| e.valid()).map(|e| e.mu).collect();
            // The gates refuse 7.5 % of honest renders of training, hardly any of these.
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
