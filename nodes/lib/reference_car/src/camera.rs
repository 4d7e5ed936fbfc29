//! Pictures of the road ahead whose texture matches its friction.
//!
//! A plane of seeded value noise, seen in perspective and moving with the car, is coloured as a dry, wet, flooded, snowy or icy
//! road. The recipe is that of the made textures in `nodes/camera_prior/training` (binder, stones and mottle; a darker film
//! with sheen; a mirror; lit relief; a milky pane with cracks), written again: no code or random field is shared. Lens and
//! pixels blur what falls on them before the sensor's noise is added. Black ice, which looks like a wet road, is not drawn.

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::error::ReferenceCarError;

/// Friction coefficients that the five states stand for, from dry to ice: those of `params/friction_basis.yaml`.
const STATE_MU: [f64; 5] = [0.85, 0.60, 0.42, 0.25, 0.10];
/// How far the picture reaches along the road, metres.
const REACH_M: f64 = 6.0;
/// Quality of the JPEG files, of 100.
const JPEG_QUALITY: u8 = 85;

/// A moment at which the camera took a picture; [`RoadCamera::expose`] draws it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Exposure {
    /// Time since the start of the run.
    pub stamp_s: f64,
    /// The car's place along the track.
    pub position_m: f64,
    /// Friction of the road there, wear and grip of the tires left out.
    pub mu: f64,
}

impl Exposure {
    /// The stamp counted from `start_ns`.
    #[must_use]
    pub fn stamp_ns(&self, start_ns: i64) -> i64 {
        start_ns + (self.stamp_s * 1e9).round() as i64
    }
}

/// An RGB picture, rows packed, 3 bytes a pixel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RoadPicture {
    /// Width and height in pixels.
    pub side: u32,
    /// `side * side * 3` bytes.
    pub data: Vec<u8>,
}

impl RoadPicture {
    /// The picture as a JPEG file.
    ///
    /// # Errors
    /// `Picture` where the picture has no pixels or more than JPEG allows.
    pub fn jpeg(&self) -> Result<Vec<u8>, ReferenceCarError> {
        let mut file = Vec::new();
        JpegEncoder::new_with_quality(&mut file, JPEG_QUALITY).encode(
            &self.data,
            self.side,
            self.side,
            ExtendedColorType::Rgb8,
        )?;
        Ok(file)
    }
}

/// A camera that looks at one road.
#[derive(Debug, Clone)]
pub struct RoadCamera {
    seed: u64,
    tilt: f64,
    albedo: f64,
    tint: [f64; 3],
    grain: f64,
    stones: f64,
    mottle: f64,
    exposure: f64,
    sky: f64,
    film: f64,
    sheen: f64,
    mirror: f64,
    drowned: f64,
    white: f64,
    relief: f64,
    milk: f64,
    noise: f64,
}

impl RoadCamera {
    /// Width and height of a run's pictures: what friction networks take.
    pub const SIDE_PX: u32 = 224;

    /// A camera on the road number `seed`: its colour, grain, light and perspective follow from it.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x0ca3_e7a5);
        let mut draw = |low: f64, high: f64| rng.random_range(low..high);
        Self {
            seed,
            tilt: draw(0.3, 1.1),
            albedo: draw(0.08, 0.3),
            tint: [draw(0.96, 1.04), draw(0.96, 1.04), draw(0.96, 1.04)],
            grain: draw(0.08, 0.3),
            stones: draw(0.05, 0.2),
            mottle: draw(0.03, 0.15),
            exposure: draw(0.16, 0.34),
            sky: draw(0.5, 1.0),
            film: draw(0.35, 0.55),
            sheen: draw(0.06, 0.13),
            mirror: draw(0.3, 0.65),
            drowned: draw(0.15, 0.4),
            white: draw(0.65, 0.9),
            relief: draw(0.03, 0.1),
            milk: draw(0.35, 0.6),
            noise: draw(0.5, 3.0),
        }
    }

    /// The picture of `side` x `side` pixels taken `position_m` along a road of peak friction `mu`.
    ///
    /// Between two states their areas share the picture so that the mean friction is `mu`; beyond dry and ice the picture is
    /// wholly that state's.
    #[must_use]
    pub fn picture(&self, side: u32, position_m: f64, mu: f64) -> RoadPicture {
        let upper = (0..3).find(|i| mu >= STATE_MU[i + 1]).unwrap_or(3);
        let span = STATE_MU[upper] - STATE_MU[upper + 1];
        let covered = ((STATE_MU[upper] - mu) / span).clamp(0.0, 1.0);
        let size = f64::from(side);
        let ahead = position_m / REACH_M * size;
        let mut light = Vec::with_capacity((side * side) as usize);
        for v in 0..side {
            for u in 0..side {
                let (x, y) = (f64::from(u) - size / 2.0, f64::from(v) - size / 2.0);
                let depth = 1.0 + self.tilt * y / size;
                let (x, y) = (x / depth, y / depth - ahead);
                light.push(self.mixed(x, y, size, upper, covered));
            }
        }
        self.develop(side, position_m, &light)
    }

    /// The picture of an exposure, [`SIDE_PX`](Self::SIDE_PX) wide and high, as a JPEG file.
    ///
    /// # Errors
    /// `Picture` where it cannot be encoded.
    pub fn expose(&self, exposure: &Exposure) -> Result<Vec<u8>, ReferenceCarError> {
        self.picture(Self::SIDE_PX, exposure.position_m, exposure.mu).jpeg()
    }

    /// Light from the road at a point of the plane, where the lower state covers the share `covered`.
    fn mixed(&self, x: f64, y: f64, size: f64, upper: usize, covered: f64) -> [f64; 3] {
        let share = if covered <= 0.0 || covered >= 1.0 {
            covered
        } else {
            // Value noise is nearly normal: this is the level above which the share `covered` lies.
            let level = quantile(1.0 - covered);
            let field = self.octaves(7, x, y, size / 6.0, 12.0, 1.0);
            (0.5 + (field - level) / 0.2).clamp(0.0, 1.0)
        };
        let above = if share < 1.0 { self.state(upper, x, y, size) } else { [0.0; 3] };
        let below = if share > 0.0 { self.state(upper + 1, x, y, size) } else { [0.0; 3] };
        [0, 1, 2].map(|k| (1.0 - share) * above[k] + share * below[k])
    }

    fn state(&self, state: usize, x: f64, y: f64, size: f64) -> [f64; 3] {
        let grain = value(self.seed, x / 1.3, y / 1.3) * self.grain;
        let stones = self.rough(1, x, y, 8.0) * self.stones;
        let mottle = self.smooth(2, x, y, size / 2.0) * self.mottle;
        let dry = |share: f64| self.albedo * (1.0 + share * (grain + stones) + mottle).max(0.05);
        let sky = self.sky * (0.7 + 0.25 * self.smooth(3, x, y / 4.0, size / 2.0)).max(0.05);
        match state {
            0 => self.tint.map(|t| t * dry(1.0)),
            1 => {
                let patches = (0.6 + 0.5 * self.rough(4, x, y / 2.0, size / 5.0)).clamp(0.0, 1.5);
                let glint = if value(self.seed ^ 5, x / 1.5, y / 1.5) > 1.68 { 0.25 } else { 0.0 };
                self.tint.map(|t| {
                    self.film * (1.0 + 1.2 * (t - 1.0)) * dry(1.0) + (self.sheen * patches + glint) * sky
                })
            }
            2 => {
                let ripple = 1.0 + 0.06 * self.rough(6, x, 2.0 * y, 20.0);
                [1.0, 1.02, 1.06].map(|blue| self.drowned * dry(0.2) + self.mirror * ripple * sky * blue)
            }
            3 => {
                // Light that wanders through snow evens out its relief: a contrast of a few percent is left.
                let height = |x: f64, y: f64| self.rough(8, x, y, 24.0);
                let slope = height(x + 1.5, y + 1.5) - height(x - 1.5, y - 1.5);
                let lit = (1.0 + self.relief * slope).clamp(0.3, 1.4);
                [0.97, 1.0, 1.03].map(|cool| self.white * lit * cool)
            }
            _ => {
                let milk = (self.milk + 0.12 * self.smooth(9, x, y, size / 3.0)).clamp(0.1, 0.9);
                let crack = (1.0 - self.rough(10, x, y, 30.0).abs() / 0.07).clamp(0.0, 1.0) * 0.3;
                let glare = (self.smooth(11, x, y / 2.0, size / 2.0) - 1.0).clamp(0.0, 1.0) * 0.4 * sky;
                [0.86, 1.0, 1.14].map(|blue| {
                    let seen = 0.6 * dry(0.3);
                    seen + milk * (0.45 * blue - seen) + crack + glare
                })
            }
        }
    }

    /// Lens, exposure, tone curve and sensor noise.
    fn develop(&self, side: u32, position_m: f64, light: &[[f64; 3]]) -> RoadPicture {
        let light = through_the_lens(side as usize, light);
        let mean = light.iter().map(|c| c[1]).sum::<f64>() / light.len().max(1) as f64;
        // An automatic exposure evens scenes out, but not wholly.
        let gain = self.exposure * (mean / 0.2).powf(0.25) / mean.max(1e-3);
        let frame = (position_m * 1e3).round() as i64 as u64;
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ frame.rotate_left(20));
        let mut data = Vec::with_capacity(light.len() * 3);
        for colour in &light {
            for c in colour {
                let level = 255.0 * (c * gain).clamp(0.0, 1.0).powf(1.0 / 2.2);
                // A triangular distribution of standard deviation `noise`.
                let noise = (rng.random::<f64>() - rng.random::<f64>()) * self.noise * 6.0f64.sqrt();
                data.push((level + noise + 0.5).clamp(0.0, 255.0) as u8);
            }
        }
        RoadPicture { side, data }
    }

    /// Octaves of equal strength from the wavelength `longest` (pixels) down to two pixels: a 1/f^2 field, unit variance.
    fn rough(&self, layer: u64, x: f64, y: f64, longest: f64) -> f64 {
        self.octaves(layer, x, y, longest, 2.0, 1.0)
    }

    /// Octaves whose strength falls with their wavelength: a 1/f^3 field, unit variance.
    fn smooth(&self, layer: u64, x: f64, y: f64, longest: f64) -> f64 {
        self.octaves(layer, x, y, longest, 2.0, 0.5f64.sqrt())
    }

    /// Octaves from the wavelength `longest` down to `shortest` (pixels), each `fall` times as strong as the one before.
    fn octaves(&self, layer: u64, x: f64, y: f64, longest: f64, shortest: f64, fall: f64) -> f64 {
        let (mut wavelength, mut weight, mut sum, mut power) = (longest, 1.0, 0.0, 0.0);
        let mut octave = 0;
        while wavelength >= shortest {
            // Wavelength is two lattice cells.
            let cell = wavelength / 2.0;
            sum += weight * value(self.seed ^ (layer << 32) ^ (octave << 40), x / cell, y / cell);
            power += weight * weight;
            (wavelength, weight, octave) = (wavelength / 2.0, weight * fall, octave + 1);
        }
        if power > 0.0 { sum / power.sqrt() } else { 0.0 }
    }
}

/// What lens and pixels pass on: each pixel the mean of its 3 x 3 neighbours with the weights 1 2 1 along rows and columns.
fn through_the_lens(side: usize, light: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let blur = |from: &[[f64; 3]], step: usize, along: fn(usize, usize) -> usize| -> Vec<[f64; 3]> {
        let soft = |(i, centre): (usize, &[f64; 3])| {
            let at = along(i, side);
            let before = from[if at > 0 { i - step } else { i }];
            let after = from[if at + 1 < side { i + step } else { i }];
            [0, 1, 2].map(|k| 0.25 * (before[k] + 2.0 * centre[k] + after[k]))
        };
        from.iter().enumerate().map(soft).collect()
    };
    let rows = blur(light, 1, |i, side| i % side);
    blur(&rows, side, |i, side| i / side)
}

/// Value noise: random numbers at whole coordinates, smooth in between; about unit variance.
fn value(seed: u64, x: f64, y: f64) -> f64 {
    let (fx, fy) = (x.floor(), y.floor());
    let ease = |t: f64| t * t * (3.0 - 2.0 * t);
    let (tx, ty) = (ease(x - fx), ease(y - fy));
    let (ix, iy) = (fx as i64, fy as i64);
    let corner = |dx: i64, dy: i64| lattice(seed, ix + dx, iy + dy);
    let top = corner(0, 0) + tx * (corner(1, 0) - corner(0, 0));
    let bottom = corner(0, 1) + tx * (corner(1, 1) - corner(0, 1));
    // Interpolation averages: its mean variance is 0.743^2 of the lattice's.
    (top + ty * (bottom - top)) / 0.743
}

/// A uniform number of unit variance for a lattice point (SplitMix64's finaliser).
fn lattice(seed: u64, x: i64, y: i64) -> f64 {
    let mut z = seed
        .wrapping_add((x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15))
        .wrapping_add((y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    let unit = ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64;
    (2.0 * unit - 1.0) * 3.0f64.sqrt()
}

/// The standard normal quantile, to 0.02 (Tukey's lambda).
fn quantile(p: f64) -> f64 {
    4.91 * (p.powf(0.14) - (1.0 - p).powf(0.14))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_follows_from_seed_and_place_and_moves_with_the_car() {
        let camera = RoadCamera::new(4);
        let here = camera.picture(64, 1.0, 0.85);
        assert_eq!(here, RoadCamera::new(4).picture(64, 1.0, 0.85));
        assert_ne!(here, camera.picture(64, 1.1, 0.85));
        assert_ne!(here, RoadCamera::new(5).picture(64, 1.0, 0.85));
        assert_eq!(here.data.len(), 64 * 64 * 3);
    }

    #[test]
    fn the_lens_spreads_a_point_and_loses_no_light() {
        let mut light = vec![[0.0; 3]; 49];
        light[24] = [16.0, 8.0, 0.0];
        let got = through_the_lens(7, &light);
        assert_eq!((got[24], got[23], got[16]), ([4.0, 2.0, 0.0], [2.0, 1.0, 0.0], [1.0, 0.5, 0.0]));
        assert_eq!(through_the_lens(7, &[[3.0; 3]; 49]), [[3.0; 3]; 49]);
    }

    #[test]
    fn value_noise_has_unit_variance_and_no_mean() {
        let n = 400;
        let all: Vec<f64> =
            (0..n * n).map(|i| value(3, f64::from(i / n) * 0.37, f64::from(i % n) * 0.37)).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let variance = all.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / all.len() as f64;
        assert!(mean.abs() < 0.05 && (variance - 1.0).abs() < 0.05, "{mean} {variance}");
    }
}
