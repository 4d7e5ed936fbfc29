//! How far tires are trusted, by where they come from.

use gripsight_model::TIRES;

/// How far the tires handed over are trusted, as one standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TireTrust {
    /// Of the cornering stiffness, relative.
    pub stiffness: f64,
    /// Of the peak D, relative.
    pub peak: f64,
    /// Of C, absolute.
    pub shape: f64,
    /// Of E, absolute.
    pub curvature: f64,
}

impl TireTrust {
    /// Tires from a file: a few percent.
    #[must_use]
    pub fn file() -> Self {
        Self { stiffness: 0.05, peak: 0.05, shape: 0.1, curvature: 0.5 }
    }

    /// Tires from a drive of the same car that was fitted in the same way.
    #[must_use]
    pub fn drive() -> Self {
        Self { stiffness: 0.02, peak: 0.02, shape: 0.05, curvature: 0.25 }
    }

    /// No tires given: only what makes the fit well posed.
    #[must_use]
    pub fn free() -> Self {
        Self { stiffness: 1.0, peak: 0.4, shape: 0.15, curvature: 0.6 }
    }

    /// Whether the peak is known, so that another one is told from it.
    pub(crate) fn knows_the_peak(&self) -> bool {
        self.peak < Self::free().peak
    }

    /// The standard deviation of every parameter (B C D, C, D, E of front and rear) around its mean, and whether it is known any better than without tires.
    pub(crate) fn sigmas(&self, mean: &[f64; TIRES]) -> [(f64, bool); TIRES] {
        let free = Self::free();
        std::array::from_fn(|j| {
            let (own, unknown, unit) = match j % 4 {
                0 => (self.stiffness, free.stiffness, mean[j]),
                1 => (self.shape, free.shape, 1.0),
                2 => (self.peak, free.peak, mean[j]),
                _ => (self.curvature, free.curvature, 1.0),
            };
            (own * unit, own < unknown)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_is_told_parameter_by_parameter() {
        let mean = [10.0, 1.4, 0.9, 0.1, 20.0, 1.5, 0.8, 0.2];
        let stiffness_alone = TireTrust { stiffness: 0.05, ..TireTrust::free() };
        let sigmas = stiffness_alone.sigmas(&mean);
        approx::assert_relative_eq!(sigmas[4].0, 1.0);
        approx::assert_relative_eq!(sigmas[2].0, 0.36);
        assert_eq!(sigmas.map(|(_, known)| known), [true, false, false, false, true, false, false, false]);
        assert!(!stiffness_alone.knows_the_peak() && TireTrust::file().knows_the_peak());
    }
}
