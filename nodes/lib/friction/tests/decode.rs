//! Every encoding gives the same picture; no bytes make the decoder panic.

#![allow(clippy::unwrap_used)]

use gripsight_friction::{FrameData, FrictionError, RawPicture, Region, RgbPicture, decode};
use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};
use proptest::prelude::*;

const WIDTH: u32 = 10;
const HEIGHT: u32 = 6;

/// Colours that are flat over 2 x 2 cells, so that 4:2:2 and Bayer lose nothing.
fn colour(x: u32, y: u32) -> [u8; 3] {
    let (x, y) = (x / 2, y / 2);
    [(40 + 30 * x) as u8, (60 + 50 * y) as u8, (200 - 20 * x) as u8]
}

/// Packs rows of `pixel` bytes with `padding` bytes after each.
fn rows(padding: usize, pixel: impl Fn(u32, u32) -> Vec<u8>) -> (Vec<u8>, u32) {
    let mut data = vec![];
    let mut step = 0;
    for y in 0..HEIGHT {
        let line: Vec<u8> = (0..WIDTH).flat_map(|x| pixel(x, y)).collect();
        step = line.len() + padding;
        data.extend(line);
        data.extend(vec![0xEE; padding]);
    }
    (data, step as u32)
}

fn read(encoding: &str, big_endian: bool, bytes: &(Vec<u8>, u32), region: &Region) -> RgbPicture {
    let raw =
        RawPicture { width: WIDTH, height: HEIGHT, step: bytes.1, encoding, big_endian, data: &bytes.0 };
    decode(&FrameData::Raw(raw), region).unwrap()
}

fn expected(region: &Region) -> Vec<u8> {
    let (x0, y0, w, h) = region.pixels(WIDTH, HEIGHT);
    (y0..y0 + h).flat_map(|y| (x0..x0 + w).flat_map(move |x| colour(x, y))).collect()
}

#[test]
fn colour_encodings_agree_with_and_without_padding() {
    for region in [Region::WHOLE, Region::new(0.2, 0.3, 0.8, 1.0).unwrap()] {
        for padding in [0, 7] {
            let want = expected(&region);
            let rgb = rows(padding, |x, y| colour(x, y).to_vec());
            let bgr = rows(padding, |x, y| colour(x, y).iter().rev().copied().collect());
            let rgba = rows(padding, |x, y| [&colour(x, y)[..], &[9]].concat());
            let bgra = rows(padding, |x, y| {
                let [r, g, b] = colour(x, y);
                vec![b, g, r, 9]
            });
            assert_eq!(read("rgb8", false, &rgb, &region).data, want);
            assert_eq!(read("bgr8", false, &bgr, &region).data, want);
            assert_eq!(read("rgba8", false, &rgba, &region).data, want);
            assert_eq!(read("bgra8", false, &bgra, &region).data, want);
        }
    }
}

#[test]
fn bayer_patterns_agree_in_both_widths() {
    let cells =
        [("rggb", [0, 1, 1, 2]), ("bggr", [2, 1, 1, 0]), ("gbrg", [1, 2, 0, 1]), ("grbg", [1, 0, 2, 1])];
    for (name, cell) in cells {
        let at = |x: u32, y: u32| colour(x, y)[cell[(2 * (y % 2) + x % 2) as usize]];
        let narrow = rows(3, |x, y| vec![at(x, y)]);
        let wide = rows(0, |x, y| vec![0x5A, at(x, y)]);
        for bytes in [(narrow, "8", false), (wide, "16", false)] {
            let got = read(&format!("bayer_{name}{}", bytes.1), bytes.2, &bytes.0, &Region::WHOLE);
            // Pixels at the start of a cell see that cell alone.
            for y in (0..HEIGHT).step_by(2) {
                for x in (0..WIDTH).step_by(2) {
                    let i = 3 * (y * WIDTH + x) as usize;
                    assert_eq!(got.data[i..i + 3], colour(x, y), "{name} at {x},{y}");
                }
            }
        }
    }
}

#[test]
fn grey_encodings_repeat_the_value() {
    let value = |x: u32, y: u32| (20 * x + y) as u8;
    let want: Vec<u8> = (0..HEIGHT).flat_map(|y| (0..WIDTH).flat_map(move |x| [value(x, y); 3])).collect();
    assert_eq!(read("mono8", false, &rows(1, |x, y| vec![value(x, y)]), &Region::WHOLE).data, want);
    assert_eq!(read("mono16", false, &rows(0, |x, y| vec![1, value(x, y)]), &Region::WHOLE).data, want);
    assert_eq!(read("mono16", true, &rows(0, |x, y| vec![value(x, y), 1]), &Region::WHOLE).data, want);
}

#[test]
fn yuv_orders_agree_and_match_bt601() {
    // BT.601's own definition, limited range.
    let yuv = |[r, g, b]: [u8; 3]| {
        let [r, g, b] = [r, g, b].map(f64::from);
        let y = 16.0 + 0.257 * r + 0.504 * g + 0.098 * b;
        let u = 128.0 - 0.148 * r - 0.291 * g + 0.439 * b;
        let v = 128.0 + 0.439 * r - 0.368 * g - 0.071 * b;
        [y, u, v].map(|c| c.round() as u8)
    };
    let uyvy = rows(4, |x, y| {
        let [l, u, v] = yuv(colour(x, y));
        vec![if x % 2 == 0 { u } else { v }, l]
    });
    let yuyv = rows(0, |x, y| {
        let [l, u, v] = yuv(colour(x, y));
        vec![l, if x % 2 == 0 { u } else { v }]
    });
    let want = expected(&Region::WHOLE);
    for (name, bytes) in [("yuv422", &uyvy), ("yuv422_yuy2", &yuyv)] {
        let got = read(name, false, bytes, &Region::WHOLE).data;
        let worst = got.iter().zip(&want).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(worst <= 3, "{name}: off by {worst}");
    }
}

fn noise(seed: u32) -> Vec<u8> {
    (0..64 * 48 * 3u32).map(|i| (i.wrapping_mul(2_654_435_761).wrapping_add(seed) >> 24) as u8).collect()
}

fn jpeg() -> Vec<u8> {
    let mut bytes = vec![];
    JpegEncoder::new_with_quality(&mut bytes, 90).encode(&noise(1), 64, 48, ExtendedColorType::Rgb8).unwrap();
    bytes
}

#[test]
fn a_png_comes_back_exactly_and_a_jpeg_nearly() {
    let mut png = vec![];
    let pixels = noise(3);
    image::codecs::png::PngEncoder::new(&mut png)
        .write_image(&pixels, 64, 48, ExtendedColorType::Rgb8)
        .unwrap();
    assert_eq!(decode(&FrameData::Compressed(&png), &Region::WHOLE).unwrap().data, pixels);

    let flat = vec![120u8; 64 * 48 * 3];
    let mut bytes = vec![];
    JpegEncoder::new_with_quality(&mut bytes, 90).encode(&flat, 64, 48, ExtendedColorType::Rgb8).unwrap();
    let got = decode(&FrameData::Compressed(&bytes), &Region::new(0.25, 0.5, 0.75, 1.0).unwrap()).unwrap();
    assert_eq!((got.width, got.height), (32, 24));
    assert!(got.data.iter().all(|v| v.abs_diff(120) <= 2));
}

#[test]
fn a_jpeg_in_a_buffer_filled_up_with_zeros_is_read_and_one_cut_off_there_is_not() {
    let mut bytes = jpeg();
    let half = bytes.len() / 2;
    let whole = decode(&FrameData::Compressed(&bytes), &Region::WHOLE).unwrap();
    bytes.extend([0; 4096]);
    assert_eq!(decode(&FrameData::Compressed(&bytes), &Region::WHOLE).unwrap().data, whole.data);
    bytes[half..].fill(0);
    let error = decode(&FrameData::Compressed(&bytes), &Region::WHOLE).unwrap_err();
    assert!(matches!(error, FrictionError::Truncated { .. }), "{error}");
}

#[test]
fn a_jpeg_cut_off_anywhere_is_refused() {
    let whole = jpeg();
    for share in [0.1, 0.5, 0.9, 0.99] {
        let cut = &whole[..(whole.len() as f64 * share) as usize];
        let error = decode(&FrameData::Compressed(cut), &Region::WHOLE).unwrap_err();
        assert!(matches!(error, FrictionError::Truncated { .. }), "{share}: {error}");
    }
}

#[test]
fn wrong_steps_sizes_and_names_are_errors_with_their_numbers() {
    let data = vec![0u8; 300];
    let raw = |width, height, step, encoding| {
        let raw = RawPicture { width, height, step, encoding, big_endian: false, data: &data };
        decode(&FrameData::Raw(raw), &Region::WHOLE).unwrap_err().to_string()
    };
    assert!(raw(10, 10, 29, "rgb8").contains("step >= 30"));
    assert!(raw(10, 11, 30, "rgb8").contains("300 bytes"));
    assert!(raw(0, 10, 30, "rgb8").contains("0x10"));
    assert!(raw(u32::MAX, u32::MAX, u32::MAX, "rgba8").contains("8192"));
    assert!(raw(10, 10, 30, "16UC7").contains("16UC7"));
}

proptest! {
    #[test]
    fn no_raw_picture_panics(
        width in 0u32..40, height in 0u32..40, step in 0u32..200, big_endian: bool,
        encoding in prop::sample::select(vec!["rgb8", "bgr8", "rgba8", "bgra8", "mono8", "mono16", "yuv422", "yuv422_yuy2",
            "bayer_rggb8", "bayer_gbrg16", "bayer_", "bayer_8", ""]),
        data in prop::collection::vec(any::<u8>(), 0..4000),
        edges in (0.0f64..0.9, 0.0f64..0.9, 0.01f64..1.0, 0.01f64..1.0),
    ) {
        let region = Region::new(edges.0, edges.1, (edges.0 + edges.2).min(1.0), (edges.1 + edges.3).min(1.0)).unwrap();
        let raw = RawPicture { width, height, step, encoding, big_endian, data: &data };
        if let Ok(picture) = decode(&FrameData::Raw(raw), &region) {
            prop_assert_eq!(picture.data.len(), (picture.width * picture.height * 3) as usize);
        }
    }

    #[test]
    fn no_damaged_file_panics(hits in prop::collection::vec((0usize..2000, any::<u8>()), 1..20)) {
        let mut bytes = jpeg();
        for (at, value) in hits {
            let n = bytes.len();
            bytes[at % n] = value;
        }
        let _ = decode(&FrameData::Compressed(&bytes), &Region::WHOLE);
    }
}
