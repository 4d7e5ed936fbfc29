//! The curve of an axle over the slips driven, and how well it is known.

use gripsight_vehicle::MagicFormula;

use crate::direct::force_error;
use crate::{Estimate, Identification};

/// Points of a band.
const POINTS: usize = 50;

/// F_y/F_z over slip, with the half-width of its 90 % interval.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Band {
    /// From the first step to the largest slip driven.
    pub(crate) slip_rad: Vec<f64>,
    pub(crate) force: Vec<f64>,
    pub(crate) half: Vec<f64>,
}

impl Band {
    /// Of an axle found, with the direct fit's beside it; `offset` is the place of its first parameter.
    pub(crate) fn new(
        run: &Identification,
        axle: &MagicFormula,
        direct: &MagicFormula,
        offset: usize,
    ) -> Self {
        let slips = if offset == 0 { &run.direct.slips.front } else { &run.direct.slips.rear };
        let furthest = slips.furthest_rad();
        let slip_rad: Vec<f64> = (1..=POINTS).map(|k| furthest * k as f64 / POINTS as f64).collect();
        let half = half_width(run, axle, direct, offset, &slip_rad);
        let force = slip_rad.iter().map(|&slip| axle.normalized_force(slip)).collect();
        Self { slip_rad, force, half }
    }

    pub(crate) fn furthest_rad(&self) -> f64 {
        self.slip_rad.last().copied().unwrap_or(f64::NAN)
    }

    /// Largest force over the lower end of its interval; infinite where that is not positive.
    pub(crate) fn factor(&self) -> f64 {
        self.factors().fold(1.0, f64::max)
    }

    /// Force over the lower end of its interval at every slip; infinite where that is not positive.
    fn factors(&self) -> impl Iterator<Item = f64> {
        self.force.iter().zip(&self.half).map(|(force, half)| {
            let low = force - half;
            if low > 0.0 && low.is_finite() { force / low } else { f64::INFINITY }
        })
    }

    /// Up to the slip from which the force is known worse than to a factor; `None` where it is nowhere known better.
    pub(crate) fn known(&self, within: f64) -> Option<Self> {
        let points = self.factors().take_while(|&factor| factor <= within).count();
        let part = |values: &[f64]| values[..points].to_vec();
        (points > 0).then(|| Self {
            slip_rad: part(&self.slip_rad),
            force: part(&self.force),
            half: part(&self.half),
        })
    }

    /// The force that was shown: what lies below it by more than a share of the largest force is not certain.
    pub(crate) fn shown(&self, tolerance: f64) -> Vec<f64> {
        let spared = tolerance * super::highest(&self.force);
        self.force.iter().zip(&self.half).map(|(force, half)| force - (half - spared).max(0.0)).collect()
    }
}

/// Half-widths of the 90 % interval of F_y/F_z at some slips: the joint covariance of the curve's parameters, what gain and lever arm would
/// change that stayed at their nominal values or might have been freed in vain, and how far the curve lies off the direct fit's.
pub(crate) fn half_width(
    run: &Identification,
    axle: &MagicFormula,
    direct: &MagicFormula,
    offset: usize,
    slip_rad: &[f64],
) -> Vec<f64> {
    let fit = &run.direct.fit;
    let covariance = run.direct.covariance_of_axle(offset);
    let at: [f64; 4] = std::array::from_fn(|j| fit.parameters[offset + j]);
    let moved: [f64; 4] = std::array::from_fn(|j| at[j] + run.direct.shift[offset + j]);
    let curve = |v: [f64; 4]| MagicFormula::from_stiffness(v[0].max(0.0), v[1], v[2].max(1e-3), v[3]);
    let (fitted, moved) = (curve(at), curve(moved));
    let force = |axle: &MagicFormula, slip: f64| axle.normalized_force(slip);
    slip_rad
        .iter()
        .map(|&slip| {
            let known = Estimate::Z90 * force_error(axle, slip, covariance.as_ref());
            let shift = force(&moved, slip) - force(&fitted, slip);
            known.hypot(shift) + (force(axle, slip) - force(direct, slip)).abs()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_band_ends_where_its_force_is_known_worse_than_to_a_factor() {
        let band = Band {
            slip_rad: vec![0.01, 0.02, 0.03, 0.04],
            force: vec![0.1, 0.2, 0.3, 0.4],
            half: vec![0.02, 0.05, 0.2, 0.05],
        };
        approx::assert_relative_eq!(band.factor(), 3.0, max_relative = 1e-12);
        // What lies beyond is not known from here on, however well it is known there.
        let known = band.known(2.0).unwrap();
        assert_eq!(known.slip_rad, [0.01, 0.02]);
        assert!(known.factor() < 2.0 && known.furthest_rad() == 0.02);
        assert_eq!(band.known(4.0), Some(band.clone()));
        assert_eq!(Band { half: vec![0.1; 4], ..band }.known(2.0), None);
    }
}
