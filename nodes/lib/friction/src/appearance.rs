//! What a picture of a road looks like, in few numbers: colour, contrast and texture. What a track's calibration compares.

use crate::picture::RgbPicture;
use crate::quality::gradients;

/// The numbers' names, in their order.
pub const APPEARANCE: [&str; 16] = [
    "luma",
    "luma_spread",
    "red_green",
    "red_green_spread",
    "yellow_blue",
    "yellow_blue_spread",
    "highlights",
    "shadows",
    "texture_2",
    "texture_4",
    "texture_8",
    "texture_16",
    "saturation",
    "luma_slope",
    "red_green_of_scene",
    "yellow_blue_of_scene",
];

/// Differences of these numbers that mean nothing: two pictures of one place differ by as much.
pub(crate) const LEAST_SCALE: [f64; APPEARANCE.len()] =
    [10.0, 0.15, 1.5, 0.15, 1.5, 0.15, 0.2, 0.2, 0.1, 0.1, 0.1, 0.1, 0.03, 0.2, 1.5, 1.5];

/// Measures a picture at the network's input size.
///
/// `luma`, `red_green`, `yellow_blue`: means of luma and of the opponent colours r - g and (r + g)/2 - b, levels of 255. `..._spread`: logarithms of
/// their standard deviations. `highlights`, `shadows`: how far the 98 % and 2 % quantiles of luma lie from the median, in spreads. `texture_n`:
/// logarithm of the mean step of luma over n pixels, over the spread. `saturation`: mean of (max - min)/(max + 16). `luma_slope`: upper less lower third,
/// in spreads. `..._of_scene`: the two colours less those of the whole frame, `scene`, which takes out the light's colour and the camera's white balance.
/// A picture of less than 32 x 32 pixels gives zeros.
#[must_use]
pub fn appearance(picture: &RgbPicture, scene: [f64; 2]) -> [f64; APPEARANCE.len()] {
    let (columns, rows) = (picture.width as usize / 2, picture.height as usize / 2);
    if columns < 16 || rows < 16 || picture.data.len() < columns * rows * 12 {
        return [0.0; APPEARANCE.len()];
    }
    let width = picture.width as usize;
    let count = (columns * rows) as f64;
    let mut luma = Vec::with_capacity(columns * rows);
    let mut histogram = [0u32; 256];
    let (mut sums, mut squares, mut saturation) = ([0.0f64; 3], [0.0f64; 3], 0.0f64);
    for y in 0..rows {
        let mut line = [0.0f32; 3];
        for x in 0..columns {
            let at = |dy: usize, dx: usize, k: usize| {
                u32::from(picture.data[((2 * y + dy) * width + 2 * x + dx) * 3 + k])
            };
            let [r, g, b] =
                [0, 1, 2].map(|k| (at(0, 0, k) + at(0, 1, k) + at(1, 0, k) + at(1, 1, k)) as f32 / 4.0);
            let value = (77.0 * r + 150.0 * g + 29.0 * b) / 256.0;
            luma.push(value);
            histogram[value as usize & 255] += 1;
            for (k, v) in [value, r - g, (r + g) / 2.0 - b].into_iter().enumerate() {
                line[k] += v;
                squares[k] += f64::from(v * v);
            }
            let (most, least) = (r.max(g).max(b), r.min(g).min(b));
            saturation += f64::from((most - least) / (most + 16.0));
        }
        (0..3).for_each(|k| sums[k] += f64::from(line[k]));
    }
    let means = sums.map(|s| s / count);
    let spreads: [f64; 3] =
        std::array::from_fn(|k| (squares[k] / count - means[k] * means[k]).max(0.0).sqrt());
    let quantile = |share: f64| {
        let (mut seen, wanted) = (0.0, share * count);
        let level = histogram.iter().position(|n| {
            seen += f64::from(*n);
            seen > wanted
        });
        level.unwrap_or(255) as f64
    };
    let spread = spreads[0] + 2.0;
    let steps = gradients::<5>(&luma, columns);
    let texture = |k: usize| ((steps[k] + 0.3) / spread).ln();
    let third = |from: usize| {
        let part = &luma[from * columns..(from + rows / 3) * columns];
        part.iter().map(|v| f64::from(*v)).sum::<f64>() / part.len() as f64
    };
    [
        means[0],
        spread.ln(),
        means[1],
        (spreads[1] + 1.0).ln(),
        means[2],
        (spreads[2] + 1.0).ln(),
        (quantile(0.98) - quantile(0.5)) / spread,
        (quantile(0.5) - quantile(0.02)) / spread,
        texture(0),
        texture(1),
        texture(2),
        texture(3),
        saturation / count,
        (third(0) - third(rows - rows / 3)) / (spreads[0] + 5.0),
        means[1] - scene[0],
        means[2] - scene[1],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn picture(pixel: impl Fn(u32, u32) -> [u8; 3]) -> RgbPicture {
        let data = (0..224 * 224u32).flat_map(|i| pixel(i % 224, i / 224)).collect();
        RgbPicture { width: 224, height: 224, data }
    }

    #[test]
    fn colours_and_slope_are_what_was_painted() {
        let painted = picture(|_, y| if y < 112 { [140, 100, 60] } else { [100, 60, 20] });
        let got = appearance(&painted, [30.0, 20.0]);
        // 0.3 (r - g) + ...: luma of (140, 100, 60) is 107, of (100, 60, 20) 67.
        assert_relative_eq!(got[0], 87.5, epsilon = 1.0);
        assert_relative_eq!(got[2], 40.0, epsilon = 1e-3);
        assert_relative_eq!(got[4], 60.0, epsilon = 1e-3);
        assert!(got[13] > 1.0, "{got:?}");
        assert_relative_eq!(got[14], 10.0, epsilon = 1e-3);
        assert_relative_eq!(got[15], 40.0, epsilon = 1e-3);
    }

    #[test]
    fn coarse_grain_differs_from_fine_grain_at_the_same_contrast() {
        let stripes =
            |period: u32| move |x: u32, _: u32| [if (x / period).is_multiple_of(2) { 90 } else { 150 }; 3];
        let [fine, coarse] = [4, 16].map(|period| appearance(&picture(stripes(period)), [0.0; 2]));
        assert_relative_eq!(fine[1], coarse[1], epsilon = 0.01);
        assert!(fine[8] > coarse[8] + 0.5 && fine[11] < coarse[11], "{fine:?} {coarse:?}");
    }
}
