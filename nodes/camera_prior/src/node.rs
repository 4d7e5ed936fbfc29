//! Topics in, topics out.

use std::time::{Duration, Instant};

use gripsight_bag::{decode, encode};
use gripsight_friction::{
    Calibration, Estimate, Frame, FrameData, FrictionEstimator, Learner, Motion, Odometer, RawPicture,
    Reason, RgbPicture, Source,
};
use gripsight_msgs::standard::builtin_interfaces::Time;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::sensor_msgs::{CompressedImage, Image};
use gripsight_msgs::standard::std_msgs::Header;
use gripsight_msgs::{FrictionPrior, PacejkaParams};
use gripsight_runtime::{Clock, Diagnostics, Node, Publisher, Qos, Subscription, Trigger};

use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;

use crate::diagnostics::{Counts, Facts, status};
use crate::lesson::lesson;
use crate::pace::Pace;
use crate::settings::{self, Learning};

/// Age from which a picture is late: several times what transport takes.
const LATE_NS: i64 = 100_000_000;
/// How long a late picture waits for a newer one: longer than a camera's period at 30 Hz.
const SETTLE: Duration = Duration::from_millis(50);

/// Declares parameters and topics; gives the node's work.
pub(crate) fn setup(node: &mut Node) -> anyhow::Result<impl Future<Output = anyhow::Result<()>> + use<>> {
    let configuration = settings::declare(node)?;
    let no_network = configuration.models.as_ref().err().map(ToString::to_string);
    if let Some(why) = &no_network {
        tracing::error!("the configured friction stands, there is no network: {why}");
    }
    let wanted = configuration.input;
    let models = configuration.models.ok().flatten();
    let configured = models.is_none();
    let (network, embedder) = models.map(|models| (models.network, models.embedder)).unzip();
    let mut estimator = FrictionEstimator::new(configuration.settings, configuration.basis, network);
    if let Some(embedder) = embedder {
        estimator = estimator.with_embedder(embedder);
    }
    let learner = Learner::new(configuration.calibration.as_ref());
    estimator.calibrate(configuration.calibration);
    let pictures = node.sensor_qos(2).with_depth(2);
    let wants = |kind: &str| wanted == "both" || wanted == kind;
    let raw = wants("raw").then(|| node.subscription::<Image>("image", pictures)).transpose()?;
    let compressed = wants("compressed")
        .then(|| node.subscription::<CompressedImage>("image/compressed", pictures))
        .transpose()?;
    let odometry = node.subscription::<Odometry>("odom", node.sensor_qos(50))?;
    let learns = configuration.learning.wanted && !configured;
    let tires = learns.then(|| node.subscription::<PacejkaParams>("pacejka", Qos::latched())).transpose()?;
    let forget = node.trigger("~/forget", "forgotten what the track has taught")?;
    let pictures_from =
        raw.iter().map(Subscription::arrivals).chain(compressed.iter().map(Subscription::arrivals));
    node.needs(pictures_from.collect::<Vec<_>>());
    let region = configuration.publish_region;
    let state = State {
        estimator,
        no_network,
        configured,
        odometer: Odometer::default(),
        lateral_mps2: 0.0,
        learner,
        learning: configuration.learning,
        lessons: 0,
        taught: None,
        counts: Counts::default(),
        seen: Counts::default(),
        pace: configuration.pace,
        last: None,
        frame_id: String::new(),
        longest_ms: 0.0,
        clock: node.clock(),
        diagnostics: node.diagnostics(),
        friction: node.publisher("~/friction", Qos::latched())?,
        region: region.then(|| node.publisher("~/region/compressed", Qos::reliable(1))).transpose()?,
    };
    Ok(work(state, Inputs { raw, compressed, odometry, tires, forget }))
}

struct Inputs {
    raw: Option<Subscription<Image>>,
    compressed: Option<Subscription<CompressedImage>>,
    odometry: Subscription<Odometry>,
    tires: Option<Subscription<PacejkaParams>>,
    forget: Trigger,
}

async fn work(mut state: State, inputs: Inputs) -> anyhow::Result<()> {
    let Inputs { mut raw, mut compressed, mut odometry, mut tires, mut forget } = inputs;
    // What is being learned, beside the pictures' reading.
    let mut learned: Option<JoinHandle<Option<Calibration>>> = None;
    let mut ticks = tokio::time::interval(Duration::from_secs(1));
    // After a stop of the process: one tick, not all those missed.
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        // Odometry first: a picture is then placed by the newest distance.
        tokio::select! {
            biased;
            Some(message) = odometry.next() => {
                let sample = decode::odometry(&message);
                state.odometer.push(sample.stamp_ns, sample.v_x_mps.hypot(sample.v_y_mps));
                state.lateral_mps2 = sample.v_x_mps * sample.yaw_rate_radps;
            }
            Some(()) = forget.next() => {
                learned = None;
                state.forget();
            }
            Some(message) = next(&mut tires) => {
                if state.taught_by(&message) {
                    learned = Some(state.learn());
                }
            }
            calibration = finished(&mut learned) => {
                learned = None;
                state.calibrated(calibration);
            }
            Some(first) = next(&mut compressed) => {
                let message = state.newest(&mut compressed, first, |m| m.header.stamp).await;
                state.take(message.header, FrameData::Compressed(&message.data)).await;
            }
            Some(first) = next(&mut raw) => {
                let message = state.newest(&mut raw, first, |m| m.header.stamp).await;
                let picture = RawPicture {
                    width: message.width,
                    height: message.height,
                    step: message.step,
                    encoding: &message.encoding,
                    big_endian: message.is_bigendian != 0,
                    data: &message.data,
                };
                state.take(message.header, FrameData::Raw(picture)).await;
            }
            _ = ticks.tick() => state.tick().await,
            else => return Ok(()),
        }
    }
}

/// The next message; never, where there is no subscription.
async fn next<M>(subscription: &mut Option<Subscription<M>>) -> Option<M> {
    match subscription {
        Some(subscription) => subscription.next().await,
        None => std::future::pending().await,
    }
}

/// What was learned, once it is; never, where nothing is being learned.
async fn finished(learned: &mut Option<JoinHandle<Option<Calibration>>>) -> Option<Calibration> {
    match learned {
        Some(task) => task.await.ok().flatten(),
        None => std::future::pending().await,
    }
}

struct State {
    estimator: FrictionEstimator,
    no_network: Option<String>,
    /// There is no network: the configured friction stands.
    configured: bool,
    odometer: Odometer,
    /// Lateral acceleration by the last odometry.
    lateral_mps2: f64,
    learner: Learner,
    learning: Learning,
    lessons: u64,
    /// The set of tires that taught last.
    taught: Option<(String, u64)>,
    counts: Counts,
    /// The counts when the state was last reported.
    seen: Counts,
    pace: Pace,
    last: Option<Estimate>,
    frame_id: String,
    longest_ms: f64,
    clock: Clock,
    diagnostics: Diagnostics,
    friction: Publisher<FrictionPrior>,
    region: Option<Publisher<CompressedImage>>,
}

impl State {
    /// The newest picture that has arrived: those before it are old, and would only delay it. Behind a late one others
    /// may still be on their way out of the socket (the process was stopped, say): it waits for them, up to [`SETTLE`].
    async fn newest<M>(
        &mut self,
        subscription: &mut Option<Subscription<M>>,
        first: M,
        stamp: impl Fn(&M) -> Time,
    ) -> M {
        let mut message = first;
        let arrived = tokio::time::Instant::now();
        loop {
            let age_ns = decode::stamp_ns(self.clock.now()).saturating_sub(decode::stamp_ns(stamp(&message)));
            let patience = if age_ns > LATE_NS { SETTLE } else { Duration::ZERO };
            match tokio::time::timeout_at(arrived + patience, next(subscription)).await {
                Ok(Some(newer)) => message = newer,
                Ok(None) | Err(_) => return message,
            }
            self.counts.dropped += 1;
        }
    }

    /// Reads a picture and publishes what it says; one that follows the last too closely shows the same road and is left out.
    async fn take(&mut self, header: Header, data: FrameData<'_>) {
        let stamp_ns = decode::stamp_ns(header.stamp);
        if !self.pace.is_due(stamp_ns) {
            self.counts.left_out += 1;
            return;
        }
        let now_ns = decode::stamp_ns(self.clock.now());
        let motion = Motion { distance_m: self.odometer.at(stamp_ns) };
        let started = Instant::now();
        let frame = Frame { stamp_ns, data };
        let estimate = tokio::task::block_in_place(|| self.estimator.update(&frame, now_ns, &motion));
        self.longest_ms = self.longest_ms.max(started.elapsed().as_secs_f64() * 1e3);
        if estimate.reason == Some(Reason::OutOfOrder) {
            self.counts.dropped += 1;
            return;
        }
        self.counts.read += 1;
        self.counts.refused += u64::from(!estimate.valid());
        self.learner.see(&estimate, motion.distance_m, self.lateral_mps2);
        self.frame_id = header.frame_id;
        self.friction.publish(&self.message(&estimate)).await;
        self.last = Some(estimate);
    }

    /// Whether a set of tires taught anything.
    fn taught_by(&mut self, message: &PacejkaParams) -> bool {
        let set = (message.handshake.run_id.clone(), message.handshake.sequence_id);
        let Some(lesson) =
            lesson(message, self.learning.lesson_ns).filter(|_| self.taught.as_ref() != Some(&set))
        else {
            return false;
        };
        self.taught = Some(set);
        let pictures = self.learner.teach(&lesson);
        tracing::info!(
            "the tires say {:.2} +- {:.2} of the road: {pictures} pictures labelled",
            lesson.friction.mu,
            lesson.friction.sigma
        );
        self.lessons += u64::from(pictures > 0);
        pictures > 0
    }

    /// Learns from all lessons so far, beside the node's other work.
    fn learn(&self) -> JoinHandle<Option<Calibration>> {
        let (learner, track) = (self.learner.clone(), self.learning.track.clone());
        tokio::task::spawn_blocking(move || match learner.calibration(&track) {
            Ok(calibration) => Some(calibration),
            Err(error) => {
                tracing::info!("not learned yet: {error}");
                None
            }
        })
    }

    /// Takes what was learned, and keeps it.
    fn calibrated(&mut self, calibration: Option<Calibration>) {
        let Some(calibration) = calibration else { return };
        if let Some(file) = &self.learning.file {
            let made = file.parent().map_or(Ok(()), std::fs::create_dir_all);
            let kept = made.map_err(anyhow::Error::from).and_then(|()| Ok(calibration.write_file(file)?));
            if let Err(error) = kept {
                tracing::error!("what the track taught is not kept in {}: {error:#}", file.display());
            }
        }
        self.estimator.calibrate(Some(calibration));
    }

    fn forget(&mut self) {
        self.learner.forget();
        self.estimator.calibrate(None);
        self.taught = None;
        if let Some(file) = self.learning.file.as_ref().filter(|file| file.exists())
            && let Err(error) = std::fs::remove_file(file)
        {
            tracing::error!("{} is not removed: {error}", file.display());
        }
        tracing::info!("forgotten what the track has taught");
    }

    /// Once a second: says how the node is, and publishes where no picture did.
    async fn tick(&mut self) {
        let newly_read = self.counts.read - self.seen.read;
        if newly_read == 0 || self.configured {
            let estimate = self.estimator.without_picture();
            self.friction.publish(&self.message(&estimate)).await;
            self.last = Some(estimate);
        }
        let calibration = self.estimator.calibration().map(Calibration::hash).unwrap_or_default();
        let facts = Facts {
            lessons: self.lessons,
            calibration: &calibration,
            no_network: self.no_network.as_deref(),
            configured: self.configured,
            counts: self.counts,
            newly_read,
            last: self.last.as_ref(),
            odometry: self.odometer.is_running(),
            longest_ms: self.longest_ms,
        };
        self.diagnostics.report("camera", status(&facts));
        self.seen = self.counts;
        self.longest_ms = 0.0;
        if let (Some(publisher), Some(picture)) = (&self.region, self.estimator.last_input())
            && let Some(message) = region_message(picture, self.header(self.last.as_ref()))
        {
            publisher.publish(&message).await;
        }
    }

    fn header(&self, estimate: Option<&Estimate>) -> Header {
        let stamp = estimate.and_then(|e| e.stamp_ns).map_or_else(|| self.clock.now(), encode::time);
        Header { stamp, frame_id: self.frame_id.clone() }
    }

    fn message(&self, estimate: &Estimate) -> FrictionPrior {
        let classes = &self.estimator.basis().classes;
        FrictionPrior {
            header: self.header(Some(estimate)),
            source: match estimate.source {
                Source::Configured => FrictionPrior::CONFIGURED,
                Source::Camera => FrictionPrior::CAMERA,
            },
            valid: estimate.valid(),
            reason: estimate.reason.map_or("", Reason::as_str).to_owned(),
            mu: estimate.mu,
            sigma: estimate.sigma,
            classes: classes.iter().map(|c| c.name.clone()).collect(),
            probability: estimate.probability.clone(),
            class_mu: classes.iter().map(|c| c.mu).collect(),
            entropy: estimate.entropy,
            distance_m: estimate.distance_m,
            pictures: estimate.pictures,
            new_floor: estimate.new_floor(),
            calibration: self.estimator.calibration().map(Calibration::hash).unwrap_or_default(),
        }
    }
}

/// The network's input as a JPEG; none where it cannot be encoded.
fn region_message(picture: &RgbPicture, header: Header) -> Option<CompressedImage> {
    let mut data = Vec::new();
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut data, 90);
    let colour = image::ExtendedColorType::Rgb8;
    match encoder.encode(&picture.data, picture.width, picture.height, colour) {
        Ok(()) => Some(CompressedImage { header, format: "jpeg".to_owned(), data }),
        Err(error) => {
            tracing::warn!("region of interest not encoded: {error}");
            None
        }
    }
}
