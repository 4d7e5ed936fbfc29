//! The friction network, a track's calibration, and the prior that a bag's pictures give.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use gripsight_bag::{Bag, Reading, TopicMap, decode, from_cdr};
use gripsight_friction::{
    Basis, Calibration, Estimate, Frame, FrameData, FrictionEstimator, Look, Motion, Odometer, OnnxEmbedder,
    OnnxRuntime, RawPicture, Settings, find_embedding, find_library, find_model,
};
use gripsight_identification::FrictionPrior;
use gripsight_msgs::Message;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::sensor_msgs::{CompressedImage, Image};

/// How pictures are read: the same wherever pictures are.
#[derive(Debug, Args)]
#[command(next_help_heading = "Pictures")]
pub(crate) struct CameraArgs {
    /// Part of the pictures that shows road: found (`auto`), all of it (`full`), or left,top,right,bottom as shares of width and height.
    #[arg(long, value_name = "REGION", default_value = "auto", value_parser = look)]
    region: Look,
    /// Friction basis: what each road state is worth, as params/friction_basis.yaml, for the tires at hand.
    #[arg(long, value_name = "FILE")]
    basis: Option<PathBuf>,
    /// What the track has taught: a file of `gripsight friction calibrate`.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// The pictures' topic, of a bag with several; without it the one with the most pictures.
    #[arg(long, value_name = "TOPIC")]
    image_topic: Option<String>,
    /// The trained network; found beside the program, in the installation or in the source tree by default.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// The ONNX Runtime library; found beside the program or in `.deps/onnxruntime` of a folder above it by default.
    #[arg(long, value_name = "FILE")]
    library: Option<PathBuf>,
}

fn look(text: &str) -> Result<Look, String> {
    text.parse().map_err(|error: gripsight_friction::FrictionError| error.to_string())
}

impl CameraArgs {
    /// Loads basis, calibration and network.
    pub(crate) fn estimator(&self) -> anyhow::Result<FrictionEstimator> {
        let program = std::env::current_exe().context("cannot find out where this program is")?;
        let folder = program.parent().unwrap_or(Path::new("."));
        let basis = match &self.basis {
            Some(path) => Basis::read_file(path)?,
            None => Basis::builtin()?,
        };
        let calibration = self.calibration.as_deref().map(Calibration::read_file).transpose()?;
        let library = find_library(self.library.as_deref(), folder)?;
        let model = find_model(self.model.as_deref(), folder)?;
        let network = OnnxRuntime::load(&library, &model)?;
        let settings = Settings { region: self.region, ..Settings::default() };
        let embedder = OnnxEmbedder::load(&library, &find_embedding(&model, folder)?)?;
        let mut estimator = FrictionEstimator::new(settings, basis, Some(Box::new(network)))
            .with_embedder(Box::new(embedder));
        estimator.calibrate(calibration);
        Ok(estimator)
    }
}

/// A picture of a bag.
pub(crate) struct Shot<'a> {
    /// Its stamp.
    pub(crate) stamp_ns: i64,
    /// Its bytes.
    pub(crate) data: FrameData<'a>,
    /// What the odometry had measured by then.
    pub(crate) motion: Motion,
}

/// Hands every picture of one topic of a bag to `take`, in the order recorded; gives the topic. A message that cannot be read costs itself.
pub(crate) fn each_picture(
    path: &Path,
    topics: &TopicMap,
    args: &CameraArgs,
    mut take: impl FnMut(&Shot<'_>) -> anyhow::Result<()>,
) -> anyhow::Result<String> {
    let bag = Bag::open(path)?;
    let wanted = choose_topic(&bag, args)?;
    let streams = topics.resolve(&bag).ok();
    let odometry = streams.as_ref().and_then(|s| s.topic(gripsight_bag::Role::Odom));
    let raw = bag.topics().iter().any(|t| t.name == wanted && t.type_name == Image::TYPE);
    let mut odometer = Odometer::default();
    let mut reading = Reading::new(&wanted);
    for message in bag.messages() {
        let message = match message {
            Ok(message) => message,
            Err(gripsight_bag::BagError::Truncated { .. }) => break,
            Err(error) => return Err(error.into()),
        };
        let (topic, data) = (message.channel.topic.as_str(), &message.data);
        let mut shot = |stamp, data: FrameData<'_>| {
            let stamp_ns = decode::stamp_ns(stamp);
            take(&Shot { stamp_ns, data, motion: Motion { distance_m: odometer.at(stamp_ns) } })
        };
        if topic == wanted && raw {
            let Some(picture) = reading.take(message.log_time, from_cdr::<Image>(data)) else { continue };
            let raw = RawPicture {
                width: picture.width,
                height: picture.height,
                step: picture.step,
                encoding: &picture.encoding,
                big_endian: picture.is_bigendian != 0,
                data: &picture.data,
            };
            shot(picture.header.stamp, FrameData::Raw(raw))?;
        } else if topic == wanted {
            let Some(picture) = reading.take(message.log_time, from_cdr::<CompressedImage>(data)) else {
                continue;
            };
            shot(picture.header.stamp, FrameData::Compressed(&picture.data))?;
        } else if odometry == Some(topic) {
            // A stack's own type has no speed here: pictures are then averaged by number.
            if let Ok(odometry) = from_cdr::<Odometry>(data) {
                odometer.push(decode::stamp_ns(odometry.header.stamp), odometry.twist.twist.linear.x);
            }
        }
    }
    if let Some(left_out) = reading.done()? {
        tracing::warn!("{}: {left_out}", path.display());
    }
    Ok(wanted)
}

/// The topic asked for, the only one, or the one with the most pictures: two cameras are two streams.
fn choose_topic(bag: &Bag, args: &CameraArgs) -> anyhow::Result<String> {
    let path = bag.path().display();
    let is_picture = |name: &str| name == Image::TYPE || name == CompressedImage::TYPE;
    let mut counts: BTreeMap<&str, usize> =
        bag.topics().iter().filter(|t| is_picture(&t.type_name)).map(|t| (t.name.as_str(), 0)).collect();
    let names = counts.keys().copied().collect::<Vec<_>>().join(", ");
    if let Some(wanted) = &args.image_topic {
        if !counts.contains_key(wanted.as_str()) {
            bail!(
                "{path}: no pictures on {wanted} (there are: {})",
                if names.is_empty() { "none" } else { &names }
            );
        }
        return Ok(wanted.clone());
    }
    if counts.len() > 1 {
        for message in bag.messages().map_while(Result::ok) {
            if let Some(count) = counts.get_mut(message.channel.topic.as_str()) {
                *count += 1;
            }
        }
    }
    let Some((most, _)) = counts.iter().max_by_key(|(_, count)| **count) else {
        bail!("{path}: no topic with pictures ({} or {})", Image::TYPE, CompressedImage::TYPE);
    };
    if counts.len() > 1 {
        tracing::warn!("{path}: pictures on {names}: taking {most}; --image-topic chooses");
    }
    Ok((*most).to_owned())
}

/// What the pictures of some bags say, each at the distance that the odometry had by then. A bag without pictures adds nothing.
pub(crate) fn pictures_of_bags(
    paths: &[PathBuf],
    topics: &TopicMap,
    args: &CameraArgs,
) -> anyhow::Result<Seen> {
    let mut estimator = args.estimator()?;
    let mut pictures = Vec::new();
    for path in paths {
        estimator.reset();
        let read = each_picture(path, topics, args, |shot| {
            let frame = Frame { stamp_ns: shot.stamp_ns, data: shot.data };
            pictures.push((shot.stamp_ns, estimator.update(&frame, shot.stamp_ns, &shot.motion)));
            Ok(())
        });
        match read {
            Err(error) if paths.len() > 1 => tracing::warn!("{error:#}"),
            other => drop(other?),
        }
    }
    let bags = paths.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ");
    Ok(Seen { bags, undated: paths.len() > 1, pictures })
}

/// What pictures said.
pub(crate) struct Seen {
    /// Whose they are.
    bags: String,
    /// Whether the stamps say nothing of when in the drive they were taken: those of several bags, or of another clock.
    undated: bool,
    /// Stamp and estimate of each.
    pictures: Vec<(i64, Estimate)>,
}

impl Seen {
    /// Takes note of when the whole drive was, ns: where none of the pictures was taken then, they were stamped by another clock.
    pub(crate) fn beside(mut self, from_ns: i64, to_ns: i64) -> Self {
        let during = self.pictures.iter().any(|(stamp_ns, _)| (from_ns..=to_ns).contains(stamp_ns));
        if !self.undated && !during && !self.pictures.is_empty() {
            tracing::warn!(
                "{}: all {} pictures are stamped outside of the drive, by another clock: each part of the drive has the mean of all of them",
                self.bags,
                self.pictures.len()
            );
            self.undated = true;
        }
        self
    }

    /// The mean of what the pictures between two stamps say; of pictures that are not dated, all.
    pub(crate) fn between(&self, from_ns: i64, to_ns: i64) -> anyhow::Result<FrictionPrior> {
        let inside = |(stamp_ns, _): &&(i64, Estimate)| self.undated || (from_ns..=to_ns).contains(stamp_ns);
        let estimates = self.pictures.iter().filter(inside).map(|(_, estimate)| estimate);
        let (mut mu, mut second, mut valid, mut new_floor) = (0.0, 0.0, 0.0, 0_usize);
        let mut refused: BTreeMap<&'static str, usize> = BTreeMap::new();
        for estimate in estimates {
            match estimate.reason {
                None => {
                    valid += 1.0;
                    new_floor += usize::from(estimate.new_floor());
                    mu += estimate.mu;
                    second += estimate.mu.powi(2) + estimate.sigma.powi(2);
                }
                Some(reason) => *refused.entry(reason.as_str()).or_default() += 1,
            }
        }
        let refused = refused.iter().map(|(why, n)| format!("{n} {why}")).collect::<Vec<_>>().join(", ");
        if valid == 0.0 {
            let why = if refused.is_empty() { "there is none".to_owned() } else { refused };
            bail!("{}: no picture tells the friction: {why}", self.bags);
        }
        let mu = mu / valid;
        // Two surfaces in one drive are one wide prior.
        let prior = FrictionPrior { mu, sigma: (second / valid - mu * mu).max(0.0).sqrt() };
        let rest = if refused.is_empty() { String::new() } else { format!("; not used: {refused}") };
        let new = match new_floor {
            0 => String::new(),
            n => format!("; {n} show a floor that the calibration has not seen"),
        };
        tracing::info!(
            "friction prior {:.2} +- {:.2} from {valid:.0} pictures{new}{rest}",
            prior.mu,
            prior.sigma
        );
        Ok(prior)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use gripsight_friction::Source;

    use super::*;

    fn seen(pictures: &[(i64, f64)]) -> Seen {
        let estimate = |mu| Estimate {
            stamp_ns: None,
            source: Source::Camera,
            reason: None,
            detail: None,
            mu,
            sigma: 0.05,
            probability: Vec::new(),
            entropy: 0.0,
            energy: 0.0,
            unfamiliarity: None,
            quality: None,
            appearance: None,
            network_mu: None,
            known: None,
            distance_m: 0.0,
            pictures: 1,
        };
        let pictures = pictures.iter().map(|&(stamp_ns, mu)| (stamp_ns, estimate(mu))).collect();
        Seen { bags: "a bag".to_owned(), undated: false, pictures }
    }

    #[test]
    fn a_part_of_a_drive_has_the_pictures_of_its_time() {
        let seen = seen(&[(10, 0.9), (20, 0.9), (30, 0.5)]).beside(0, 40);
        let is = |from_ns, to_ns, mu: f64| (seen.between(from_ns, to_ns).unwrap().mu - mu).abs() < 1e-9;
        assert!(is(0, 25, 0.9) && is(25, 40, 0.5));
        assert!(seen.between(31, 40).is_err(), "the camera had stopped");
    }

    #[test]
    fn pictures_of_another_clock_are_of_the_whole_drive() {
        let prior = seen(&[(10, 0.9), (20, 0.5)]).beside(1_000, 2_000).between(1_000, 1_500).unwrap();
        assert!((prior.mu - 0.7).abs() < 1e-9, "{}", prior.mu);
        assert!(prior.sigma > 0.2, "two surfaces are one wide prior: {}", prior.sigma);
    }
}
