#![no_main]
//! A compressed picture, as the camera node reads it.

use gripsight_friction::{FrameData, Preprocessor, QualityStatistics, Region, appearance, decode};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(picture) = decode(&FrameData::Compressed(bytes), &Region::WHOLE) else { return };
    assert_eq!(picture.data.len(), (picture.width * picture.height * 3) as usize);
    let seen = Preprocessor::default().resize(&picture).unwrap();
    let quality = QualityStatistics::measure(&seen);
    assert!((0.0..=255.0).contains(&quality.mean), "{quality:?}");
    assert!(appearance(&seen, [0.5, 0.5]).iter().all(|figure| figure.is_finite()));
});
