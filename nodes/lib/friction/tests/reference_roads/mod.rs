//! What the network reads on the reference car's road pictures; for the test and for the published table.

use std::ops::Range;
use std::path::Path;

use gripsight_friction::{
    Basis, Estimate, Frame, FrameData, FrictionError, FrictionEstimator, OnnxEmbedder, OnnxRuntime,
    RawPicture, Settings, find_embedding, find_library, find_model,
};
use gripsight_reference_car::RoadCamera;

/// What a camera of the reference car takes, and a larger one.
pub(crate) const SIDES: [u32; 2] = [RoadCamera::SIDE_PX, 256];

/// The released networks on the fetched engine.
pub(crate) fn estimator() -> Result<FrictionEstimator, FrictionError> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let library = find_library(None, here)?;
    let model = find_model(None, here)?;
    let network = OnnxRuntime::load(&library, &model)?;
    let embedder = OnnxEmbedder::load(&library, &find_embedding(&model, here)?)?;
    let estimator = FrictionEstimator::new(Settings::default(), Basis::builtin()?, Some(Box::new(network)));
    Ok(estimator.with_embedder(Box::new(embedder)))
}

/// The reading of each road of friction `true_mu`, one per seed, on its own.
pub(crate) fn read(
    estimator: &mut FrictionEstimator,
    side: u32,
    true_mu: f64,
    seeds: Range<u64>,
) -> impl Iterator<Item = Estimate> {
    seeds.map(move |seed| {
        let data = &RoadCamera::new(seed).picture(side, 3.0, true_mu).data;
        let (step, encoding) = (side * 3, "rgb8");
        let raw = RawPicture { width: side, height: side, step, encoding, big_endian: false, data };
        estimator.read_single(&Frame { stamp_ns: 0, data: FrameData::Raw(raw) })
    })
}
