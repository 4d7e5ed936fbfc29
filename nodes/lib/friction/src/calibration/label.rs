//! What a drive's tires say of the road's friction.

/// The axles' peak friction lies 5 to 20 % below the road's: neither of an axle's tires is at its peak when the other is, and both are loaded unevenly.
const AXLE_OVER_ROAD: f64 = 0.875;
/// Spread of that share.
const SHARE_SIGMA: f64 = 0.043;
/// Standard normal quantile of a 90 % interval.
const Z90: f64 = 1.645;

/// A road's peak friction coefficient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoadFriction {
    /// Best estimate.
    pub mu: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// The road's friction by the axles' peaks, each (value, low, high) of a 90 % interval: those that were reached and rest on no prior. None without one.
#[must_use]
pub fn road_friction(peaks: &[[f64; 3]]) -> Option<RoadFriction> {
    let known: Vec<&[f64; 3]> =
        peaks.iter().filter(|p| p.iter().all(|x| x.is_finite()) && p[0] > 0.0 && p[1] <= p[2]).collect();
    let count = known.len() as f64;
    if known.is_empty() {
        return None;
    }
    let mean = known.iter().map(|p| p[0]).sum::<f64>() / count;
    let interval = known.iter().map(|p| (p[2] - p[1]) / (2.0 * Z90)).sum::<f64>() / count;
    let apart = known.iter().map(|p| (p[0] - mean).abs()).fold(0.0, f64::max);
    let mu = mean / AXLE_OVER_ROAD;
    Some(RoadFriction { mu, sigma: (interval.hypot(apart) / AXLE_OVER_ROAD).hypot(SHARE_SIGMA * mu) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn a_road_grips_more_than_its_axles_show() {
        let got = road_friction(&[[0.70, 0.68, 0.72], [0.70, 0.66, 0.74]]).unwrap();
        assert_relative_eq!(got.mu, 0.8, epsilon = 1e-12);
        assert!(got.sigma > 0.03 && got.sigma < 0.06);
        let apart = road_friction(&[[0.60, 0.59, 0.61], [0.80, 0.79, 0.81]]).unwrap();
        assert!(apart.sigma > 0.1, "{apart:?}");
        assert_eq!(road_friction(&[]), None);
        assert_eq!(road_friction(&[[0.7, f64::NAN, 0.8]]), None);
    }
}
