//! What a track has taught: appearances of its floors with the friction found there, and the function through them.
//!
//! The network has never seen the floor at hand; the car's tires have. A calibration pairs pictures with the friction that was labelled or identified
//! where they were taken. It speaks only of what looks like one of its examples. A floor unlike all of them is said to be new, and the network's
//! reading stands for it, as wide as its errors on real roads.

mod file;
mod fit;
mod label;
mod process;

use crate::appearance::{APPEARANCE, LEAST_SCALE};
use crate::embedding::{EMBEDDED, LEAST_EMBEDDED_SCALE};
use crate::error::FrictionError;
use process::Mixture;

pub use label::{FloorFriction, floor_friction};
pub use process::Kernel;

/// Error of the networks on photographs of real roads of which they have seen none, root of the mean square over dry, wet and snow: 0.18 and 0.16 on the two
/// sets of `tests/results/camera_prior/real_roads.py`, rounded up.
pub const NETWORK_ERROR: f64 = 0.20;
/// So many distances beyond the limit of what is known the network has the word alone.
const FADED_AT: f64 = 1.5;
/// Friction that no road falls below or exceeds.
const FRICTIONS: [f64; 2] = [0.03, 2.0];

/// A picture with the friction of what it shows.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Example {
    /// What it looks like: [`crate::appearance`], and what the embedding says after it, where there is one.
    pub appearance: Vec<f64>,
    /// Peak friction that the car's tires reach there.
    pub mu: f64,
    /// Standard deviation of that.
    pub sigma: f64,
    /// The floor or the drive that it comes from.
    pub source: String,
    /// Part of that source: pictures of one part are alike, and are left out together.
    pub part: u32,
    /// What the network said of it, where it was asked.
    pub network_mu: Option<f64>,
}

/// What a calibration says of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    /// Friction.
    pub mu: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// How far the picture looks from the nearest example, over how far pictures of known floors look from each other: above 1 the floor is new.
    pub distance: f64,
}

impl Known {
    /// Weight of the calibration against the network: 1 on a known floor, 0 on one that is unlike all.
    #[must_use]
    pub fn weight(&self) -> f64 {
        ((FADED_AT - self.distance) / (FADED_AT - 1.0)).clamp(0.0, 1.0)
    }
}

/// How well a calibration does, by leaving out part after part of every source.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Errors {
    /// Root of the mean square error, every source counted alike.
    pub known: f64,
    /// The same of the network on these pictures and on real roads elsewhere: the spread of what is said of a new floor.
    pub network: f64,
    /// The same where a whole source is left out; none with one source.
    pub new_source: Option<f64>,
    /// Share of the pictures within one sigma.
    pub within_sigma: f64,
}

/// A track's calibration.
#[derive(Debug, Clone)]
pub struct Calibration {
    track: String,
    examples: Vec<Example>,
    errors: Errors,
    mean: Vec<f64>,
    scale: Vec<f64>,
    /// By what the process's own sigma is multiplied, so that left-out errors are as large as it says.
    sigma_factor: f64,
    /// Distance from the nearest example above which a picture shows a new floor.
    new_distance: f64,
    process: Mixture,
}

impl Calibration {
    /// The track's name.
    #[must_use]
    pub fn track(&self) -> &str {
        &self.track
    }

    /// The pictures that it rests on.
    #[must_use]
    pub fn examples(&self) -> &[Example] {
        &self.examples
    }

    /// How well it does.
    #[must_use]
    pub fn errors(&self) -> &Errors {
        &self.errors
    }

    /// What it says of a picture that looks like this. Numbers beyond those that it has learned from do not count; where some are missing every floor is new.
    #[must_use]
    pub fn read(&self, appearance: &[f64]) -> Known {
        let x = scaled(appearance, &self.mean, &self.scale);
        let (mu, variance, nearest) = self.process.read(&x);
        let nearest = if x.len() < self.mean.len() { f64::INFINITY } else { nearest };
        Known {
            mu: mu.clamp(FRICTIONS[0], FRICTIONS[1]),
            sigma: self.sigma_factor * variance.sqrt(),
            distance: nearest / self.new_distance,
        }
    }
}

fn scaled(x: &[f64], mean: &[f64], scale: &[f64]) -> Vec<f64> {
    x.iter().zip(mean).zip(scale).map(|((x, m), s)| (x - m) / s).collect()
}

/// Whether an appearance may have so many numbers: without the embedding, or with it.
fn is_known_length(count: usize) -> bool {
    [APPEARANCE.len(), APPEARANCE.len() + EMBEDDED].contains(&count)
}

/// Mean and spread of each number over the examples; what means nothing is no spread. What was measured and what was embedded count alike, however many
/// numbers each of them has.
fn scale_of(examples: &[Example]) -> (Vec<f64>, Vec<f64>) {
    let count = examples.len().max(1) as f64;
    let numbers = examples.first().map_or(0, |e| e.appearance.len());
    let column = |k: usize| examples.iter().map(move |e| e.appearance[k]);
    let mean: Vec<f64> = (0..numbers).map(|k| column(k).sum::<f64>() / count).collect();
    let (measured, embedded) = (APPEARANCE.len(), numbers.saturating_sub(APPEARANCE.len()));
    let groups = if embedded > 0 { 2.0 } else { 1.0 };
    let scale = |k: usize| {
        let spread = (column(k).map(|x| (x - mean[k]).powi(2)).sum::<f64>() / count).sqrt();
        let (least, group) = match LEAST_SCALE.get(k) {
            Some(least) => (*least, measured),
            None => (LEAST_EMBEDDED_SCALE, embedded),
        };
        spread.max(least) * (groups * group as f64 / numbers as f64).sqrt()
    };
    let scale = (0..numbers).map(scale).collect();
    (mean, scale)
}

fn bad(message: impl Into<String>) -> FrictionError {
    FrictionError::BadCalibration { message: message.into() }
}
