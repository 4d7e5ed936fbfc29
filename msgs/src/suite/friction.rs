//! The friction prior.

use serde::{Deserialize, Serialize};

use crate::Message;
use crate::standard::std_msgs::Header;

/// Friction that the road ahead offers, as seen by the camera or as configured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrictionPrior {
    /// Stamp and optical frame of the newest picture used.
    pub header: Header,
    /// CONFIGURED or CAMERA.
    pub source: u8,
    /// False: do not use mu; it then holds an uninformative prior.
    pub valid: bool,
    /// Why valid is false; empty when it is true.
    pub reason: String,
    /// Expected peak friction coefficient.
    pub mu: f64,
    /// Standard deviation of mu.
    pub sigma: f64,
    /// Names of the friction classes, in the order of the next fields.
    pub classes: Vec<String>,
    /// Probability of each class, sums to 1.
    pub probability: Vec<f64>,
    /// Friction coefficient that stands for each class.
    pub class_mu: Vec<f64>,
    /// Entropy of probability over that of a uniform one, 0 to 1.
    pub entropy: f64,
    /// Distance travelled over which the pictures were averaged (m).
    pub distance_m: f64,
    /// Pictures in that average.
    pub pictures: u32,
    /// There is a calibration, and the newest picture shows a floor that it has not seen.
    pub new_floor: bool,
    /// Hash of what the track has taught; empty without it.
    pub calibration: String,
}

impl FrictionPrior {
    /// Source: the configured value, no picture used.
    pub const CONFIGURED: u8 = 1;
    /// Source: the network's reading of pictures.
    pub const CAMERA: u8 = 2;
}

impl Message for FrictionPrior {
    const TYPE: &'static str = "gripsight_msgs/msg/FrictionPrior";
}
