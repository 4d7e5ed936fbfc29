//! All settings of the pipeline.

use crate::basis::Prior;
use crate::calibration::NETWORK_ERROR;
use crate::filter::FilterSettings;
use crate::look::Look;
use crate::picture::Region;
use crate::quality::QualityLimits;
use crate::transport::TransportLimits;

/// All settings of the pipeline.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The part of the picture that shows road.
    pub region: Look,
    /// Limits of the transport gate.
    pub transport: TransportLimits,
    /// Limits of the picture-quality gate.
    pub quality: QualityLimits,
    /// Limits of the network's doubt.
    pub model: ModelLimits,
    /// The filter over distance.
    pub filter: FilterSettings,
    /// The least sigma of what the network says of a road that no calibration knows.
    pub network_error: f64,
    /// What to publish while there is no network.
    pub configured: Prior,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            region: Look::At(Region::WHOLE),
            transport: TransportLimits::default(),
            quality: QualityLimits::default(),
            model: ModelLimits::default(),
            filter: FilterSettings::default(),
            network_error: NETWORK_ERROR,
            configured: Prior { mu: 0.85, sigma: 0.25 },
        }
    }
}

/// Limits of the gate on the network's own doubt. Beyond [`ModelLimits::USUAL_UNFAMILIARITY`] sigma grows, and what is refused is what no road under
/// shadows, glare or a low sun gives: sigma carries the error on real roads, so that a doubt need not be a refusal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelLimits {
    /// Largest p of the least likely state: on a road some state is out of the question, before a bad picture none is.
    pub most_least_probability: f64,
    /// Largest energy, -ln sum exp z.
    pub most_energy: f64,
    /// Largest [`unfamiliarity`](crate::Answer::unfamiliarity).
    pub most_unfamiliarity: f64,
}

impl ModelLimits {
    /// Unfamiliarity that 97 of 100 honest renders stay below.
    pub const USUAL_UNFAMILIARITY: f64 = 1.4;
}

impl Default for ModelLimits {
    fn default() -> Self {
        Self { most_least_probability: 0.13, most_energy: -1.6, most_unfamiliarity: 2.0 }
    }
}
