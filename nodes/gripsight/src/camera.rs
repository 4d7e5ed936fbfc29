//! The friction network, and the prior that a bag's pictures give.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use gripsight_bag::{Bag, TopicMap, decode, from_cdr};
use gripsight_friction::{
    Basis, Estimate, Frame, FrameData, FrictionEstimator, Motion, Odometer, OnnxRuntime, RawPicture,
    Settings, find_library, find_model,
};
use gripsight_identification::FrictionPrior;
use gripsight_msgs::Message;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::sensor_msgs::{CompressedImage, Image};
use gripsight_msgs::standard::std_msgs::Header;

/// Where the network and the library that runs it are.
#[derive(Debug, Args)]
pub(crate) struct NetworkArgs {
    /// The trained network; found beside the program, in the installation or in the source tree by default.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// The ONNX Runtime library; found beside the program or in `.deps/onnxruntime` of a folder above it by default.
    #[arg(long, value_name = "FILE")]
    library: Option<PathBuf>,
}

/// Loads the network.
pub(crate) fn estimator(args: &NetworkArgs) -> anyhow::Result<FrictionEstimator> {
    let program = std::env::current_exe().context("cannot find out where this program is")?;
    let folder = program.parent().unwrap_or(Path::new("."));
    let library = find_library(args.library.as_deref(), folder)?;
    let model = find_model(args.model.as_deref(), folder)?;
    let network = OnnxRuntime::load(&library, &model)?;
    Ok(FrictionEstimator::new(Settings::default(), Basis::builtin()?, Some(Box::new(network))))
}

/// The mean of what the bag's pictures say, each at the distance that the odometry had by then.
pub(crate) fn prior_of_bag(
    path: &Path,
    topics: &TopicMap,
    args: &NetworkArgs,
) -> anyhow::Result<FrictionPrior> {
    let bag = Bag::open(path)?;
    let is_picture = |name: &str| name == Image::TYPE || name == CompressedImage::TYPE;
    if !bag.topics().iter().any(|t| is_picture(&t.type_name)) {
        bail!("{}: no topic with pictures ({} or {})", path.display(), Image::TYPE, CompressedImage::TYPE);
    }
    let streams = topics.resolve(&bag).ok();
    let odometry = streams.as_ref().and_then(|s| s.topic(gripsight_bag::Role::Odom));
    let mut estimator = estimator(args)?;
    let mut odometer = Odometer::default();
    let mut seen = Seen::default();
    for message in bag.messages() {
        let message = match message {
            Ok(message) => message,
            Err(gripsight_bag::BagError::Truncated { .. }) => break,
            Err(error) => return Err(error.into()),
        };
        let (topic, data) = (message.channel.topic.as_str(), &message.data);
        let type_name = bag.topics().iter().find(|t| t.name == topic).map_or("", |t| &t.type_name);
        if odometry == Some(topic) {
            let odometry: Odometry = from_cdr(data)?;
            odometer.push(decode::stamp_ns(odometry.header.stamp), odometry.twist.twist.linear.x);
        } else if type_name == CompressedImage::TYPE {
            let picture: CompressedImage = from_cdr(data)?;
            seen.take(&update(
                &mut estimator,
                &odometer,
                &picture.header,
                FrameData::Compressed(&picture.data),
            ));
        } else if type_name == Image::TYPE {
            let picture: Image = from_cdr(data)?;
            let raw = RawPicture {
                width: picture.width,
                height: picture.height,
                step: picture.step,
                encoding: &picture.encoding,
                big_endian: picture.is_bigendian != 0,
                data: &picture.data,
            };
            seen.take(&update(&mut estimator, &odometer, &picture.header, FrameData::Raw(raw)));
        }
    }
    seen.mean().with_context(|| format!("{}: no picture tells the friction", path.display()))
}

fn update(
    estimator: &mut FrictionEstimator,
    odometer: &Odometer,
    header: &Header,
    data: FrameData<'_>,
) -> Estimate {
    let stamp_ns = decode::stamp_ns(header.stamp);
    let motion = Motion { distance_m: odometer.at(stamp_ns) };
    estimator.update(&Frame { stamp_ns, data }, stamp_ns, &motion)
}

/// Sums over pictures.
#[derive(Default)]
struct Seen {
    valid: usize,
    mu: f64,
    sigma: f64,
    refused: BTreeMap<&'static str, usize>,
}

impl Seen {
    fn take(&mut self, estimate: &Estimate) {
        match estimate.reason {
            None => {
                self.valid += 1;
                self.mu += estimate.mu;
                self.sigma += estimate.sigma;
            }
            Some(reason) => *self.refused.entry(reason.as_str()).or_default() += 1,
        }
    }

    fn mean(&self) -> anyhow::Result<FrictionPrior> {
        let refused = self.refused.iter().map(|(why, n)| format!("{n} {why}")).collect::<Vec<_>>().join(", ");
        if self.valid == 0 {
            bail!("{}", if refused.is_empty() { "there is none".to_owned() } else { refused });
        }
        let count = self.valid as f64;
        let prior = FrictionPrior { mu: self.mu / count, sigma: self.sigma / count };
        let rest = if refused.is_empty() { String::new() } else { format!("; not used: {refused}") };
        tracing::info!(
            "friction prior {:.2} +- {:.2} from {} pictures{rest}",
            prior.mu,
            prior.sigma,
            self.valid
        );
        Ok(prior)
    }
}
