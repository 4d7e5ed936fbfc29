//! What the pipeline says: a prior, where it comes from, and why it is not usable.

use crate::calibration::Known;
use crate::error::FrictionError;
use crate::quality::QualityStatistics;

/// Why a picture, or the lack of one, yields no usable prior.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// No picture has arrived, or none for too long.
    NoPicture,
    /// The picture's stamp is too old, or ahead of the clock.
    Stale,
    /// A newer picture was already used.
    OutOfOrder,
    /// The encoding is not supported.
    UnknownEncoding,
    /// Size, step and number of bytes contradict each other.
    BadLayout,
    /// The compressed data is cut off or damaged.
    Undecodable,
    /// The picture has not changed while the car drove on.
    Frozen,
    /// Too dark.
    Dark,
    /// Over-exposed.
    Saturated,
    /// Nothing but noise.
    Noisy,
    /// Blurred or blank.
    Blurred,
    /// The network cannot decide: it holds every state possible.
    Undecided,
    /// Unlike the pictures trained on: the energy of the logits or the distance that the network tells is too high.
    Unfamiliar,
    /// The engine failed.
    NetworkFailed,
}

impl Reason {
    /// One word, lower case, for messages and JSON.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::NoPicture => "no_picture",
            Self::Stale => "stale",
            Self::OutOfOrder => "out_of_order",
            Self::UnknownEncoding => "unknown_encoding",
            Self::BadLayout => "bad_layout",
            Self::Undecodable => "undecodable",
            Self::Frozen => "frozen",
            Self::Dark => "dark",
            Self::Saturated => "saturated",
            Self::Noisy => "noisy",
            Self::Blurred => "blurred",
            Self::Undecided => "undecided",
            Self::Unfamiliar => "unfamiliar",
            Self::NetworkFailed => "network_failed",
        }
    }

    /// Whether the picture itself, not the network, is why: too late, broken, dark, blurred.
    #[must_use]
    pub fn is_of_the_picture(self) -> bool {
        !matches!(self, Self::Undecided | Self::Unfamiliar | Self::NetworkFailed)
    }

    pub(crate) fn of_error(error: &FrictionError) -> Self {
        match error {
            FrictionError::UnknownEncoding { .. } => Self::UnknownEncoding,
            FrictionError::BadLayout { .. }
            | FrictionError::BadSize { .. }
            | FrictionError::Resize { .. } => Self::BadLayout,
            FrictionError::Truncated { .. } | FrictionError::Undecodable { .. } => Self::Undecodable,
            _ => Self::NetworkFailed,
        }
    }
}

/// Where a prior comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// The configured value: there is no network.
    Configured,
    /// The network's reading of pictures.
    Camera,
}

/// A friction prior.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Stamp of the newest picture that it rests on, nanoseconds; none where there was no picture.
    pub stamp_ns: Option<i64>,
    /// Where it comes from.
    pub source: Source,
    /// Why it is not usable. `None`: it is.
    pub reason: Option<Reason>,
    /// What the failing part said, where it said something.
    pub detail: Option<String>,
    /// Expected peak friction coefficient; the uninformative prior's where not usable.
    pub mu: f64,
    /// Standard deviation of `mu`.
    pub sigma: f64,
    /// p, averaged over the distance travelled; uniform where not usable or configured.
    pub probability: Vec<f64>,
    /// Entropy of the network's own p of the newest picture over that of a uniform p, 0 to 1.
    pub entropy: f64,
    /// Energy of the newest picture's logits, -ln sum exp z; zero where the network was not asked.
    pub energy: f64,
    /// How unlike the training pictures the newest picture is, see [`Answer::unfamiliarity`](crate::Answer::unfamiliarity).
    pub unfamiliarity: Option<f64>,
    /// Statistics of the newest picture's region of interest.
    pub quality: Option<QualityStatistics>,
    /// What the newest picture's region looks like: [`appearance`](crate::appearance), and the embedding after it where there is one; of a picture at most a
    /// metre before where there is. None where no picture could be read.
    pub appearance: Option<Vec<f64>>,
    /// What the network alone says of the newest picture; none where it was not asked, or is not believed.
    pub network_mu: Option<f64>,
    /// What the calibration says of it; none without one.
    pub known: Option<Known>,
    /// Distance that the average spans, metres.
    pub distance_m: f64,
    /// Pictures in the average.
    pub pictures: u32,
}

impl Estimate {
    /// Whether `mu` may be used.
    #[must_use]
    pub fn valid(&self) -> bool {
        self.reason.is_none()
    }

    /// Whether there is a calibration, and the newest picture shows a floor that it has not seen.
    #[must_use]
    pub fn new_floor(&self) -> bool {
        self.known.is_some_and(|known| known.distance > 1.0)
    }
}
