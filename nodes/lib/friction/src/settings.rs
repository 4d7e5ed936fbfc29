//! All settings of the pipeline.

use crate::basis::Prior;
use crate::filter::FilterSettings;
use crate::picture::Region;
use crate::quality::QualityLimits;
use crate::transport::TransportLimits;

/// All settings of the pipeline.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The part of the picture that shows road.
    pub region: Region,
    /// Limits of the transport gate.
    pub transport: TransportLimits,
    /// Limits of the picture-quality gate.
    pub quality: QualityLimits,
    /// Limits of the network's doubt.
    pub model: ModelLimits,
    /// The filter over distance.
    pub filter: FilterSettings,
    /// What to publish while there is no network.
    pub configured: Prior,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            region: Region::WHOLE,
            transport: TransportLimits::default(),
            quality: QualityLimits::default(),
            model: ModelLimits::default(),
            filter: FilterSettings::default(),
            configured: Prior { mu: 0.85, sigma: 0.25 },
        }
    }
}

/// Limits of the gate on the network's own doubt; set on validation pictures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelLimits {
    /// Largest p of the least likely state: on a road some state is out of the question, before a bad picture none is.
    pub most_least_probability: f64,
    /// Largest energy, -ln sum exp z.
    pub most_energy: f64,
    /// Largest [`unfamiliarity`](crate::Answer::unfamiliarity).
    pub most_unfamiliarity: f64,
}

impl Default for ModelLimits {
    fn default() -> Self {
        Self { most_least_probability: 0.09, most_energy: -1.7, most_unfamiliarity: 1.4 }
    }
}
