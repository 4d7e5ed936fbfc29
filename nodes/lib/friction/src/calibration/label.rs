//! What a drive's tires say of the floor.

/// Spread of one axle's peak friction about that of the car, as a share of it: unlike loads and combined slip take 5 to 20 % of an axle's.
const AXLE_SHARE: f64 = 0.043;
/// Standard normal quantile of a 90 % interval.
const Z90: f64 = 1.645;

/// The peak friction that this car's tires reach on a floor: D of its axles. It is what the prior is used for, so what is learned is what is told, whatever
/// share of the road's friction an axle reaches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FloorFriction {
    /// Best estimate.
    pub mu: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// A floor's friction by the axles' peaks, each (value, low, high) of a 90 % interval: those that were reached and rest on no prior; one is enough. None
/// without one.
#[must_use]
pub fn floor_friction(peaks: &[[f64; 3]]) -> Option<FloorFriction> {
    let known =
        peaks.iter().filter(|p| p.iter().all(|x| x.is_finite()) && p[0] > 0.0 && p[1] <= p[2]).map(|p| {
            let variance = ((p[2] - p[1]) / (2.0 * Z90)).powi(2) + (AXLE_SHARE * p[0]).powi(2);
            (p[0], 1.0 / variance)
        });
    let known: Vec<(f64, f64)> = known.collect();
    let weight: f64 = known.iter().map(|(_, w)| w).sum();
    if known.is_empty() {
        return None;
    }
    let mu = known.iter().map(|(d, w)| w * d).sum::<f64>() / weight;
    // Axles further apart than both allow for: one of the intervals is wrong, and nobody knows which.
    let apart: f64 = known.iter().map(|(d, w)| w * (d - mu).powi(2)).sum();
    let degrees = known.len().saturating_sub(1).max(1) as f64;
    Some(FloorFriction { mu, sigma: ((apart / degrees).max(1.0) / weight).sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn the_label_is_what_the_axles_reach_the_surer_one_first() {
        let one = floor_friction(&[[0.70, 0.68, 0.72]]).unwrap();
        assert_relative_eq!(one.mu, 0.70, epsilon = 1e-12);
        assert!(one.sigma > 0.03 && one.sigma < 0.04, "{one:?}");
        let both = floor_friction(&[[0.70, 0.68, 0.72], [0.78, 0.58, 0.98]]).unwrap();
        assert!(both.mu > 0.70 && both.mu < 0.73 && both.sigma < one.sigma, "{both:?}");
        let apart = floor_friction(&[[0.60, 0.59, 0.61], [0.80, 0.79, 0.81]]).unwrap();
        assert!(apart.sigma > 0.08, "{apart:?}");
        assert_eq!(floor_friction(&[]), None);
        assert_eq!(floor_friction(&[[0.7, f64::NAN, 0.8]]), None);
    }
}
