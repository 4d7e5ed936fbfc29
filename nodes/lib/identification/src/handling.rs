//! What a drive tells of the car's handling: understeer gradient and handling diagram.
//!
//! ```text
//! steer above Ackermann's   delta - L/R = alpha_front(a_y) - alpha_rear(a_y)
//! understeer gradient       that over a_y, up to half of the force shown
//! ```
//!
//! In a steady turn the steering angle and the curve driven give the difference of both axles' slips, whatever v_y is. Its interval takes the errors of both
//! curves for independent. By their joint covariance it is half as wide, and too narrow: what a single-track model does not have (compliance, roll steer,
//! load that moves as the car brakes and accelerates in its corners) is not the same at both axles. Of the reference car's drives in
//! `tests/results/identification/signals.md`, whose true gradient is that of a steady turn of the plant, 61 of 64 lie within it without v_y; of others' plants
//! (`plants.md`) all. A regression of steering less curve on the lateral acceleration, without a tire, gives the same value, since cars on tracks
//! turn while they brake or accelerate, with an interval that is too narrow on the 1:10 car. (Pacejka, Tire and Vehicle Dynamics, 3rd edition,
//! 1.3.1; ISO 4138.)

use gripsight_vehicle::{GRAVITY_MPS2, MagicFormula, PacejkaParameters};
use nalgebra::DVector;
use serde::Serialize;

use crate::{Estimate, Identification};

/// Up to this share of the force shown the gradient is taken: tires are nearly linear there.
const LINEAR_SHARE: f64 = 0.5;
/// Up to this share the diagram is drawn: beyond, a little more force takes any slip.
const DRAWN_SHARE: f64 = 0.95;
/// Points of the diagram.
const POINTS: usize = 19;
/// No tire is asked for more slip.
const MOST_SLIP_RAD: f64 = 1.0;

/// The car's handling, as far as it was driven.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Handling {
    /// Steering angle beyond Ackermann's over lateral acceleration, rad per m/s2: positive for understeer. Ends are NaN where nothing tells.
    pub understeer_gradient_rad_per_mps2: Estimate,
    /// Mean from zero up to this lateral acceleration.
    pub up_to_a_y_mps2: f64,
    /// Over the lateral accelerations driven.
    pub diagram: Vec<HandlingPoint>,
}

/// A point of the handling diagram.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HandlingPoint {
    /// Lateral acceleration.
    pub a_y_mps2: f64,
    /// Steering angle at the road wheels beyond L/R.
    pub steering_rad: Estimate,
}

impl Handling {
    /// Of a drive that was not fitted.
    pub(crate) fn unknown() -> Self {
        let nothing = Estimate::from_error(f64::NAN, None);
        Self { understeer_gradient_rad_per_mps2: nothing, up_to_a_y_mps2: f64::NAN, diagram: Vec::new() }
    }

    /// Of the tires that a run has found.
    pub(crate) fn of(run: &Identification, found: &PacejkaParameters) -> Self {
        let shown = run.direct.peak.front.height.min(run.direct.peak.rear.height);
        let at = |force: f64| difference(run, found, force);
        let a_y = |force: f64| force * GRAVITY_MPS2;
        let linear = LINEAR_SHARE * shown;
        let per_mps2 = |e: Estimate| Estimate {
            value: e.value / a_y(linear),
            low: e.low / a_y(linear),
            high: e.high / a_y(linear),
        };
        let diagram = (1..=POINTS)
            .map(|k| DRAWN_SHARE * shown * k as f64 / POINTS as f64)
            .map(|force| HandlingPoint { a_y_mps2: a_y(force), steering_rad: at(force) })
            .collect();
        Self { understeer_gradient_rad_per_mps2: per_mps2(at(linear)), up_to_a_y_mps2: a_y(linear), diagram }
    }
}

/// Difference of the slips, front less rear, at which both axles carry `force` times their load: with the covariances of both curves, with what gain and lever
/// arm would change that were not freed, and with how far the curves found lie off the direct fit's.
fn difference(run: &Identification, found: &PacejkaParameters, force: f64) -> Estimate {
    let fit = &run.direct.fit;
    let at: [f64; 8] = std::array::from_fn(|j| fit.parameters[j]);
    let moved: [f64; 8] = std::array::from_fn(|j| at[j] + run.direct.shift[j]);
    let value = understeer_rad(found, force);
    let fitted = of(&at, force);
    let gradient = |offset: usize| {
        DVector::from_fn(4, |k, _| {
            let j = offset + k;
            let h = 1e-5 * at[j].abs().max(1e-2);
            let step = |by: f64| of(&std::array::from_fn(|i| if i == j { at[i] + by } else { at[i] }), force);
            (step(h) - step(-h)) / (2.0 * h)
        })
    };
    let variance = |offset: usize| {
        let gradient = gradient(offset);
        run.direct.covariance_of_axle(offset).map(|c| (gradient.transpose() * c * &gradient)[(0, 0)].max(0.0))
    };
    let error = variance(0).zip(variance(4)).map(|(front, rear)| (front + rear).sqrt());
    let beside = understeer_rad(&run.direct.tires, force);
    let half = error.map_or(f64::NAN, |e| (Estimate::Z90 * e).hypot(of(&moved, force) - fitted))
        + (value - beside).abs();
    Estimate { value, low: value - half, high: value + half }
}

/// The same of tires whose parameters are (k, C, D, E) of the front, then of the rear axle.
fn of(parameters: &[f64; 8], force: f64) -> f64 {
    let axle = |o: usize| {
        let [k, c, d, e] = [parameters[o], parameters[o + 1], parameters[o + 2], parameters[o + 3]];
        MagicFormula::from_stiffness(k.max(1e-3), c, d.max(1e-3), e)
    };
    understeer_rad(&PacejkaParameters { front: axle(0), rear: axle(4) }, force)
}

/// Front less rear slip at which both axles carry `force` times their load.
#[must_use]
pub fn understeer_rad(tires: &PacejkaParameters, force: f64) -> f64 {
    slip_rad(&tires.front, force) - slip_rad(&tires.rear, force)
}

/// The first slip at which a tire gives a force; NaN where it never does.
fn slip_rad(axle: &MagicFormula, force: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1e-3);
    while axle.normalized_force(high) < force {
        if high > MOST_SLIP_RAD {
            return f64::NAN;
        }
        (low, high) = (high, 1.2 * high);
    }
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if axle.normalized_force(middle) < force { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_tires_understeer_by_the_difference_of_their_compliances() {
        let tires = PacejkaParameters {
            front: MagicFormula::from_stiffness(6.0, 1.4, 1.0, 0.0),
            rear: MagicFormula::from_stiffness(9.0, 1.4, 1.0, 0.0),
        };
        approx::assert_abs_diff_eq!(understeer_rad(&tires, 0.01), 0.01 / 6.0 - 0.01 / 9.0, epsilon = 1e-6);
        // Towards the peak the softer front takes ever more slip.
        assert!(understeer_rad(&tires, 0.8) > 80.0 * understeer_rad(&tires, 0.01));
        assert!(understeer_rad(&tires, 1.1).is_nan());
    }
}
