//! The network on the reference car's road pictures: another renderer, never seen in training.
//!
//! Dry, wet and icy roads only. Its snow is read as dry and its standing water as ice (`nodes/camera_prior/model/MODEL_CARD.md`):
//! no bound is set there, as none that means something would hold.

#![allow(clippy::unwrap_used)]

use std::ops::Range;
use std::path::Path;

use gripsight_friction::{
    Basis, Frame, FrameData, FrictionEstimator, OnnxRuntime, RawPicture, Settings, find_library, find_model,
};
use gripsight_reference_car::RoadCamera;

const SIDE: u32 = 256;
/// Roads outside the model card's measurement (1000 to 1039).
const SEEDS: Range<u64> = 2000..2020;
/// The network's RMSE on held-out renders, as the model card states it.
const RMSE: f64 = 0.103;

fn estimator() -> Option<FrictionEstimator> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let Ok(library) = find_library(None, here) else {
        eprintln!("SKIPPED: no ONNX Runtime; run launch_scripts/fetch_onnxruntime.sh");
        return None;
    };
    let network = OnnxRuntime::load(&library, &find_model(None, here).unwrap()).unwrap();
    Some(FrictionEstimator::new(Settings::default(), Basis::builtin().unwrap(), Some(Box::new(network))))
}

/// What is read off the usable pictures of roads of friction `true_mu`.
fn read(estimator: &mut FrictionEstimator, true_mu: f64) -> Vec<f64> {
    SEEDS
        .filter_map(|seed| {
            let picture = RoadCamera::new(seed).picture(SIDE, 3.0, true_mu);
            let raw = RawPicture {
                width: SIDE,
                height: SIDE,
                step: SIDE * 3,
                encoding: "rgb8",
                big_endian: false,
                data: &picture.data,
            };
            let estimate = estimator.read_single(&Frame { stamp_ns: 0, data: FrameData::Raw(raw) });
            estimate.valid().then_some(estimate.mu)
        })
        .collect()
}

#[test]
fn its_dry_wet_and_icy_roads_are_told_apart() {
    let Some(mut estimator) = estimator() else { return };
    let seeds = SEEDS.count() as f64;
    for true_mu in [0.85, 0.60, 0.10] {
        let read = read(&mut estimator, true_mu);
        let usable = read.len() as f64;
        // The gates refuse 1.9 % of honest renders; one in ten is well beyond that.
        assert!(usable >= 0.9 * seeds, "true {true_mu}: {usable} usable of {seeds}");
        // A mean that is off by more than the whole stated error would be a bias of this renderer alone.
        let mean = read.iter().sum::<f64>() / usable;
        assert!((mean - true_mu).abs() < RMSE, "true {true_mu}: mean {mean}");
        if true_mu == 0.85 {
            // Most, no more: with the stated error 93 % would be, and the model card says that they are not.
            let dry = read.iter().filter(|&&mu| mu > 0.7).count() as f64;
            assert!(dry > 0.5 * usable, "{dry} of {usable} dry roads read above 0.7");
        }
    }
}
