//! The average of p, and of what follows from it, over the distance travelled.
//!
//! A picture counts by the new road that it shows, not by the time that passed: at a standstill p hardly moves, and after a
//! change of surface it follows within the same stretch of road at any speed.

/// Pictures at the start that are averaged with equal weights.
const PLAIN_PICTURES: u32 = 5;

/// Settings of the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilterSettings {
    /// Distance over which an old picture's weight falls to 1/e, metres.
    pub length_m: f64,
    /// Weight of a picture that shows no new road: averages the sensor's noise while the car stands.
    pub least_gain: f64,
    /// Weight of a picture while no distance is known.
    pub blind_gain: f64,
    /// Distance without a usable picture after which the average starts afresh, metres.
    pub forget_after_m: f64,
}

impl Default for FilterSettings {
    fn default() -> Self {
        Self { length_m: 2.6, least_gain: 0.02, blind_gain: 0.2, forget_after_m: 15.0 }
    }
}

/// The running average.
#[derive(Debug, Clone, Default)]
pub struct DistanceFilter {
    p: Vec<f64>,
    pictures: u32,
    last_m: Option<f64>,
    first_m: Option<f64>,
}

impl DistanceFilter {
    /// Takes in the numbers of one picture, seen after `distance_m` of travel, and returns the average.
    pub fn update(&mut self, settings: &FilterSettings, p: &[f64], distance_m: Option<f64>) -> &[f64] {
        let step_m = distance_m.zip(self.last_m).map(|(now, then)| now - then);
        let jump = step_m.is_some_and(|s| !(0.0..=settings.forget_after_m).contains(&s));
        if self.p.len() != p.len() || jump {
            (self.p, self.pictures, self.first_m) = (p.to_vec(), 0, distance_m);
        }
        let by_road = step_m.map_or(settings.blind_gain, |s| 1.0 - (-s / settings.length_m).exp());
        // The first pictures are averaged plainly: the very first deserves no more weight than the next.
        let plain = if self.pictures < PLAIN_PICTURES { 1.0 / f64::from(self.pictures + 1) } else { 0.0 };
        let gain = by_road.max(settings.least_gain).max(plain);
        for (average, new) in self.p.iter_mut().zip(p) {
            *average += gain * (new - *average);
        }
        self.pictures = self.pictures.saturating_add(1);
        self.last_m = distance_m.or(self.last_m);
        self.first_m = self.first_m.or(distance_m);
        &self.p
    }

    /// Pictures in the average.
    #[must_use]
    pub fn pictures(&self) -> u32 {
        self.pictures
    }

    /// Distance that the average spans, at most three filter lengths, metres.
    #[must_use]
    pub fn span_m(&self, settings: &FilterSettings) -> f64 {
        self.last_m.zip(self.first_m).map_or(0.0, |(l, f)| (l - f).clamp(0.0, 3.0 * settings.length_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    const DRY: [f64; 2] = [1.0, 0.0];
    const ICE: [f64; 2] = [0.0, 1.0];

    fn drive(filter: &mut DistanceFilter, p: &[f64], from_m: f64, to_m: f64, step_m: f64) -> Vec<f64> {
        let settings = FilterSettings::default();
        let n = ((to_m - from_m) / step_m).round() as usize;
        let mut out = vec![];
        for k in 1..=n {
            out = filter.update(&settings, p, Some(from_m + k as f64 * step_m)).to_vec();
        }
        out
    }

    #[test]
    fn a_change_of_road_is_followed_over_the_same_distance_at_any_speed() {
        let after = |step_m: f64| {
            let mut filter = DistanceFilter::default();
            drive(&mut filter, &DRY, 0.0, 39.0, step_m);
            drive(&mut filter, &ICE, 39.0, 39.0 + FilterSettings::default().length_m, step_m)[1]
        };
        // One filter length: 1 - 1/e.
        assert_relative_eq!(after(0.1), 1.0 - (-1.0f64).exp(), epsilon = 2e-3);
        assert_relative_eq!(after(1.3), after(0.1), epsilon = 2e-3);
    }

    #[test]
    fn a_long_gap_starts_afresh() {
        let mut filter = DistanceFilter::default();
        drive(&mut filter, &DRY, 0.0, 40.0, 0.5);
        let settings = FilterSettings::default();
        assert_eq!(filter.update(&settings, &ICE, Some(90.0)), ICE);
        assert_eq!(filter.pictures(), 1);
        // A clock or odometry that jumps back does the same.
        assert_eq!(filter.update(&settings, &DRY, Some(2.0)), DRY);
    }

    proptest! {
        #[test]
        fn the_average_stays_a_distribution(
            steps in prop::collection::vec((0.0f64..1.0, prop::option::of(-20.0f64..20.0)), 1..60),
        ) {
            let (settings, mut filter, mut m) = (FilterSettings::default(), DistanceFilter::default(), 0.0);
            for (x, step) in steps {
                let at = step.map(|s| { m += s; m });
                let p = filter.update(&settings, &[x, 1.0 - x], at);
                prop_assert!((p.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                prop_assert!(p.iter().all(|v| (0.0..=1.0).contains(v)));
            }
        }
    }
}
