//! Damaged and made-up files: basis, calibration, model and pictures. Each is answered, in bounded memory, and the error names the file.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use gripsight_friction::{
    APPEARANCE, Basis, Calibration, Example, FrameData, FrictionError, INPUT_SIDE, Network, OnnxRuntime,
    Preprocessor, QualityStatistics, RawPicture, Region, appearance, decode, find_library, find_model,
    read_picture,
};
use gripsight_mutants::{Mutants, bombs, peak_memory_mb};

const HERE: &str = env!("CARGO_MANIFEST_DIR");
const BASIS: &str = include_str!("../../../../params/friction_basis.yaml");
/// What a test with small files may hold, and one with the network (MB).
const TEXT_MB: f64 = 200.0;
const MODEL_MB: f64 = 800.0;
/// One with pictures: the largest that a camera may have, 8192 x 8192, as colours (MB).
const PICTURES_MB: f64 = 800.0;

fn assert_held_at_most(most_mb: f64) {
    let peak_mb = peak_memory_mb();
    println!("held at most {peak_mb:?} MB");
    assert!(peak_mb.is_none_or(|peak_mb| peak_mb < most_mb), "{peak_mb:?} MB");
}

/// Every reader names the file that it was given.
fn assert_named(error: &FrictionError, path: &Path) {
    let text = error.to_string();
    assert!(text.contains(path.file_name().unwrap().to_str().unwrap()), "{text}");
    assert!(text.len() < 4000, "{} bytes of text: {text:.200}", text.len());
}

#[test]
fn a_mutated_basis_is_refused_or_gives_frictions() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("floor.yaml");
    let (mut mutants, mut refused) = (Mutants::new(0xba515), 0);
    let count = Mutants::count(4000);
    for text in (0..count).map(|_| mutants.text(BASIS)).collect::<Vec<_>>().into_iter().chain(bombs()) {
        fs::write(&path, text).unwrap();
        match Basis::read_file(&path) {
            Err(error) => {
                refused += 1;
                assert_named(&error, &path);
            }
            Ok(basis) => {
                let classes = basis.classes.len();
                let prior = basis.prior(&vec![1.0 / classes as f64; classes]);
                assert!(
                    (0.01..=3.0).contains(&prior.mu) && (0.001..=5.0).contains(&prior.sigma),
                    "{prior:?}"
                );
            }
        }
    }
    println!("{count} bases, {refused} refused");
    assert!(refused > count / 4);
    assert_held_at_most(TEXT_MB);
}

fn learned() -> Calibration {
    let examples: Vec<Example> = (0..12)
        .map(|k| Example {
            appearance: (0..APPEARANCE.len()).map(|j| ((k * 7 + j * 3) % 11) as f64 / 3.0).collect(),
            mu: if k % 2 == 0 { 0.8 } else { 0.4 },
            sigma: 0.05,
            source: ["carpet", "tiles"][k % 2].to_owned(),
            part: k as u32 / 4,
            network_mu: Some(0.7),
        })
        .collect();
    Calibration::learn("lab", &examples).unwrap()
}

/// A file of other examples has another hash, and nothing else in the file changes what is said.
#[test]
fn a_mutated_calibration_is_refused_or_says_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lab.json");
    let whole = learned();
    let (text, x) = (whole.to_json().unwrap(), [1.234; APPEARANCE.len()]);
    let (mut mutants, mut refused) = (Mutants::new(0xca11b), 0);
    let count = Mutants::count(2000);
    for mutant in (0..count).map(|_| mutants.text(&text)).collect::<Vec<_>>().into_iter().chain(bombs()) {
        fs::write(&path, mutant).unwrap();
        match Calibration::read_file(&path) {
            Err(error) => {
                refused += 1;
                assert_named(&error, &path);
            }
            Ok(calibration) => assert_eq!(calibration.read(&x), whole.read(&x)),
        }
    }
    println!("{count} calibrations, {refused} refused");
    assert!(refused > count / 2);
    assert_held_at_most(TEXT_MB);
}

/// Examples of any size, with the hash that is theirs.
#[test]
fn examples_at_the_ends_of_numbers_are_refused_or_give_frictions() {
    for large in [1e3, 1e100, 1e154, 1e200, f64::MAX] {
        let mut examples = learned().examples().to_vec();
        examples[3].appearance[2] = large;
        examples[4].appearance[2] = -large;
        let Ok(calibration) = Calibration::learn("lab", &examples) else { continue };
        for x in [0.0, 1.0, large] {
            let known = calibration.read(&[x; APPEARANCE.len()]);
            assert!((0.03..=2.0).contains(&known.mu), "{large}, {x}: {known:?}");
            // What is no number is nearer to nothing.
            assert!((0.0..=1.0).contains(&known.weight()), "{large}, {x}: {known:?}");
            assert!(known.weight() == 0.0 || known.sigma.is_finite(), "{large}, {x}: {known:?}");
        }
    }
}

#[test]
fn what_has_no_end_is_not_read_to_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("endless.json");
    fs::File::create(&path).unwrap().set_len(1 << 40).unwrap();
    for path in [path.as_path(), Path::new("/dev/zero")] {
        for error in [
            Basis::read_file(path).unwrap_err(),
            Calibration::read_file(path).unwrap_err(),
            read_picture(path).unwrap_err(),
        ] {
            assert_named(&error, path);
        }
    }
    if let Some(library) = library() {
        assert_named(&OnnxRuntime::load(&library, &path).unwrap_err(), &path);
    }
    assert_held_at_most(TEXT_MB);
}

/// What is made of a picture before the network sees it; whether it is one.
fn looked_at(data: &FrameData<'_>, region: &Region) -> bool {
    let picture = match decode(data, region) {
        Ok(picture) => picture,
        Err(error) => {
            assert!(error.to_string().len() < 4000, "{error:.200}");
            return false;
        }
    };
    assert_eq!(picture.data.len(), (picture.width * picture.height * 3) as usize);
    let seen = Preprocessor::default().resize(&picture).unwrap();
    let quality = QualityStatistics::measure(&seen);
    assert!((0.0..=255.0).contains(&quality.mean) && (0.0..=1.0).contains(&quality.dark), "{quality:?}");
    assert!(appearance(&seen, [0.5, 0.5]).iter().all(|figure| figure.is_finite()));
    true
}

/// Pixels with edges and colours.
fn pixels(side: u32, channels: u32) -> Vec<u8> {
    (0..side * side * channels)
        .map(|k| (k.wrapping_mul(2_654_435_761) >> 25) as u8 + (k % 97) as u8)
        .collect()
}

/// Pictures as cameras and stacks compress them: JPEG, and PNG in four kinds of pixels.
fn compressed() -> Vec<Vec<u8>> {
    use image::{ExtendedColorType, ImageEncoder as _};
    let side = 64;
    let png = |channels: u32, kind: ExtendedColorType| {
        let mut bytes = Vec::new();
        let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
        encoder.write_image(&pixels(side, channels), side, side, kind).unwrap();
        bytes
    };
    let mut jpeg = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 80);
    encoder.encode(&pixels(side, 3), side, side, ExtendedColorType::Rgb8).unwrap();
    let mut grey = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut grey, 40);
    encoder.encode(&pixels(side, 1), side, side, ExtendedColorType::L8).unwrap();
    vec![
        jpeg,
        grey,
        png(3, ExtendedColorType::Rgb8),
        png(1, ExtendedColorType::L8),
        png(4, ExtendedColorType::Rgba8),
        png(2, ExtendedColorType::L16),
    ]
}

/// Makes the checksums of a PNG file's parts right again: without, its reader looks no further.
fn with_checksums(bytes: &mut [u8]) {
    let mut at = 8;
    while let Some(head) = bytes.get(at..at + 8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let Some(end) = at.checked_add(8 + length).filter(|end| *end + 4 <= bytes.len()) else { return };
        let sum = crc(&bytes[at + 4..end]);
        bytes[end..end + 4].copy_from_slice(&sum.to_be_bytes());
        at = end + 4;
    }
}

fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| (sum >> 1) ^ (0xedb8_8320 & (sum & 1).wrapping_neg()))
    })
}

/// Most of them end as they did, for a file without its end is refused before it is read.
#[test]
fn a_mutated_picture_is_refused_or_looked_at() {
    let files = compressed();
    let (mut mutants, mut refused, start) = (Mutants::new(0x9176), 0, Instant::now());
    let count = Mutants::count(1200);
    for k in 0..count {
        let file = &files[k % files.len()];
        assert!(k >= files.len() || looked_at(&FrameData::Compressed(file), &Region::WHOLE));
        let mut bytes = mutants.binary(file, 0, [80, 400, usize::MAX][k % 3]);
        if mutants.below(4) > 0 {
            bytes.extend(&file[file.len() - 12..]);
        }
        if mutants.below(4) > 0 {
            with_checksums(&mut bytes);
        }
        refused += usize::from(!looked_at(&FrameData::Compressed(&bytes), &Region::WHOLE));
    }
    println!("pictures (JPEG, PNG): {count} mutants in {:.1?}, {refused} refused", start.elapsed());
    assert!(refused > count / 4 && refused < count);
    assert_held_at_most(PICTURES_MB);
}

/// Few bytes that claim, and hold, pictures larger than any camera's.
#[test]
fn a_picture_without_measure_is_refused() {
    use image::{ExtendedColorType, ImageEncoder as _};
    let mut large = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut large);
    encoder.write_image(&vec![0; 12_000 * 12_000], 12_000, 12_000, ExtendedColorType::L8).unwrap();
    assert!(!looked_at(&FrameData::Compressed(&large), &Region::WHOLE));
    for file in compressed() {
        let is_png = file.starts_with(b"\x89PNG");
        // Where each of the two says how large it is: IHDR, and SOF0 behind its marker, length and precision.
        let at =
            if is_png { Some(16) } else { file.windows(2).position(|w| w == [0xff, 0xc0]).map(|at| at + 5) };
        let mut claims = file.clone();
        let (at, size): (usize, &[u8]) = (at.unwrap(), if is_png { &[0x7f; 8] } else { &[0xff; 4] });
        claims[at..at + size.len()].copy_from_slice(size);
        with_checksums(&mut claims);
        assert!(!looked_at(&FrameData::Compressed(&claims), &Region::WHOLE));
    }
    assert_held_at_most(PICTURES_MB);
}

#[test]
fn a_raw_picture_of_any_shape_is_refused_or_looked_at() {
    const ENCODINGS: [&str; 17] = [
        "rgb8",
        "bgr8",
        "rgba8",
        "bgra8",
        "mono8",
        "mono16",
        "8UC1",
        "8UC3",
        "16UC1",
        "yuv422",
        "yuv422_yuy2",
        "bayer_rggb8",
        "bayer_gbrg16",
        "bayer_",
        "bayer_8",
        "",
        "32FC1",
    ];
    const SIZES: [u32; 12] = [0, 1, 2, 3, 7, 31, 32, 33, 8192, 8193, 1 << 31, u32::MAX];
    let data = pixels(64, 4);
    let (mut mutants, mut refused, start) = (Mutants::new(0x7a3), 0, Instant::now());
    let count = Mutants::count(4000);
    for _ in 0..count {
        let mut size = || match mutants.below(3) {
            0 => SIZES[mutants.below(SIZES.len())],
            _ => mutants.below(40) as u32,
        };
        let [width, height, padding] = [size(), size(), size()];
        let step = match mutants.below(2) {
            0 => padding,
            _ => width.wrapping_mul([1, 2, 3, 4][mutants.below(4)]).wrapping_add(padding % 8),
        };
        let data = &data[..mutants.below(data.len() + 1)];
        let edges = [0; 2].map(|_| mutants.below(90) as f64 / 100.0);
        let span = [0; 2].map(|_| (1 + mutants.below(100)) as f64 / 100.0);
        let region =
            Region::new(edges[0], edges[1], (edges[0] + span[0]).min(1.0), (edges[1] + span[1]).min(1.0));
        let encoding = ENCODINGS[mutants.below(ENCODINGS.len())];
        let raw = RawPicture { width, height, step, encoding, big_endian: mutants.below(2) == 0, data };
        refused += usize::from(!looked_at(&FrameData::Raw(raw), &region.unwrap()));
    }
    println!("raw pictures: {count} shapes in {:.1?}, {refused} refused", start.elapsed());
    assert!(refused > count / 4 && refused < count);
    assert_held_at_most(PICTURES_MB);
}

fn library() -> Option<PathBuf> {
    let found = find_library(None, Path::new(HERE)).ok();
    if found.is_none() {
        eprintln!("SKIPPED: no ONNX Runtime; run launch_scripts/fetch_onnxruntime.sh");
    }
    found
}

/// Loads a model and asks it once; whether it answered.
fn asked(library: &Path, path: &Path) -> bool {
    match OnnxRuntime::load(library, path) {
        Err(error) => {
            assert_named(&error, path);
            false
        }
        Ok(mut network) => match network.read(&vec![0.5; 3 * (INPUT_SIDE * INPUT_SIDE) as usize]) {
            Err(error) => {
                assert!(matches!(error, FrictionError::Inference { .. }), "{error}");
                false
            }
            Ok(answer) => {
                assert!(answer.logits.len() <= 64);
                true
            }
        },
    }
}

/// The graph lies at the model's beginning and end, and the weights, in which faults mean little, between.
#[test]
fn a_mutated_model_is_refused_or_answers() {
    let Some(library) = library() else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("road.onnx");
    let whole = fs::read(find_model(None, Path::new(HERE)).unwrap()).unwrap();
    let n = whole.len();
    let (mut mutants, mut answered) = (Mutants::new(0x0dd1), 0);
    let count = Mutants::count(60);
    for k in 0..count {
        let (from, to) = [(0, 400), (0, 40_000), (n - 2000, n), (0, n)][k % 4];
        fs::write(&path, mutants.binary(&whole, from, to)).unwrap();
        answered += usize::from(asked(&library, &path));
    }
    println!("{count} models, {answered} answered");
    assert!(answered < count);
    for length in [0, 1, 100, n / 2, n - 1] {
        fs::write(&path, &whole[..length]).unwrap();
        assert!(!asked(&library, &path), "cut off after {length}");
    }
    assert_held_at_most(MODEL_MB);
}

/// A field of a protobuf message: bytes, or a number.
fn bytes(field: u8, content: &[u8]) -> Vec<u8> {
    [vec![field << 3 | 2], varint(content.len() as u64), content.to_vec()].concat()
}

fn number(field: u8, value: u64) -> Vec<u8> {
    [vec![field << 3], varint(value)].concat()
}

fn varint(mut value: u64) -> Vec<u8> {
    let mut out = vec![];
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
    out
}

/// Name and shape of a tensor of float32.
fn value(name: &str, shape: &[u64]) -> Vec<u8> {
    let sizes: Vec<u8> = shape.iter().flat_map(|size| bytes(1, &number(1, *size))).collect();
    let kind = bytes(1, &[number(1, 1), bytes(2, &sizes)].concat());
    [bytes(1, name.as_bytes()), bytes(2, &kind)].concat()
}

fn node(operator: &str, input: &str, output: &str) -> Vec<u8> {
    bytes(
        1,
        &[bytes(1, input.as_bytes()), bytes(2, output.as_bytes()), bytes(4, operator.as_bytes())].concat(),
    )
}

/// A model made of nodes, with one initial tensor of int64 named `shape`.
fn model(nodes: &[Vec<u8>], shape: &[u64], input: &[u8], output: &[u8]) -> Vec<u8> {
    let data: Vec<u8> = shape.iter().flat_map(|size| size.to_le_bytes()).collect();
    let tensor = [number(1, shape.len() as u64), number(2, 7), bytes(8, b"shape"), bytes(9, &data)].concat();
    let graph =
        [nodes.concat(), bytes(2, b"g"), bytes(5, &tensor), bytes(11, input), bytes(12, output)].concat();
    [number(1, 8), bytes(8, &number(2, 13)), bytes(7, &graph)].concat()
}

#[test]
fn models_made_to_harm_are_refused() {
    let Some(library) = library() else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("made.onnx");
    let side = u64::from(INPUT_SIDE);
    let picture = value("x", &[1, 3, side, side]);
    let first = node("GlobalAveragePool", "x", "y");
    let small = value("y", &[1, 3, 1, 1]);
    let refusal = |bytes: Vec<u8>| {
        fs::write(&path, bytes).unwrap();
        let error = OnnxRuntime::load(&library, &path).unwrap_err();
        assert_named(&error, &path);
        error.to_string()
    };
    // One that is as it should be: the others are refused for what they ask, not for how they are written.
    fs::write(&path, model(std::slice::from_ref(&first), &[1], &picture, &small)).unwrap();
    assert!(asked(&library, &path));

    let other_input =
        refusal(model(std::slice::from_ref(&first), &[1], &value("x", &[1, 3, 1 << 20, 1 << 20]), &small));
    assert!(other_input.contains("input \"x\""), "{other_input}");
    let large = refusal(model(&[node("Relu", "x", "y")], &[1], &picture, &value("y", &[1, 3, side, side])));
    assert!(large.contains("output \"y\""), "{large}");
    assert_held_at_most(MODEL_MB);
}
