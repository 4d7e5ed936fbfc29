//! Is this a picture at all? Statistics of the resized crop, cheap enough for every frame.

use crate::estimate::Reason;
use crate::picture::RgbPicture;

/// What is measured on the crop at the network's input size.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct QualityStatistics {
    /// Mean luma, 0 to 255.
    pub mean: f64,
    /// Share of pixels whose luma is below 12.
    pub dark: f64,
    /// Share of pixels whose luma is above 250.
    pub saturated: f64,
    /// Standard deviation of the pixel noise in levels of luma, after Immerkaer (1996): structure that no lens passes.
    pub noise: f64,
    /// Mean step of luma between neighbouring blocks of 4 x 4 pixels: what a picture keeps unless it is badly blurred.
    pub structure: f64,
    /// Mean step of luma over 8 pixels over that over 2, over 16 over 4, and over 32 over 8. Independent noise of the pixels gives a quarter each, and
    /// more only in the first where a resize or the camera's own filter has smoothed it; whatever a lens has formed gives more.
    pub coarseness: [f64; 3],
}

impl QualityStatistics {
    /// Measures a picture of at least 8 x 8 pixels; a smaller one yields zeros, which the limits refuse.
    #[must_use]
    pub fn measure(picture: &RgbPicture) -> Self {
        let (width, height) = (picture.width as usize, picture.height as usize);
        let (pixels, _) = picture.data.as_chunks::<3>();
        if width < 8 || height < 8 || pixels.len() != width * height {
            return Self::default();
        }
        // BT.601 in 8 bit integers.
        let luma: Vec<i32> = pixels
            .iter()
            .map(|p| (77 * i32::from(p[0]) + 150 * i32::from(p[1]) + 29 * i32::from(p[2])) >> 8)
            .collect();
        let count = luma.len() as f64;
        let share = |test: fn(i32) -> bool| luma.iter().filter(|v| test(**v)).count() as f64 / count;
        Self {
            mean: luma.iter().map(|v| f64::from(*v)).sum::<f64>() / count,
            dark: share(|v| v < 12),
            saturated: share(|v| v > 250),
            noise: noise(&luma, width),
            structure: structure(&luma, width),
            coarseness: coarseness(&luma, width),
        }
    }
}

/// sqrt(pi/2)/6 times the mean of |luma * [[1 -2 1] [-2 4 -2] [1 -2 1]]|.
fn noise(luma: &[i32], width: usize) -> f64 {
    let rows: Vec<&[i32]> = luma.chunks_exact(width).collect();
    let (mut sum, mut count) = (0i64, 0i64);
    for w in rows.windows(3) {
        let column = |i: usize| w[0][i] - 2 * w[1][i] + w[2][i];
        let (mut left, mut middle) = (column(0), column(1));
        for i in 2..width {
            let right = column(i);
            sum += i64::from((left - 2 * middle + right).abs());
            (left, middle) = (middle, right);
        }
        count += width as i64 - 2;
    }
    (std::f64::consts::PI / 2.0).sqrt() / 6.0 * sum as f64 / count.max(1) as f64
}

/// Mean absolute differences between neighbours, along rows and columns, of the picture and of the same halved in size again and again.
pub(crate) fn gradients<const LEVELS: usize>(luma: &[f32], width: usize) -> [f64; LEVELS] {
    let (mut level, mut width) = (luma.to_vec(), width);
    std::array::from_fn(|k| {
        if k > 0 {
            (level, width) = halve(&level, width);
        }
        if width < 2 || level.len() < 2 * width {
            return 0.0;
        }
        let rows = level.len() / width;
        let (mut along, mut across) = (0.0f64, 0.0f64);
        for row in level.chunks_exact(width) {
            along += f64::from(row.windows(2).map(|w| (w[1] - w[0]).abs()).sum::<f32>());
        }
        for (upper, lower) in level.chunks_exact(width).zip(level[width..].chunks_exact(width)) {
            across += f64::from(upper.iter().zip(lower).map(|(a, b)| (b - a).abs()).sum::<f32>());
        }
        0.5 * (along / ((width - 1) * rows) as f64 + across / ((rows - 1) * width) as f64)
    })
}

/// The means of 2 x 2 pixels.
fn halve(level: &[f32], width: usize) -> (Vec<f32>, usize) {
    let half = width / 2;
    let mut out = Vec::with_capacity(level.len() / 4);
    for rows in level.chunks_exact(2 * width.max(1)) {
        let (upper, lower) = rows.split_at(width);
        out.extend(
            (0..half).map(|x| (upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1]) / 4.0),
        );
    }
    (out, half)
}

/// See [`QualityStatistics::coarseness`].
fn coarseness(luma: &[i32], width: usize) -> [f64; 3] {
    let luma: Vec<f32> = luma.iter().map(|v| *v as f32).collect();
    let steps = gradients::<6>(&luma, width);
    [(1, 3), (2, 4), (3, 5)]
        .map(|(fine, coarse)| if steps[fine] > 0.0 { steps[coarse] / steps[fine] } else { 1.0 })
}

/// Mean absolute second difference of the means of 4 x 4 blocks, along rows and columns.
fn structure(luma: &[i32], width: usize) -> f64 {
    let (columns, rows) = (width / 4, luma.len() / width / 4);
    let mut blocks = vec![0i32; columns * rows];
    for y in 0..rows * 4 {
        for x in 0..columns * 4 {
            blocks[y / 4 * columns + x / 4] += luma[y * width + x];
        }
    }
    let (mut sum, mut count) = (0i64, 0i64);
    let mut bend = |a: usize, b: usize, c: usize| {
        sum += i64::from((blocks[a] - 2 * blocks[b] + blocks[c]).abs());
        count += 1;
    };
    for y in 0..rows {
        for x in 0..columns {
            let at = y * columns + x;
            if x >= 1 && x + 1 < columns {
                bend(at - 1, at, at + 1);
            }
            if y >= 1 && y + 1 < rows {
                bend(at - columns, at, at + columns);
            }
        }
    }
    sum as f64 / 16.0 / count.max(1) as f64
}

/// Limits on [`QualityStatistics`]; set on validation pictures so that hardly any honest one is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QualityLimits {
    /// Mean luma below which the picture is dark.
    pub least_mean: f64,
    /// Share of dark pixels above which the picture is dark.
    pub most_dark: f64,
    /// Share of saturated pixels above which the picture is over-exposed.
    pub most_saturated: f64,
    /// Noise above which nothing can be read, levels.
    pub most_noise: f64,
    /// Structure below which the picture is blurred or blank, levels.
    pub least_structure: f64,
    /// Coarseness at and below which, in all figures, the picture is nothing but noise of the sensor.
    pub least_coarseness: [f64; 3],
}

impl Default for QualityLimits {
    fn default() -> Self {
        Self {
            least_mean: 20.0,
            most_dark: 0.5,
            most_saturated: 0.6,
            most_noise: 20.0,
            least_structure: 0.25,
            // The largest of 60 pictures of `training/light.py --split val`: 0.42, 0.33, 0.36.
            least_coarseness: [0.45, 0.33, 0.36],
        }
    }
}

impl QualityLimits {
    /// The first limit that the picture breaks.
    #[must_use]
    pub fn check(&self, seen: &QualityStatistics) -> Option<Reason> {
        if seen.mean < self.least_mean || seen.dark > self.most_dark {
            Some(Reason::Dark)
        } else if seen.saturated > self.most_saturated {
            Some(Reason::Saturated)
        } else if seen.noise > self.most_noise || self.is_flat_noise(seen) {
            Some(Reason::Noisy)
        } else if seen.structure < self.least_structure {
            Some(Reason::Blurred)
        } else {
            None
        }
    }

    fn is_flat_noise(&self, seen: &QualityStatistics) -> bool {
        seen.noise > 0.5
            && seen.coarseness.iter().zip(self.least_coarseness).all(|(seen, least)| *seen < least)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn grey(side: u32, mut value: impl FnMut(u32, u32) -> f64) -> RgbPicture {
        let mut data = Vec::new();
        for y in 0..side {
            for x in 0..side {
                data.extend([value(x, y).clamp(0.0, 255.0) as u8; 3]);
            }
        }
        RgbPicture { width: side, height: side, data }
    }

    fn noisy(sigma: f64) -> RgbPicture {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        // The sum of twelve uniform numbers has variance one.
        grey(224, |_, _| 128.0 + sigma * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0))
    }

    /// White noise of a picture of 448 pixels, smoothed as by a Gaussian of 1.2 pixels and halved.
    fn smoothed_and_halved(sigma: f64) -> RgbPicture {
        const SIDE: usize = 448;
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let white: Vec<f64> = (0..SIDE * SIDE)
            .map(|_| sigma * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0))
            .collect();
        let weights: Vec<f64> = (-4..=4).map(|i| (-f64::from(i * i) / (2.0 * 1.2 * 1.2)).exp()).collect();
        let sum: f64 = weights.iter().sum();
        let smooth = |of: &dyn Fn(usize) -> f64, at: usize| {
            let near = |k: usize| of((at + SIDE + k - 4) % SIDE);
            weights.iter().enumerate().map(|(k, w)| w / sum * near(k)).sum::<f64>()
        };
        let rows: Vec<f64> =
            (0..SIDE * SIDE).map(|i| smooth(&|x| white[i / SIDE * SIDE + x], i % SIDE)).collect();
        let whole = |x: usize, y: usize| smooth(&|y| rows[y * SIDE + x], y);
        grey(224, |x, y| {
            let (x, y) = (2 * x as usize, 2 * y as usize);
            128.0 + 0.25 * (whole(x, y) + whole(x + 1, y) + whole(x, y + 1) + whole(x + 1, y + 1))
        })
    }

    #[test]
    fn the_noise_estimate_finds_the_noise_that_was_put_in() {
        for sigma in [3.0, 10.0, 25.0] {
            assert_relative_eq!(QualityStatistics::measure(&noisy(sigma)).noise, sigma, max_relative = 0.05);
        }
    }

    #[test]
    fn a_slope_is_neither_noise_nor_structure() {
        let slope = QualityStatistics::measure(&grey(224, |x, _| f64::from(x)));
        assert!(slope.noise < 0.1 && slope.structure < 0.1, "{slope:?}");
    }

    #[test]
    fn each_limit_has_its_reason() {
        let limits = QualityLimits::default();
        let reason = |p: &RgbPicture| limits.check(&QualityStatistics::measure(p));
        assert_eq!(reason(&grey(224, |_, _| 3.0)), Some(Reason::Dark));
        assert_eq!(reason(&grey(224, |_, _| 255.0)), Some(Reason::Saturated));
        assert_eq!(reason(&noisy(60.0)), Some(Reason::Noisy));
        assert_eq!(reason(&grey(224, |_, _| 120.0)), Some(Reason::Blurred));
        // Noise of the sensor and nothing else, however weak.
        for sigma in [2.0, 5.0, 12.0] {
            assert_eq!(reason(&noisy(sigma)), Some(Reason::Noisy));
        }
        // Nor where a camera of twice the pixels has smoothed it by one of its own.
        for sigma in [8.0, 14.0, 24.0] {
            assert_eq!(reason(&smoothed_and_halved(sigma)), Some(Reason::Noisy), "{sigma}");
        }
        let grain =
            |x: u32, y: u32| f64::from((x / 9 * 37 + y / 9 * 61) % 17) + f64::from((x * 7 + y * 3) % 5);
        assert_eq!(reason(&grey(224, |x, y| 100.0 + grain(x, y))), None);
        assert_eq!(reason(&grey(4, |_, _| 120.0)), Some(Reason::Dark));
    }
}
