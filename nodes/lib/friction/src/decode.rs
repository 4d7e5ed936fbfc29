//! Bytes of a message to the RGB pixels of the region of interest.

use std::io::Cursor;

use image::{ImageDecoder, ImageFormat, ImageReader, Limits};

use crate::bayer;
use crate::error::FrictionError;
use crate::picture::{Encoding, FrameData, RawPicture, Region, RgbPicture};

/// No camera of a car has a longer side; a header that claims one is damaged.
const MOST_PIXELS_A_SIDE: u32 = 8192;

/// The pixels of `region`. Raw pictures are converted inside the region only.
///
/// # Errors
/// [`FrictionError::UnknownEncoding`], [`FrictionError::BadLayout`], [`FrictionError::BadSize`],
/// [`FrictionError::Truncated`] or [`FrictionError::Undecodable`], as the data deserves.
pub fn decode(data: &FrameData<'_>, region: &Region) -> Result<RgbPicture, FrictionError> {
    match data {
        FrameData::Raw(raw) => decode_raw(raw, region),
        FrameData::Compressed(bytes) => decode_compressed(bytes, region),
    }
}

fn check_size(width: u32, height: u32) -> Result<(), FrictionError> {
    let fine = 1..=MOST_PIXELS_A_SIDE;
    if fine.contains(&width) && fine.contains(&height) {
        Ok(())
    } else {
        Err(FrictionError::BadSize { width, height, most: MOST_PIXELS_A_SIDE })
    }
}

fn decode_raw(raw: &RawPicture<'_>, region: &Region) -> Result<RgbPicture, FrictionError> {
    let encoding = Encoding::parse(raw.encoding)?;
    let RawPicture { width, height, step, data, .. } = *raw;
    check_size(width, height)?;
    let pairs = matches!(encoding, Encoding::Uyvy | Encoding::Yuyv);
    // A 4:2:2 row holds whole pairs of pixels.
    let stored = if pairs { width.next_multiple_of(2) } else { width };
    let least_step = u64::from(stored) * u64::from(encoding.bytes_per_pixel());
    let needed = u64::from(step) * u64::from(height - 1) + least_step;
    if u64::from(step) < least_step || (data.len() as u64) < needed {
        let bytes_per_pixel = encoding.bytes_per_pixel();
        return Err(FrictionError::BadLayout {
            width,
            height,
            bytes_per_pixel,
            least_step,
            step,
            bytes: data.len(),
        });
    }
    let (x, y, w, h) = region.pixels(width, height);
    let mut out = Vec::with_capacity((w * h * 3) as usize);
    let columns = x as usize..(x + w) as usize;
    let high = usize::from(!raw.big_endian);
    for row in y..y + h {
        let line = &data[row as usize * step as usize..][..least_step as usize];
        match encoding {
            Encoding::Rgb8 => out.extend_from_slice(&line[columns.start * 3..columns.end * 3]),
            Encoding::Bgr8 => pick::<3>(&mut out, &line[columns.start * 3..columns.end * 3], [2, 1, 0]),
            Encoding::Rgba8 => pick::<4>(&mut out, &line[columns.start * 4..columns.end * 4], [0, 1, 2]),
            Encoding::Bgra8 => pick::<4>(&mut out, &line[columns.start * 4..columns.end * 4], [2, 1, 0]),
            Encoding::Mono8 => pick::<1>(&mut out, &line[columns.clone()], [0, 0, 0]),
            Encoding::Mono16 => pick::<2>(&mut out, &line[columns.start * 2..columns.end * 2], [high; 3]),
            Encoding::Uyvy => columns.clone().for_each(|c| out.extend(yuv422(line, c, [1, 0, 2]))),
            Encoding::Yuyv => columns.clone().for_each(|c| out.extend(yuv422(line, c, [0, 1, 3]))),
            Encoding::Bayer { cell, wide } => {
                let other = if row + 1 < height { row + 1 } else { row.saturating_sub(1) };
                let mate = &data[other as usize * step as usize..][..least_step as usize];
                bayer::row(&mut out, line, mate, columns.clone(), cell, row % 2 == 1, wide.then_some(high));
            }
        }
    }
    Ok(RgbPicture { width: w, height: h, data: out })
}

/// Appends three of each pixel's `N` bytes, in the given order.
fn pick<const N: usize>(out: &mut Vec<u8>, pixels: &[u8], order: [usize; 3]) {
    let (whole, _) = pixels.as_chunks::<N>();
    out.extend(whole.iter().flat_map(|p| order.map(|i| p[i])));
}

/// BT.601, limited range (what `cv_bridge` assumes). `at`: places of the first Y, of U and of V in the four bytes of a pair.
fn yuv422(line: &[u8], column: usize, at: [usize; 3]) -> [u8; 3] {
    let pair = column / 2 * 4;
    let get = |i: usize| f32::from(line[pair + i]);
    let y = 1.164 * (get(at[0] + 2 * (column % 2)) - 16.0);
    let (u, v) = (get(at[1]) - 128.0, get(at[2]) - 128.0);
    // `as u8` saturates.
    [y + 1.596 * v, y - 0.392 * u - 0.813 * v, y + 2.017 * u].map(|c| (c + 0.5) as u8)
}

fn decode_compressed(bytes: &[u8], region: &Region) -> Result<RgbPicture, FrictionError> {
    let undecodable = |message: String| FrictionError::Undecodable { message };
    let format = image::guess_format(bytes).map_err(|e| undecodable(e.to_string()))?;
    // The decoders fill up what is missing with grey and say nothing, so the end mark is looked for here.
    let end: &[u8] = match format {
        ImageFormat::Jpeg => &[0xFF, 0xD9],
        ImageFormat::Png => b"IEND",
        other => return Err(undecodable(format!("expected JPEG or PNG, got {other:?}"))),
    };
    // Some cameras fill their buffer up with zeros.
    let filled = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    let tail = &bytes[filled.saturating_sub(64)..filled];
    if !tail.windows(end.len()).any(|w| w == end) {
        return Err(FrictionError::Truncated { bytes: bytes.len() });
    }
    let mut limits = Limits::default();
    limits.max_image_width = Some(MOST_PIXELS_A_SIDE);
    limits.max_image_height = Some(MOST_PIXELS_A_SIDE);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|e| undecodable(e.to_string()))?;
    let (width, height) = decoder.dimensions();
    check_size(width, height)?;
    let whole = image::DynamicImage::from_decoder(decoder).map_err(|e| undecodable(e.to_string()))?;
    Ok(RgbPicture { width, height, data: whole.into_rgb8().into_raw() }.crop(region))
}
