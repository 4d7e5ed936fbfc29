//! The car's own tires: those of the model with load transfer, combined slip and relaxation.

use serde::{Deserialize, Serialize};

use crate::{MagicFormula, PacejkaParameters, Real};

/// Parameters of both axles' tires.
pub const OWN_TIRE_PARAMETERS: usize = 8;

/// The tires of the car *with* its load transfer, combined slip and relaxation. They are not Phi_p ([`PacejkaParameters`]), the effective tires of a bare
/// single-track model, which take all this on themselves; `gripsight_model::effective_tires` projects these on those.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OwnTires<T = f64> {
    /// Front axle.
    pub front: MagicFormula<T>,
    /// Rear axle.
    pub rear: MagicFormula<T>,
}

impl<T: Real> OwnTires<T> {
    /// From the parameters of a fit: cornering stiffness over load (B C D, 1/rad), C, D, E; front, then rear.
    ///
    /// # Panics
    /// Where there are fewer than [`OWN_TIRE_PARAMETERS`].
    #[must_use]
    pub fn from_parameters(p: &[T]) -> Self {
        let axle = |p: &[T]| MagicFormula { b: p[0] / (p[1] * p[2]), c: p[1], d: p[2], e: p[3] };
        Self { front: axle(&p[..4]), rear: axle(&p[4..]) }
    }
}

impl OwnTires {
    /// The inverse of [`Self::from_parameters`].
    #[must_use]
    pub fn to_parameters(&self) -> [f64; OWN_TIRE_PARAMETERS] {
        let axle = |t: &MagicFormula| [t.normalized_stiffness(), t.c, t.d, t.e];
        let (f, r) = (axle(&self.front), axle(&self.rear));
        [f[0], f[1], f[2], f[3], r[0], r[1], r[2], r[3]]
    }

    /// Effective tires in the place of own ones, where nothing else is known: near them, softer by what load transfer and the like take.
    #[must_use]
    pub fn assumed(effective: &PacejkaParameters) -> Self {
        Self { front: effective.front, rear: effective.rear }
    }

    /// In the place of effective tires, where nothing else is known; the other way round than [`Self::assumed`].
    #[must_use]
    pub fn assumed_effective(&self) -> PacejkaParameters {
        PacejkaParameters { front: self.front, rear: self.rear }
    }

    /// Whether all parameters are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.front.is_finite() && self.rear.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parameters_of_a_fit_are_the_same_tires() {
        let fitted = [9.0, 1.5, 0.9, -0.5, 8.0, 1.4, 0.8, 0.2];
        let tires = OwnTires::from_parameters(&fitted);
        approx::assert_relative_eq!(tires.front.b, 9.0 / (1.5 * 0.9), max_relative = 1e-12);
        for (again, value) in tires.to_parameters().iter().zip(fitted) {
            approx::assert_relative_eq!(*again, value, max_relative = 1e-12);
        }
    }
}
