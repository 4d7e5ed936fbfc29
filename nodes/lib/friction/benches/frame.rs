//! One frame of 1280 x 720 pixels on one thread: decoding, and the whole way from bytes to a prior.

use std::error::Error;
use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use gripsight_friction::{
    Basis, Frame, FrameData, FrictionEstimator, OnnxEmbedder, OnnxRuntime, RawPicture, Region, Settings,
    decode, find_embedding, find_library, find_model,
};
use image::codecs::jpeg::JpegEncoder;
use image::{RgbImage, imageops};

const WIDTH: u32 = 1280;
const HEIGHT: u32 = 720;

/// The middle of the golden picture, enlarged.
fn road() -> Result<RgbImage, Box<dyn Error>> {
    let whole = image::load_from_memory(include_bytes!("../tests/golden/road.png"))?.into_rgb8();
    let (width, height) = (whole.width(), whole.width() * 9 / 16);
    let middle = imageops::crop_imm(&whole, 0, (whole.height() - height) / 2, width, height).to_image();
    Ok(imageops::resize(&middle, WIDTH, HEIGHT, imageops::FilterType::CatmullRom))
}

fn estimator() -> Result<FrictionEstimator, Box<dyn Error>> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let library = find_library(None, here)?;
    let model = find_model(None, here)?;
    let network = OnnxRuntime::load(&library, &model)?;
    let embedder = OnnxEmbedder::load(&library, &find_embedding(&model, here)?)?;
    let estimator = FrictionEstimator::new(Settings::default(), Basis::builtin()?, Some(Box::new(network)));
    Ok(estimator.with_embedder(Box::new(embedder)))
}

fn frames(criterion: &mut Criterion) -> Result<(), Box<dyn Error>> {
    let road = road()?;
    let raw = RawPicture {
        width: WIDTH,
        height: HEIGHT,
        step: WIDTH * 3,
        encoding: "rgb8",
        big_endian: false,
        data: road.as_raw(),
    };
    let mut pictures = vec![("raw".to_owned(), FrameData::Raw(raw))];
    let mut files = vec![];
    for quality in [75, 90, 97] {
        let mut file = vec![];
        JpegEncoder::new_with_quality(&mut file, quality).encode_image(&road)?;
        files.push((format!("jpeg {} KB", file.len() / 1000), file));
    }
    pictures.extend(files.iter().map(|(name, file)| (name.clone(), FrameData::Compressed(file))));
    let mut estimator = estimator()?;
    for (name, data) in &pictures {
        criterion.bench_function(&format!("{name}/decode"), |bencher| {
            bencher.iter(|| decode(black_box(data), &Region::WHOLE));
        });
        criterion.bench_function(&format!("{name}/whole"), |bencher| {
            bencher.iter(|| estimator.read_single(black_box(&Frame { stamp_ns: 0, data: *data })));
        });
    }
    Ok(())
}

fn run(criterion: &mut Criterion) {
    if let Err(error) = frames(criterion) {
        eprintln!("no measurement: {error}");
    }
}

criterion_group!(benches, run);
criterion_main!(benches);
