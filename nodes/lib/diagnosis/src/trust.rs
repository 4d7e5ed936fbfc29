//! How far tires are trusted, by where they come from.

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
}
