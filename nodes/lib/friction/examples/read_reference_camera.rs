//! What the network reads on the reference car's road pictures: one CSV line per seed and true friction, on standard output.

use std::path::Path;

use gripsight_friction::{
    Basis, Frame, FrameData, FrictionEstimator, OnnxRuntime, RawPicture, Settings, find_library, find_model,
};
use gripsight_reference_car::RoadCamera;

const SIDE: u32 = 256;
const SEEDS: std::ops::Range<u64> = 1000..1040;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let network = OnnxRuntime::load(&find_library(None, here)?, &find_model(None, here)?)?;
    let mut estimator =
        FrictionEstimator::new(Settings::default(), Basis::builtin()?, Some(Box::new(network)));
    println!("true_mu,seed,valid,reason,mu,sigma,p_dry,p_wet,p_water,p_snow,p_ice");
    for tenths in 1..=9 {
        let true_mu = f64::from(tenths) / 10.0;
        for seed in SEEDS {
            let picture = RoadCamera::new(seed).picture(SIDE, 3.0, true_mu);
            let raw = RawPicture {
                width: SIDE,
                height: SIDE,
                step: SIDE * 3,
                encoding: "rgb8",
                big_endian: false,
                data: &picture.data,
            };
            let got = estimator.read_single(&Frame { stamp_ns: 0, data: FrameData::Raw(raw) });
            let p: Vec<String> = got.probability.iter().map(|p| format!("{p:.4}")).collect();
            let reason = got.reason.map_or("", |r| r.as_str());
            println!(
                "{true_mu:.1},{seed},{},{reason},{:.4},{:.4},{}",
                got.valid(),
                got.mu,
                got.sigma,
                p.join(",")
            );
        }
    }
    Ok(())
}
