//! The whole pipeline: a frame in, a friction prior out.

use crate::appearance::appearance;
use crate::basis::{Basis, Prior};
use crate::calibration::{Calibration, Known};
use crate::decode::decode;
use crate::embedding::{EMBEDDING_SIDE, Embedder};
use crate::error::FrictionError;
use crate::estimate::{Estimate, Reason, Source};
use crate::filter::DistanceFilter;
use crate::learner::is_near;
use crate::look::{Look, RoadFinder};
use crate::network::{Answer, Network};
use crate::picture::{Frame, FrameData, Region, RgbPicture};
use crate::quality::QualityStatistics;
use crate::settings::{ModelLimits, Settings};
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
    finder: RoadFinder,
    calibration: Option<Calibration>,
    embedder: Option<Box<dyn Embedder>>,
    seen: Option<RgbPicture>,
    sight: Option<Sight>,
}

/// What a picture looks like, and what the track has taught of it: it stands for the next metre.
struct Sight {
    stamp_ns: i64,
    distance_m: Option<f64>,
    appearance: Vec<f64>,
    known: Option<Known>,
    /// Probability of snow, where there is an embedding.
    snow: f64,
}

impl std::fmt::Debug for FrictionEstimator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FrictionEstimator").field("settings", &self.settings).finish_non_exhaustive()
    }
}

/// What one picture says on its own.
struct Reading {
    p: Vec<f64>,
    prior: Prior,
    entropy: f64,
    energy: f64,
    unfamiliarity: Option<f64>,
    quality: QualityStatistics,
    appearance: Option<Vec<f64>>,
    network_mu: Option<f64>,
    known: Option<Known>,
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
            finder: RoadFinder::default(),
            calibration: None,
            embedder: None,
            seen: None,
            sight: None,
        }
    }

    /// Calibrations compare by this embedding, too.
    #[must_use]
    pub fn with_embedder(mut self, embedder: Box<dyn Embedder>) -> Self {
        self.embedder = Some(embedder);
        self
    }

    /// Takes what a track has taught; none leaves the network alone.
    pub fn calibrate(&mut self, calibration: Option<Calibration>) {
        (self.calibration, self.sight) = (calibration, None);
    }

    /// What the track has taught.
    #[must_use]
    pub fn calibration(&self) -> Option<&Calibration> {
        self.calibration.as_ref()
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
        self.finder = RoadFinder::default();
        self.sight = None;
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
        let reading = match self.read(frame, motion.distance_m) {
            Ok(reading) => reading,
            Err(error) => return self.refuse(stamp, Reason::of_error(&error), Some(error.to_string())),
        };
        let seen = |mut estimate: Estimate| {
            estimate.entropy = reading.entropy;
            estimate.energy = reading.energy;
            estimate.unfamiliarity = reading.unfamiliarity;
            estimate.quality = Some(reading.quality);
            estimate.appearance.clone_from(&reading.appearance);
            estimate.network_mu = reading.network_mu;
            estimate.known = reading.known;
            estimate
        };
        if let Some(reason) = reading.refused {
            return seen(self.refuse(stamp, reason, None));
        }
        // The first two moments beside p: the spread between pictures then counts in sigma.
        let Prior { mu, sigma } = reading.prior;
        let numbers = [&reading.p[..], &[mu, mu * mu + sigma * sigma]].concat();
        let mut p = self.filter.update(&self.settings.filter, &numbers, motion.distance_m).to_vec();
        let [mu, second] = [p.len() - 2, p.len() - 1].map(|k| p[k]);
        p.truncate(reading.p.len());
        let sigma = (second - mu * mu).max(0.0).sqrt();
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
            appearance: None,
            network_mu: None,
            known: None,
            distance_m: self.filter.span_m(&self.settings.filter),
            pictures: self.filter.pictures(),
        })
    }

    /// Reads one picture on its own: no age, no stream, no average.
    pub fn read_single(&mut self, frame: &Frame<'_>) -> Estimate {
        self.reset();
        self.update(frame, frame.stamp_ns, &Motion::default())
    }

    /// Decode, look, ask the network and the calibration.
    fn read(&mut self, frame: &Frame<'_>, distance_m: Option<f64>) -> Result<Reading, FrictionError> {
        let (crop, region) = self.crop(&frame.data)?;
        let quality = QualityStatistics::measure(self.seen.insert(self.preprocessor.resize(&crop)?));
        let mut reading = Reading {
            p: self.flat(),
            prior: self.basis.uninformative,
            entropy: 1.0,
            energy: 0.0,
            unfamiliarity: None,
            quality,
            appearance: None,
            network_mu: None,
            known: None,
            refused: self.settings.quality.check(&quality),
        };
        if reading.refused.is_none() {
            let sight = self.sight(frame, distance_m, region)?;
            let snow = sight.snow;
            (reading.appearance, reading.known) = (Some(sight.appearance.clone()), sight.known);
            self.ask(&mut reading, snow)?;
        }
        Ok(reading)
    }

    /// What the road in a region looks like here: embedded once a metre, as an embedding costs more than all else.
    fn sight(
        &mut self,
        frame: &Frame<'_>,
        distance_m: Option<f64>,
        region: Region,
    ) -> Result<&Sight, FrictionError> {
        let stamp_ns = frame.stamp_ns;
        let here = (stamp_ns, distance_m);
        let near = self.sight.take().filter(|last| is_near(here, (last.stamp_ns, last.distance_m)));
        let sight = match (near, &mut self.embedder, &self.seen) {
            (Some(last), Some(_), _) => last,
            (_, embedder, Some(input)) => {
                let (mut appearance, mut snow) = (appearance(input, self.finder.scene()).to_vec(), 0.0);
                if let Some(embedder) = embedder {
                    let around = decode(&frame.data, &self.settings.region.around(region))?;
                    let small = self.preprocessor.resize_to(&around, EMBEDDING_SIDE)?;
                    let seen = embedder.embed(&normalise(&small))?;
                    appearance.extend(seen.numbers);
                    snow = seen.snow;
                }
                let known = self.calibration.as_ref().map(|c| c.read(&appearance));
                Sight { stamp_ns, distance_m, appearance, known, snow }
            }
            (_, _, None) => Sight { stamp_ns, distance_m, appearance: Vec::new(), known: None, snow: 0.0 },
        };
        Ok(self.sight.insert(sight))
    }

    fn crop(&mut self, data: &FrameData<'_>) -> Result<(RgbPicture, Region), FrictionError> {
        let whole = match self.finder.wants_a_look() {
            true => Some(decode(data, &Region::WHOLE)?),
            false => None,
        };
        whole.iter().for_each(|whole| self.finder.look(whole));
        let found = self.finder.region().unwrap_or(Region::WHOLE);
        let region = match self.settings.region {
            Look::At(region) => region,
            Look::Auto => found,
        };
        let crop = whole.map_or_else(|| decode(data, &region), |whole| Ok(whole.crop(&region)));
        Ok((crop?, region))
    }

    /// Fills in what the network says, beside a probability of snow that is not its own, and joins it with what the calibration does.
    fn ask(&mut self, reading: &mut Reading, snow: f64) -> Result<(), FrictionError> {
        let (Some(network), Some(input)) = (self.network.as_mut(), self.seen.as_ref()) else {
            reading.refused = Some(Reason::NetworkFailed);
            return Ok(());
        };
        let classes = self.basis.classes.len();
        let Answer { logits, unfamiliarity } = network.read(&normalise(input))?;
        let unfamiliarity = unfamiliarity.map(f64::from);
        if logits.len() != classes || !logits.iter().all(|z| z.is_finite()) {
            let message = format!("expected {classes} finite logits, got {logits:?}");
            return Err(FrictionError::Inference { message });
        }
        let (p, energy) = softmax(&logits);
        reading.entropy =
            -p.iter().filter(|p| **p > 0.0).map(|p| p * p.ln()).sum::<f64>() / (classes as f64).ln();
        (reading.energy, reading.unfamiliarity) = (energy, unfamiliarity);
        let limits = &self.settings.model;
        let strange = unfamiliarity.is_some_and(|d| d.is_nan() || d > limits.most_unfamiliarity);
        let doubt = if p.iter().all(|p| *p > limits.most_least_probability) {
            Some(Reason::Undecided)
        } else if energy > limits.most_energy || strange {
            Some(Reason::Unfamiliar)
        } else {
            None
        };
        let p = self.snowy(p, snow);
        let network = match doubt {
            Some(_) => self.basis.uninformative,
            None => {
                let Prior { mu, sigma } = self.basis.prior(&p);
                reading.network_mu = Some(mu);
                let error =
                    self.calibration.as_ref().map_or(self.settings.network_error, |c| c.errors().network);
                let strangeness = unfamiliarity.unwrap_or(0.0) / ModelLimits::USUAL_UNFAMILIARITY;
                Prior { mu, sigma: sigma.max(error * strangeness.max(1.0)) }
            }
        };
        reading.p = p;
        let weight = reading.known.map_or(0.0, |known| known.weight());
        // A floor that the track has taught needs no network.
        reading.refused = doubt.filter(|_| weight < 0.5);
        reading.prior = reading.known.map_or(network, |known| joined(&known, weight, network));
        Ok(())
    }

    /// p, with snow as likely as the embedding holds it at least.
    fn snowy(&self, mut p: Vec<f64>, snow: f64) -> Vec<f64> {
        if let Some(place) = self.basis.classes.iter().position(|class| class.name == "snow") {
            p.iter_mut().for_each(|p| *p *= 1.0 - snow);
            p[place] += snow;
        }
        p
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
            appearance: None,
            network_mu: None,
            known: None,
            distance_m: 0.0,
            pictures: 0,
        }
    }
}

/// The mixture of what the calibration says, with its weight, and what the network says.
fn joined(known: &Known, weight: f64, network: Prior) -> Prior {
    let mu = weight * known.mu + (1.0 - weight) * network.mu;
    let second = weight * (known.sigma.powi(2) + known.mu.powi(2))
        + (1.0 - weight) * (network.sigma.powi(2) + network.mu.powi(2));
    Prior { mu, sigma: (second - mu * mu).max(0.0).sqrt() }
}

/// p and the energy -ln sum exp z, free of overflow.
fn softmax(logits: &[f32]) -> (Vec<f64>, f64) {
    let top = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let weights: Vec<f64> = logits.iter().map(|z| f64::from(z - top).exp()).collect();
    let sum: f64 = weights.iter().sum();
    (weights.iter().map(|w| w / sum).collect(), -(f64::from(top) + sum.ln()))
}
