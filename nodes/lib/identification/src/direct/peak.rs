//! Whether an axle's peak shows in the data.

use gripsight_vehicle::MagicFormula;
use nalgebra::{DMatrix, DVector};

use crate::direct::{Slips, covariance_of};
use crate::rollout::tires_of;
use crate::tires::{C_PRIOR, D_BOUNDS, E_PRIOR};
use crate::{Estimate, FrictionPrior};
use gripsight_estimation::shooting::Fit;

/// Whether an axle's peak shows in the data, and how well it is known then.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PeakEvidence {
    pub(crate) reached: bool,
    /// How far D's 90 % interval reaches below and above it.
    pub(crate) below: f64,
    pub(crate) above: f64,
    /// Largest F_y/F_z within the slips visited.
    pub(crate) height: f64,
    /// Whether the slips visited are such that a tire bends at all.
    pub(crate) may_bend: bool,
    /// Whether the data fit much worse with the friction prior's D than without.
    pub(crate) contradicts_prior: bool,
}

impl PeakEvidence {
    /// Whether D is the friction prior's: the data do not show the peak, and the prior is neither further below what they do show than its sigma
    /// nor against them.
    pub(crate) fn is_the_priors(&self, prior: FrictionPrior) -> bool {
        !self.reached && !self.contradicts_prior && prior.mu + prior.sigma >= self.height
    }
}

/// A tire is beyond its knee where its stiffness alone would give this many times the force that it gives at the largest slip driven,
const KNEE: f64 = 1.9;
/// and its peak is reached where the force over the last third of the slips driven rises by less than this power of the slip: both are what tires give at 95 %
/// of their peak. Brush tires: 1.99 and 0.41 with parabolic pressure, 1.95 and 0.31 with elliptic; Magic Formulas without E: 2.5 and 0.21 (C 1.1),
/// 1.97 and 0.31 (1.3), 1.68 and 0.41 (1.6).
const RISE: f64 = 0.4;
/// Where that last third begins.
const LAST_THIRD: f64 = 2.0 / 3.0;
/// Half of the 90 % interval of D that the shape of a four-parameter curve costs, as a share of D: real curves have another shape.
const FORM: f64 = 0.05;
/// C of a curve that is one sigma flatter than the likely one: what the peak would be if the tire went on rising where it was not driven.
const FLATTER_C: f64 = C_PRIOR.mean - C_PRIOR.sigma;
/// No tire slides at less: a knee that comes earlier is made by the signals.
const LEAST_PEAK_SLIP_RAD: f64 = 0.05;

/// Whether an axle's peak shows. What is uncertain of D: the height of the curve where it was driven, as far as the data tell; the curve's form;
/// below it all that D lies above that height, above it all that a flatter curve through the same height would rise to.
pub(super) fn evidence(fit: &Fit, offset: usize, slips: &Slips) -> PeakEvidence {
    let tires = tires_of(&fit.parameters);
    let axle = if offset == 0 { tires.front } else { tires.rear };
    let furthest = slips.furthest_rad();
    let height = axle.max_force_within(furthest);
    // Of a plateau D alone says little: there C and D make up for each other. Its height, and whether it rises, are well known.
    let covariance = covariance_of(fit, &[offset, offset + 1, offset + 2, offset + 3]);
    let error = |figure: &dyn Fn(&MagicFormula) -> f64| error_of(&axle, covariance.as_ref(), figure);
    let known = (Estimate::Z90 * error(&|axle| axle.max_force_within(furthest))).hypot(FORM * axle.d);
    let below = known.hypot(axle.d - height);
    let above = known.hypot((flatter_peak(&axle, furthest, height) - axle.d).max(0.0));
    let may_bend = furthest > LEAST_PEAK_SLIP_RAD;
    let rise = |axle: &MagicFormula| {
        let forces = [furthest, LAST_THIRD * furthest].map(|slip| axle.normalized_force(slip));
        (forces[0] / forces[1]).ln() / LAST_THIRD.recip().ln()
    };
    let reached = may_bend
        && axle.normalized_stiffness() * furthest > KNEE * height
        && rise(&axle) + error(&rise) < RISE
        && !fit.on_bound.contains(&(offset + 2));
    PeakEvidence { reached, below, above, height, may_bend, contradicts_prior: false }
}

/// D of the flatter curve with the same stiffness and, at the largest slip driven, the same force.
fn flatter_peak(axle: &MagicFormula, furthest_rad: f64, height: f64) -> f64 {
    let curve =
        |d: f64| MagicFormula::from_stiffness(axle.normalized_stiffness(), FLATTER_C, d, E_PRIOR.mean);
    let (mut low, mut high) = (height, D_BOUNDS.1.max(height));
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if curve(middle).max_force_within(furthest_rad) < height { low = middle } else { high = middle }
    }
    high
}

/// Standard error of F_y/F_z at a slip, from the covariance of (k, C, D, E); infinite without one.
pub(crate) fn force_error(axle: &MagicFormula, slip_rad: f64, covariance: Option<&DMatrix<f64>>) -> f64 {
    error_of(axle, covariance, |axle| axle.normalized_force(slip_rad))
}

/// Standard error of a figure of a tire, from the covariance of (k, C, D, E); infinite without one.
fn error_of(
    axle: &MagicFormula,
    covariance: Option<&DMatrix<f64>>,
    figure: impl Fn(&MagicFormula) -> f64,
) -> f64 {
    let Some(covariance) = covariance else { return f64::INFINITY };
    let at = [axle.normalized_stiffness(), axle.c, axle.d, axle.e];
    let value = |v: [f64; 4]| figure(&MagicFormula::from_stiffness(v[0], v[1], v[2], v[3]));
    let gradient = DVector::from_fn(4, |j, _| {
        let h = 1e-5 * at[j].abs().max(1e-2);
        let moved = |by: f64| std::array::from_fn(|i| if i == j { at[i] + by } else { at[i] });
        (value(moved(h)) - value(moved(-h))) / (2.0 * h)
    });
    (gradient.transpose() * covariance * gradient)[(0, 0)].max(0.0).sqrt()
}
