//! The friction prior: where it has a say, and where the data contradict it.

use crate::direct::peak::PeakEvidence;
use crate::tires::{C_PRIOR, D_BOUNDS, E_PRIOR};
use crate::{FrictionPrior, PerAxle};
use gripsight_estimation::shooting::{Fit, Parameter, Prior};

/// D of an axle may lie off the road's friction by this share of it: load sensitivity and unlike wheel loads take 5 to 20 % on development draws.
const ROAD_TO_AXLE: f64 = 0.1;

/// A prior contradicts the data where it raises what the windows and the prior itself miss by more than this. Chosen on the draws 5000-5119: of 112
/// with the road's own mu one is refused for it, and of those with 0.4 more none (sigma 0.1) and two of 57 (0.2) are accepted with D off by more than 25 %.
const CONTRADICTION: f64 = 3.0;

/// How well the curve found tells a D that was not reached: spread of its logarithm. On 69 drives with priors of any error it lay off by 0.41 (mean -0.28:
/// most curves end just above the force shown), many times what the fit makes of it.
const CURVE_SPREAD: f64 = 0.5;
/// How well a force shown is known as the lower bound of D, as a share of it.
const SHOWN_SPREAD: f64 = 0.05;
/// Points of the sum over D.
const POINTS: u32 = 400;

/// Standard deviation of an axle's D about a friction prior.
fn axle_sigma(prior: FrictionPrior) -> f64 {
    prior.sigma.hypot(ROAD_TO_AXLE * prior.mu)
}

/// Mean and standard deviation of a D that was not reached: by the prior, by the curve found for what it is worth, and above the force shown.
pub(super) fn believed(prior: FrictionPrior, found: f64, shown: f64) -> Prior {
    let step = (D_BOUNDS.1 - D_BOUNDS.0) / f64::from(POINTS);
    let curve = found.max(shown).ln();
    let [mut sum, mut first, mut second] = [0.0; 3];
    for k in 0..=POINTS {
        let d = D_BOUNDS.0 + f64::from(k) * step;
        let below = ((shown - d) / (SHOWN_SPREAD * shown)).max(0.0);
        let away =
            [(d - prior.mu) / axle_sigma(prior), (d.ln() - curve) / CURVE_SPREAD, below].map(|z| z * z);
        let weight = (-0.5 * away.iter().sum::<f64>()).exp();
        (sum, first, second) = (sum + weight, first + weight * d, second + weight * d * d);
    }
    if sum < f64::MIN_POSITIVE {
        return Prior { mean: shown, sigma: SHOWN_SPREAD * shown };
    }
    let mean = first / sum;
    Prior { mean, sigma: (second / sum - mean * mean).max(0.0).sqrt() }
}

/// Place of D of the axles for which the prior speaks.
fn places(peak: &PerAxle<PeakEvidence>, prior: FrictionPrior) -> impl Iterator<Item = usize> {
    axles(peak, prior).map(|(place, _)| place)
}

fn axles(peak: &PerAxle<PeakEvidence>, prior: FrictionPrior) -> impl Iterator<Item = (usize, PeakEvidence)> {
    [(2, peak.front), (6, peak.rear)].into_iter().filter(move |(_, axle)| axle.is_the_priors(prior))
}

/// The parameters of fits that go on from `found` with the prior as a soft bound on D where the data do not show it: with the curve found, and
/// with D at the prior and the likely shape. Either may end in a hollow that the other does not see.
pub(super) fn with_prior(
    all: &[Parameter],
    found: &Fit,
    peak: &PerAxle<PeakEvidence>,
    prior: FrictionPrior,
) -> [Vec<Parameter>; 2] {
    let mut held = going_on(all, found);
    for d in places(peak, prior) {
        held[d].prior = Some(Prior { mean: prior.mu, sigma: axle_sigma(prior) });
    }
    let mut likely = held.clone();
    for d in places(peak, prior) {
        likely[d].start = prior.mu;
    }
    likely_shape(&mut likely, peak, prior);
    [held, likely]
}

/// The parameters of fits that find the curves for the D that is believed in: the data bend them below it, and move it only by what they are worth.
pub(super) fn with_believed(
    all: &[Parameter],
    found: &Fit,
    peak: &PerAxle<PeakEvidence>,
    prior: FrictionPrior,
) -> [Vec<Parameter>; 2] {
    let mut held = going_on(all, found);
    for (d, axle) in axles(peak, prior) {
        held[d].start = believed(prior, found.parameters[d], axle.height).mean;
        (held[d].free, held[d].prior) = (false, None);
    }
    let mut likely = held.clone();
    likely_shape(&mut likely, peak, prior);
    [held, likely]
}

/// The parameters of a fit that begins where another one ended.
fn going_on(all: &[Parameter], found: &Fit) -> Vec<Parameter> {
    all.iter().zip(&found.parameters).map(|(p, &start)| Parameter { start, ..*p }).collect()
}

fn likely_shape(all: &mut [Parameter], peak: &PerAxle<PeakEvidence>, prior: FrictionPrior) {
    for d in places(peak, prior) {
        (all[d - 1].start, all[d + 1].start) = (C_PRIOR.mean, E_PRIOR.mean);
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_force_shown_is_a_lower_bound_and_a_curve_found_says_little_beyond_it() {
        let prior = |mu, sigma| FrictionPrior { mu, sigma };
        // The curve ends just above the force shown, as most do: the prior stands.
        let right = believed(prior(0.8, 0.1), 0.42, 0.40);
        assert!((right.mean - 0.8).abs() < 0.08 && right.sigma < 0.13, "{right:?}");
        // A prior below what was shown gives way to it.
        let low = believed(prior(0.4, 0.1), 0.62, 0.60);
        assert!(low.mean > 0.57 && low.mean < 0.66, "{low:?}");
        // A vague prior leaves the word to both.
        let vague = believed(prior(0.8, 2.0), 0.6, 0.5);
        assert!(vague.mean > 0.6 && vague.sigma > 0.2, "{vague:?}");
        let absurd = believed(prior(0.05, 0.001), 0.9, 0.9);
        assert!(absurd.mean.is_finite() && absurd.sigma > 0.0, "{absurd:?}");
    }
}
