//! Road pictures to a friction prior: decoding, quality gates, network, filter over distance.
//!
//! The network answers with a distribution p over road states (dry, wet, standing water, snow, ice). With the friction
//! basis B (one coefficient and one spread per state, [`Basis`]) the prior is, after the paper's equation for the expected
//! friction,
//!
//! ```text
//! mu = p . B            sigma^2 = sum_i p_i (sigma_i^2 + B_i^2) - mu^2
//! ```
//!
//! A network always answers, also about a covered lens. So a picture passes gates before it counts, in this order:
//! transport (age, layout, a frozen camera), quality of the picture (dark, saturated, noisy, blurred), the network's own
//! doubt (no state out of the question, energy, a picture unlike those of its training); then p is averaged over the distance travelled. What fails
//! a gate yields `valid = false`, its [`Reason`] and the uninformative prior: never zero, never the last value.
//!
//! The network has learned from renders. What a track's floors are worth is learned from pictures of them, [`Calibration`]; sigma is as wide as the
//! errors on real roads until then.
//!
//! [`FrictionEstimator`] is the whole pipeline. Nothing here reads a clock or the environment: stamps, distances and folders
//! come in as arguments.

mod appearance;
mod basis;
mod bayer;
mod calibration;
mod decode;
mod embedding;
mod error;
mod estimate;
mod estimator;
mod files;
mod filter;
mod learner;
mod look;
mod network;
mod odometer;
mod picture;
mod quality;
mod settings;
mod tensor;
#[cfg(feature = "tract")]
mod tract;
mod transport;

pub use appearance::{APPEARANCE, appearance};
pub use basis::{Basis, FrictionClass, Prior};
pub use calibration::{
    Calibration, Errors, Example, FloorFriction, Kernel, Known, NETWORK_ERROR, floor_friction,
};
pub use decode::decode;
pub use embedding::{EMBEDDED, EMBEDDING_SIDE, Embedder, Embedding, OnnxEmbedder};
pub use error::FrictionError;
pub use estimate::{Estimate, Reason, Source};
pub use estimator::{FrictionEstimator, Motion};
pub use files::{find_embedding, find_library, find_model, read_picture};
pub use filter::{DistanceFilter, FilterSettings};
pub use learner::{Learner, Lesson};
pub use look::Look;
pub use network::{Answer, Network, OnnxRuntime};
pub use odometer::Odometer;
pub use picture::{Encoding, Frame, FrameData, RawPicture, Region, RgbPicture};
pub use quality::{QualityLimits, QualityStatistics};
pub use settings::{ModelLimits, Settings};
pub use tensor::{INPUT_SIDE, Preprocessor, normalise};
#[cfg(feature = "tract")]
pub use tract::Tract;
pub use transport::{TransportGate, TransportLimits};
