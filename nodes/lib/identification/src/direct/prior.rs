//! The friction prior: where it has a say, and where the data contradict it.

use crate::direct::peak::PeakEvidence;
use crate::tires::{C_PRIOR, E_PRIOR};
use crate::{FrictionPrior, PerAxle};
use gripsight_estimation::shooting::{Fit, Parameter, Prior};

/// D of an axle may lie off the road's friction by this share of it: load sensitivity and unlike wheel loads take 5 to 20 % on development draws.
const ROAD_TO_AXLE: f64 = 0.1;

/// A prior contradicts the data where it raises what the windows and the prior itself miss by more than this. Chosen on the draws 5000-5119: of 112
/// with the road's own mu one is refused for it, and of those with 0.4 more none (sigma 0.1) and two of 57 (0.2) are accepted with D off by more than 25 %.
const CONTRADICTION: f64 = 3.0;

/// Standard deviation of an axle's D about a friction prior.
pub(crate) fn axle_sigma(prior: FrictionPrior) -> f64 {
    prior.sigma.hypot(ROAD_TO_AXLE * prior.mu)
}

/// Place of D of the axles for which the prior speaks.
fn places(peak: &PerAxle<PeakEvidence>, prior: FrictionPrior) -> impl Iterator<Item = usize> {
    [(2, peak.front), (6, peak.rear)]
        .into_iter()
        .filter(move |(_, axle)| axle.is_the_priors(prior))
        .map(|(place, _)| place)
}

/// The parameters of fits that go on from `found` with the prior as a soft bound on D where the data do not show it: with the curve found, and
/// with D at the prior and the likely shape. Either may end in a hollow that the other does not see.
pub(super) fn with_prior(
    all: &[Parameter],
    found: &Fit,
    peak: &PerAxle<PeakEvidence>,
    prior: FrictionPrior,
) -> [Vec<Parameter>; 2] {
    let mut held = all.to_vec();
    held.iter_mut().zip(&found.parameters).for_each(|(p, &v)| p.start = v);
    for d in places(peak, prior) {
        held[d].prior = Some(Prior { mean: prior.mu, sigma: axle_sigma(prior) });
    }
    let mut likely = held.clone();
    for d in places(peak, prior) {
        likely[d].start = prior.mu;
        (likely[d - 1].start, likely[d + 1].start) = (C_PRIOR.mean, E_PRIOR.mean);
    }
    [held, likely]
}

/// Whether the fit with the prior is so much worse than the one without that one of prior and data is wrong. Only where the slips are such that a tire
/// bends at all. A force shown is a lower bound: that the prior lies near it says nothing for the prior.
pub(super) fn contradicts(
    prior: FrictionPrior,
    peak: &PerAxle<PeakEvidence>,
    without: &Fit,
    with: &Fit,
) -> bool {
    let windows = |fit: &Fit| fit.linearization.window_costs.iter().sum::<f64>();
    let away: f64 =
        places(peak, prior).map(|d| ((with.parameters[d] - prior.mu) / axle_sigma(prior)).powi(2)).sum();
    let axles = [peak.front, peak.rear];
    let bends = axles.iter().any(|axle| !axle.reached && axle.may_bend);
    bends && windows(with) - windows(without) + away > CONTRADICTION
}
