//! What the network reads on the reference car's road pictures: one CSV line per size, true friction and seed.
//!
//! `cargo run --release --example read_reference_camera -- FIRST_SEED > readings.csv`: 40 roads each. Seeds from 5000 are for
//! development, from 9000 for the model card.

use std::path::Path;

use gripsight_friction::{
    Basis, Frame, FrameData, FrictionEstimator, OnnxRuntime, RawPicture, Settings, find_library, find_model,
};
use gripsight_reference_car::RoadCamera;

/// The reference car's own camera, and a larger one.
const SIDES: [u32; 2] = [RoadCamera::SIDE_PX, 256];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let first: u64 = std::env::args().nth(1).ok_or("usage: read_reference_camera FIRST_SEED")?.parse()?;
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let network = OnnxRuntime::load(&find_library(None, here)?, &find_model(None, here)?)?;
    let mut estimator =
        FrictionEstimator::new(Settings::default(), Basis::builtin()?, Some(Box::new(network)));
    println!("side,true_mu,seed,valid,reason,mu,sigma,p_dry,p_wet,p_water,p_snow,p_ice");
    for side in SIDES {
        for tenths in 1..=9 {
            let true_mu = f64::from(tenths) / 10.0;
            for seed in first..first + 40 {
                let picture = RoadCamera::new(seed).picture(side, 3.0, true_mu);
                let raw = RawPicture {
                    width: side,
                    height: side,
                    step: side * 3,
                    encoding: "rgb8",
                    big_endian: false,
                    data: &picture.data,
                };
                let got = estimator.read_single(&Frame { stamp_ns: 0, data: FrameData::Raw(raw) });
                let p: Vec<String> = got.probability.iter().map(|p| format!("{p:.4}")).collect();
                let reason = got.reason.map_or("", |r| r.as_str());
                println!(
                    "{side},{true_mu:.1},{seed},{},{reason},{:.4},{:.4},{}",
                    got.valid(),
                    got.mu,
                    got.sigma,
                    p.join(",")
                );
            }
        }
    }
    Ok(())
}
