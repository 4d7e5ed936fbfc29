//! The whole pipeline: a frame in, a friction prior out.

use crate::basis::{Basis, Prior};
use crate::decode::decode;
use crate::error::FrictionError;
use crate::estimate::{Estimate, Reason, Source};
use crate::filter::DistanceFilter;
use crate::network::{Answer, Network};
use crate::picture::{Frame, RgbPicture};
use crate::quality::QualityStatistics;
use crate::settings::Settings;
use crate::tensor::{Preprocessor, normalise};
use crate::transport::TransportGate;

/// What the odometry says at the time of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Motion {
    /// Distance travelled since any fixed moment, metres; none while there is no odometry.
    pub distance_m: Option<f64>,
}

/// Reads friction off a stream of pictures.
pub struct FrictionEstimator {
    settings: Settings,
    basis: Basis,
    network: Option<Box<dyn Network>>,
    preprocessor: Preprocessor,
    transport: TransportGate,
    filter: DistanceFilter,
    seen: Option<RgbPicture>,
}

impl std::fmt::Debug for FrictionEstimator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FrictionEstimator").field("settings", &self.settings).finish_non_exhaustive()
    }
}

/// What one picture says on its own.
struct Reading {
    p: Vec<f64>,
    entropy: f64,
    energy: f64,
    unfamiliarity: Option<f64>,
    quality: QualityStatistics,
    refused: Option<Reason>,
}

impl FrictionEstimator {
    /// `network`: none leaves the estimator on `settings.configured`.
    #[must_use]
    pub fn new(settings: Settings, basis: Basis, network: Option<Box<dyn Network>>) -> Self {
        Self {
            settings,
            basis,
            network,
            preprocessor: Preprocessor::default(),
            transport: TransportGate::default(),
            filter: DistanceFilter::default(),
            seen: None,
        }
    }

    /// The friction basis in use.
    #[must_use]
    pub fn basis(&self) -> &Basis {
        &self.basis
    }

    /// Forgets all pictures. A stamp that jumps back by more than a second does the same.
    pub fn reset(&mut self) {
        self.transport = TransportGate::default();
        self.filter = DistanceFilter::default();
    }

    /// The last region of interest as the network saw it.
    #[must_use]
    pub fn last_input(&self) -> Option<&RgbPicture> {
        self.seen.as_ref()
    }

    /// What to publish while no picture arrives.
    #[must_use]
    pub fn without_picture(&self) -> Estimate {
        match self.network {
            Some(_) => self.refuse(None, Reason::NoPicture, None),
            None => self.configured(),
        }
    }

    /// Takes in one frame of a stream at time `now_ns` (nanoseconds, the clock of the stamps).
    pub fn update(&mut self, frame: &Frame<'_>, now_ns: i64, motion: &Motion) -> Estimate {
        if self.network.is_none() {
            return self.configured();
        }
        if self.transport.clock_went_back(frame.stamp_ns) {
            self.reset();
        }
        let stamp = Some(frame.stamp_ns);
        let limits = &self.settings.transport;
        let late = self.transport.check(limits, frame.stamp_ns, now_ns, &frame.data, motion.distance_m);
        if let Some(reason) = late {
            return self.refuse(stamp, reason, None);
        }
        let reading = match self.read(frame) {
            Ok(reading) => reading,
            Err(error) => return self.refuse(stamp, Reason::of_error(&error), Some(error.to_string())),
        };
        let seen = |mut estimate: Estimate| {
            estimate.entropy = reading.entropy;
            estimate.energy = reading.energy;
            estimate.unfamiliarity = reading.unfamiliarity;
            estimate.quality = Some(reading.quality);
            estimate
        };
        if let Some(reason) = reading.refused {
            return seen(self.refuse(stamp, reason, None));
        }
        let p = self.filter.update(&self.settings.filter, &reading.p, motion.distance_m).to_vec();
        let Prior { mu, sigma } = self.basis.prior(&p);
        seen(Estimate {
            stamp_ns: stamp,
            source: Source::Camera,
            reason: None,
            detail: None,
            mu,
            sigma,
            probability: p,
            entropy: 0.0,
            energy: 0.0,
            unfamiliarity: None,
            quality: None,
            distance_m: self.filter.span_m(&self.settings.filter),
            pictures: self.filter.pictures(),
        })
    }

    /// Reads one picture on its own: no age, no stream, no average.
    pub fn read_single(&mut self, frame: &Frame<'_>) -> Estimate {
        self.reset();
        self.update(frame, frame.stamp_ns, &Motion::default())
    }

    /// Decode, look, ask.
    fn read(&mut self, frame: &Frame<'_>) -> Result<Reading, FrictionError> {
        let crop = decode(&frame.data, &self.settings.region)?;
        let input = self.seen.insert(self.preprocessor.resize(&crop)?);
        let quality = QualityStatistics::measure(input);
        let classes = self.basis.classes.len();
        let unread = |reason| Reading {
            p: vec![1.0 / classes as f64; classes],
            entropy: 1.0,
            energy: 0.0,
            unfamiliarity: None,
            quality,
            refused: Some(reason),
        };
        if let Some(reason) = self.settings.quality.check(&quality) {
            return Ok(unread(reason));
        }
        let tensor = normalise(input);
        let Some(network) = self.network.as_mut() else {
            return Ok(unread(Reason::NetworkFailed));
        };
        let Answer { logits, unfamiliarity } = network.read(&tensor)?;
        let unfamiliarity = unfamiliarity.map(f64::from);
        if logits.len() != classes || !logits.iter().all(|z| z.is_finite()) {
            let message = format!("expected {classes} finite logits, got {logits:?}");
            return Err(FrictionError::Inference { message });
        }
        let (p, energy) = softmax(&logits);
        let entropy =
            -p.iter().filter(|p| **p > 0.0).map(|p| p * p.ln()).sum::<f64>() / (classes as f64).ln();
        let limits = &self.settings.model;
        let strange = unfamiliarity.is_some_and(|d| d.is_nan() || d > limits.most_unfamiliarity);
        let refused = if p.iter().all(|p| *p > limits.most_least_probability) {
            Some(Reason::Undecided)
        } else if energy > limits.most_energy || strange {
            Some(Reason::Unfamiliar)
        } else {
            None
        };
        Ok(Reading { p, entropy, energy, unfamiliarity, quality, refused })
    }

    fn flat(&self) -> Vec<f64> {
        let n = self.basis.classes.len();
        vec![1.0 / n as f64; n]
    }

    fn refuse(&self, stamp_ns: Option<i64>, reason: Reason, detail: Option<String>) -> Estimate {
        let Prior { mu, sigma } = self.basis.uninformative;
        self.bare(stamp_ns, Source::Camera, Some(reason), detail, mu, sigma)
    }

    fn configured(&self) -> Estimate {
        let Prior { mu, sigma } = self.settings.configured;
        self.bare(None, Source::Configured, None, None, mu, sigma)
    }

    fn bare(
        &self,
        stamp_ns: Option<i64>,
        source: Source,
        reason: Option<Reason>,
        detail: Option<String>,
        mu: f64,
        sigma: f64,
    ) -> Estimate {
        Estimate {
            stamp_ns,
            source,
            reason,
            detail,
            mu,
            sigma,
            probability: self.flat(),
            entropy: 1.0,
            energy: 0.0,
            unfamiliarity: None,
            quality: None,
            distance_m: 0.0,
            pictures: 0,
        }
    }
}

/// p and the energy -ln sum exp z, free of overflow.
fn softmax(logits: &[f32]) -> (Vec<f64>, f64) {
    let top = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let weights: Vec<f64> = logits.iter().map(|z| f64::from(z - top).exp()).collect();
    let sum: f64 = weights.iter().sum();
    (weights.iter().map(|w| w / sum).collect(), -(f64::from(top) + sum.ln()))
}
