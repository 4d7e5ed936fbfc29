//! The gates in their order, with a network that says what the test wants.

#![allow(clippy::unwrap_used)]

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use gripsight_friction::{
    APPEARANCE, Answer, Basis, Calibration, EMBEDDED, EMBEDDING_SIDE, Embedder, Embedding, Estimate, Example,
    Frame, FrameData, FrictionError, FrictionEstimator, Motion, NETWORK_ERROR, Network, RawPicture, Reason,
    Settings, Source,
};

/// Answers with fixed logits and a fixed distance.
struct Says(Vec<f32>, Option<f32>);

impl Network for Says {
    fn read(&mut self, _: &[f32]) -> Result<Answer, FrictionError> {
        Ok(Answer { logits: self.0.clone(), unfamiliarity: self.1 })
    }
}

/// Sees so much snow, and counts how often it looks.
struct Sees(f64, Arc<AtomicU32>);

impl Embedder for Sees {
    fn embed(&mut self, tensor: &[f32]) -> Result<Embedding, FrictionError> {
        assert_eq!(tensor.len(), 3 * (EMBEDDING_SIDE * EMBEDDING_SIDE) as usize);
        self.1.fetch_add(1, Ordering::Relaxed);
        Ok(Embedding { numbers: vec![f64::from(tensor[0]); EMBEDDED], snow: self.0 })
    }
}

const WET: [f32; 5] = [0.0, 9.0, 0.0, 0.0, 0.0];

fn estimator(logits: &[f32]) -> FrictionEstimator {
    estimator_at(logits, Some(0.7))
}

fn estimator_at(logits: &[f32], unfamiliarity: Option<f32>) -> FrictionEstimator {
    let network = Says(logits.to_vec(), unfamiliarity);
    FrictionEstimator::new(Settings::default(), Basis::builtin().unwrap(), Some(Box::new(network)))
}

/// A textured grey picture of 64 x 64; `seed` changes its pixels.
fn textured(seed: u32) -> Vec<u8> {
    let grain = |i: u32| (i.wrapping_mul(2_654_435_761).wrapping_add(seed.wrapping_mul(97)) >> 16) % 60;
    (0..64 * 64 * 3u32).map(|i| 90 + grain(i / 3 / 7) as u8).collect()
}

fn raw(data: &[u8]) -> FrameData<'_> {
    FrameData::Raw(RawPicture { width: 64, height: 64, step: 192, encoding: "rgb8", big_endian: false, data })
}

fn at(
    estimator: &mut FrictionEstimator,
    stamp_ms: i64,
    data: FrameData<'_>,
    distance_m: Option<f64>,
) -> Estimate {
    let stamp_ns = stamp_ms * 1_000_000;
    estimator.update(&Frame { stamp_ns, data }, stamp_ns + 5_000_000, &Motion { distance_m })
}

/// Every refusal looks the same: the uninformative prior, a uniform p, and no pictures.
fn assert_refused(got: &Estimate, reason: Reason) {
    let wide = Basis::builtin().unwrap().uninformative;
    assert_eq!(got.reason, Some(reason), "{got:?}");
    assert!(!got.valid());
    assert_eq!((got.mu, got.sigma, got.pictures), (wide.mu, wide.sigma, 0));
    assert!(got.probability.iter().all(|p| (p - 0.2).abs() < 1e-12));
}

#[test]
fn a_good_picture_gives_the_networks_answer() {
    let got = at(&mut estimator(&WET), 0, raw(&textured(1)), None);
    assert!(got.valid(), "{got:?}");
    assert_eq!(got.source, Source::Camera);
    assert!((got.mu - 0.6).abs() < 0.01 && (got.sigma - NETWORK_ERROR).abs() < 0.01, "{got:?}");
    assert_eq!(got.pictures, 1);
}

#[test]
fn without_a_network_the_configured_prior_stands() {
    let mut blind = FrictionEstimator::new(Settings::default(), Basis::builtin().unwrap(), None);
    let configured = Settings::default().configured;
    for got in [blind.without_picture(), at(&mut blind, 0, raw(&textured(1)), None)] {
        assert_eq!((got.source, got.mu, got.sigma), (Source::Configured, configured.mu, configured.sigma));
        assert!(got.valid());
    }
}

#[test]
fn bad_pictures_are_refused_with_their_reason() {
    let mut e = estimator(&WET);
    assert_refused(&e.without_picture(), Reason::NoPicture);
    assert_refused(&at(&mut e, 0, FrameData::Compressed(b"\xFF\xD8\xFFnot much"), None), Reason::Undecodable);
    assert_refused(&at(&mut e, 1, raw(&vec![2; 64 * 64 * 3]), None), Reason::Dark);
    assert_refused(&at(&mut e, 2, raw(&vec![255; 64 * 64 * 3]), None), Reason::Saturated);
    assert_refused(&at(&mut e, 3, raw(&vec![120; 64 * 64 * 3]), None), Reason::Blurred);
    assert_refused(&at(&mut e, 4, raw(&textured(1)[..100]), None), Reason::BadLayout);
    let data = textured(1);
    let named =
        RawPicture { width: 64, height: 64, step: 192, encoding: "h264", big_endian: false, data: &data };
    let got = at(&mut e, 5, FrameData::Raw(named), None);
    assert_refused(&got, Reason::UnknownEncoding);
    assert!(got.detail.unwrap().contains("h264"));
}

#[test]
fn a_network_in_doubt_is_not_believed() {
    assert_refused(&at(&mut estimator(&[8.0; 5]), 0, raw(&textured(1)), None), Reason::Undecided);
    assert_refused(
        &at(&mut estimator(&[-20.0, -11.0, -20.0, -20.0, -20.0]), 0, raw(&textured(1)), None),
        Reason::Unfamiliar,
    );
    assert_refused(&at(&mut estimator(&[1.0; 4]), 0, raw(&textured(1)), None), Reason::NetworkFailed);
    let nan = [f32::NAN, 0.0, 0.0, 0.0, 0.0];
    assert_refused(&at(&mut estimator(&nan), 0, raw(&textured(1)), None), Reason::NetworkFailed);
}

#[test]
fn a_picture_unlike_the_training_pictures_is_not_believed_however_sure_the_network_is() {
    let says = |distance| at(&mut estimator_at(&WET, distance), 0, raw(&textured(1)), None);
    for strange in [2.1, f32::NAN] {
        assert_refused(&says(Some(strange)), Reason::Unfamiliar);
    }
    let doubted = says(Some(1.9));
    assert!(doubted.valid() && doubted.sigma > 1.3 * NETWORK_ERROR, "{doubted:?}");
    for usual in [Some(1.0), None] {
        let got = says(usual);
        assert!(got.valid() && got.unfamiliarity == usual.map(f64::from), "{got:?}");
    }
}

#[test]
fn snow_that_the_embedding_sees_counts_whatever_the_network_says() {
    let reading = |snow| {
        let mut e = estimator(&WET).with_embedder(Box::new(Sees(snow, Arc::default())));
        at(&mut e, 0, raw(&textured(1)), None)
    };
    assert!((reading(0.0).mu - 0.6).abs() < 0.01);
    let (half, all) = (reading(0.5), reading(1.0));
    assert!((half.mu - 0.425).abs() < 0.01, "{half:?}");
    assert!((all.mu - 0.25).abs() < 0.01 && all.probability[3] > 0.99, "{all:?}");
}

#[test]
fn an_embedding_stands_for_a_metre_and_a_fifth_of_a_second() {
    let looks = Arc::new(AtomicU32::new(0));
    let mut e = estimator(&WET).with_embedder(Box::new(Sees(0.1, looks.clone())));
    // Thirty pictures a second at 1 m/s, then at 30 m/s, then without odometry.
    let mut expect = |from_ms: i64, metres_a_picture: Option<f64>, looked: u32| {
        let before = looks.load(Ordering::Relaxed);
        for k in 0..30u32 {
            let distance_m = metres_a_picture.map(|m| from_ms as f64 + m * f64::from(k));
            let got = at(&mut e, from_ms + i64::from(k) * 33, raw(&textured(1000 * k + 1)), distance_m);
            assert_eq!(got.appearance.map(|a| a.len()), Some(APPEARANCE.len() + EMBEDDED));
        }
        assert_eq!(looks.load(Ordering::Relaxed) - before, looked);
    };
    expect(0, Some(1.0 / 30.0), 1);
    expect(2_000, Some(1.0), 5);
    expect(4_000, None, 3);
}

/// A track whose only floor looks like `textured` and has a friction of 0.35.
fn taught() -> Calibration {
    let mut e = estimator(&WET);
    let examples: Vec<Example> = (1..9)
        .map(|seed| Example {
            appearance: at(&mut e, i64::from(seed), raw(&textured(seed)), None).appearance.unwrap(),
            mu: 0.35,
            sigma: 0.03,
            source: "drive".into(),
            part: seed,
            network_mu: Some(0.6),
        })
        .collect();
    Calibration::learn("track", &examples).unwrap()
}

#[test]
fn what_the_track_has_taught_outweighs_the_network_and_its_doubts() {
    for logits in [WET, [8.0; 5]] {
        let mut e = estimator(&logits);
        e.calibrate(Some(taught()));
        let got = at(&mut e, 0, raw(&textured(42)), None);
        assert!(got.valid() && !got.new_floor(), "{got:?}");
        assert!((got.mu - 0.35).abs() < 0.05 && got.sigma < 0.15, "{got:?}");
    }
}

#[test]
fn a_floor_unlike_what_was_taught_is_new_and_the_network_s_again() {
    let mut e = estimator(&WET);
    e.calibrate(Some(taught()));
    let bright: Vec<u8> = textured(3).iter().enumerate().map(|(i, v)| v / 2 + [120, 60, 0][i % 3]).collect();
    let got = at(&mut e, 0, raw(&bright), None);
    assert!(got.valid() && got.new_floor(), "{got:?}");
    // It said 0.6 of a floor of 0.35: its errors here count with those elsewhere.
    assert!((got.mu - 0.6).abs() < 0.01 && got.sigma > 1.05 * NETWORK_ERROR, "{got:?}");
}

#[test]
fn a_frozen_camera_is_noticed_while_driving_and_recovers() {
    let mut e = estimator(&WET);
    assert!(at(&mut e, 0, raw(&textured(1)), Some(0.0)).valid());
    assert_refused(&at(&mut e, 33, raw(&textured(1)), Some(1.0)), Reason::Frozen);
    let back = at(&mut e, 66, raw(&textured(2)), Some(2.0));
    assert!(back.valid());
    assert_eq!(back.pictures, 2, "the average outlives a short gap");
    assert_refused(&at(&mut e, 10, raw(&textured(3)), Some(2.0)), Reason::OutOfOrder);
    let replayed = at(&mut e, -5000, raw(&textured(3)), Some(0.0));
    assert_eq!((replayed.valid(), replayed.pictures), (true, 1), "a clock set back starts afresh");
}

#[test]
fn single_pictures_do_not_colour_each_other() {
    let mut e = estimator(&WET);
    let data = textured(1);
    let frame = Frame { stamp_ns: 0, data: raw(&data) };
    let first = e.read_single(&frame);
    assert_eq!(e.read_single(&frame), first);
}
