//! The real model on the real engine: golden tensor and logits of the training framework, and what happens without them.
//!
//! Needs the library that `launch_scripts/fetch_onnxruntime.sh` fetches; where it is absent the tests say that they skip.

#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};

use gripsight_friction::{
    EMBEDDED, EMBEDDING_SIDE, Embedder, FrictionError, INPUT_SIDE, Network, OnnxEmbedder, OnnxRuntime,
    Preprocessor, Region, RgbPicture, decode, normalise,
};

const HERE: &str = env!("CARGO_MANIFEST_DIR");

fn library() -> Option<PathBuf> {
    let found = gripsight_friction::find_library(None, Path::new(HERE)).ok();
    if found.is_none() {
        eprintln!("SKIPPED: no ONNX Runtime; run launch_scripts/fetch_onnxruntime.sh");
    }
    found
}

fn model() -> PathBuf {
    gripsight_friction::find_model(None, Path::new(HERE)).unwrap()
}

fn golden() -> serde_json::Value {
    serde_json::from_str(include_str!("golden/golden.json")).unwrap()
}

fn numbers(value: &serde_json::Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn picture(bytes: &[u8], region: &Region) -> RgbPicture {
    decode(&gripsight_friction::FrameData::Compressed(bytes), region).unwrap()
}

#[test]
fn the_crop_and_resize_are_those_of_training() {
    let g = golden();
    let (crop, size) = (numbers(&g["crop"]), g["size"].as_f64().unwrap());
    let region = Region::new(crop[0] / size, crop[1] / size, crop[2] / size, crop[3] / size).unwrap();
    let crop = picture(include_bytes!("golden/road.png"), &region);
    let got = Preprocessor::default().resize(&crop).unwrap();
    let want = picture(include_bytes!("golden/input.png"), &Region::WHOLE);
    assert_eq!((want.width, want.height), (INPUT_SIDE, INPUT_SIDE));
    let worst = got.data.iter().zip(&want.data).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(worst <= 1, "off by {worst} levels");
}

#[test]
fn the_tensor_is_that_of_training() {
    let g = golden();
    let tensor = normalise(&picture(include_bytes!("golden/input.png"), &Region::WHOLE));
    for (at, want) in numbers(&g["tensor_at"]).into_iter().zip(numbers(&g["tensor"])) {
        assert!((f64::from(tensor[at as usize]) - want).abs() < 1e-5, "at {at}");
    }
}

fn assert_golden_answer(network: &mut dyn Network) {
    let tensor = normalise(&picture(include_bytes!("golden/input.png"), &Region::WHOLE));
    let golden = golden();
    let got = network.read(&tensor).unwrap();
    for (got, want) in got.logits.iter().zip(numbers(&golden["logits"])) {
        assert!((f64::from(*got) - want).abs() < 1e-4, "{got} instead of {want}");
    }
    assert_eq!(got.logits.len(), 5);
    let (got, want) = (f64::from(got.unfamiliarity.unwrap()), golden["unfamiliarity"].as_f64().unwrap());
    assert!((got - want).abs() < 1e-4, "{got} instead of {want}");
}

#[test]
fn onnx_runtime_gives_the_training_frameworks_answer() {
    let Some(library) = library() else { return };
    assert_golden_answer(&mut OnnxRuntime::load(&library, &model()).unwrap());
}

#[test]
fn the_embedding_is_that_of_the_framework_that_it_comes_from() {
    let Some(library) = library() else { return };
    let model = gripsight_friction::find_embedding(&self::model(), Path::new(HERE)).unwrap();
    let small = picture(include_bytes!("golden/embedding.png"), &Region::WHOLE);
    let embedding = OnnxEmbedder::load(&library, &model).unwrap().embed(&normalise(&small)).unwrap();
    let got = &embedding.numbers;
    let golden: serde_json::Value = serde_json::from_str(include_str!("golden/embedding.json")).unwrap();
    let want = numbers(&golden["embedding"]);
    assert_eq!((got.len(), want.len()), (EMBEDDED, EMBEDDED));
    let worst = got.iter().zip(&want).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-3, "off by {worst}");
    let share = golden["snow"].as_f64().unwrap().exp();
    let want = 8.0 * share / (1.0 + 7.0 * share);
    assert!((embedding.snow - want).abs() < 1e-4, "{} instead of {want}", embedding.snow);
    let whole = picture(include_bytes!("golden/input.png"), &Region::WHOLE);
    let resized = Preprocessor::default().resize_to(&whole, EMBEDDING_SIDE).unwrap();
    let worst = resized.data.iter().zip(&small.data).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(worst <= 1, "off by {worst} levels");
    // The camera network's model is none.
    assert!(matches!(OnnxEmbedder::load(&library, &self::model()), Err(FrictionError::Model { .. })));
}

#[cfg(feature = "tract")]
#[test]
fn tract_gives_the_same_answer() {
    assert_golden_answer(&mut gripsight_friction::Tract::load(&model()).unwrap());
}

#[test]
fn a_missing_or_broken_library_is_an_error_not_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("libonnxruntime.so");
    let load = || OnnxRuntime::load(&missing, &model()).unwrap_err();
    assert!(matches!(load(), FrictionError::Library { .. }));
    std::fs::write(&missing, b"not a library").unwrap();
    let text = load().to_string();
    assert!(text.contains("libonnxruntime.so"), "{text}");
    // The failure is not sticky.
    if let Some(library) = library() {
        assert_golden_answer(&mut OnnxRuntime::load(&library, &model()).unwrap());
        assert_golden_answer(&mut OnnxRuntime::load(&library, &model()).unwrap());
    }
}

#[test]
fn a_missing_or_broken_model_is_an_error_not_a_panic() {
    let Some(library) = library() else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.onnx");
    let load = || OnnxRuntime::load(&library, &path).unwrap_err();
    let missing = load();
    assert!(matches!(missing, FrictionError::Model { .. }), "{missing}");
    std::fs::write(&path, &std::fs::read(model()).unwrap()[..4000]).unwrap();
    let broken = load();
    assert!(matches!(broken, FrictionError::Model { .. }), "{broken}");
}
