//! What other tires come to: the force of either axle at a slip that both drives reach.

use gripsight_estimation::Windows;
use gripsight_model::{TIRES, quantile};
use gripsight_vehicle::{Dual, OwnTires, Real};
use nalgebra::{DMatrix, DVector};

use crate::decisions::SHARED_ERROR;
use crate::engine::Engine;
use crate::sizes::NINETY;

/// Share of the samples that have less slip than the forces are compared at.
const REACHED: f64 = 0.95;
/// Parameters of the tires in the earlier drive, and what they differ by.
const BOTH: usize = 2 * TIRES;

/// Slip angles of front and rear axle that a drive reaches in a twentieth of its time.
pub(crate) fn reached_slip_rad(engine: &Engine<'_>, windows: &Windows) -> [f64; 2] {
    let mut slips = [Vec::new(), Vec::new()];
    for w in &windows.windows {
        let run = &engine.recording.runs[w.segment];
        for k in w.from..w.from + w.len {
            let at = engine.slip_rad(run, k);
            slips.iter_mut().zip(at).for_each(|(axle, slip_rad)| axle.push(slip_rad.abs()));
        }
    }
    slips.map(|axle| quantile(axle, REACHED))
}

/// What an axle's tires push with in two drives, F_y/F_z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ForceChange {
    /// Slip angle at which they do.
    pub(crate) slip_rad: f64,
    /// In the earlier drive.
    pub(crate) before: f64,
    /// In the later one, less that.
    pub(crate) by: f64,
    /// Half the width of its 90 % interval.
    pub(crate) half_width: f64,
}

impl ForceChange {
    /// Front and rear axle. `size`: the share of grip that matters; `before`, `by`: parameters of the tires and what they differ by, as fits have them; `covariance`: of both.
    pub(crate) fn of_axles(
        size: f64,
        [before, by]: [&[f64]; 2],
        covariance: &DMatrix<f64>,
        slip_rad: [f64; 2],
    ) -> [Self; 2] {
        let variable = |values: &[f64], from: usize| -> Vec<Dual<BOTH>> {
            values.iter().enumerate().map(|(i, v)| Dual::variable(*v, from + i)).collect()
        };
        let (before, by) = (variable(before, 0), variable(by, TIRES));
        let after: Vec<Dual<BOTH>> = before.iter().zip(&by).map(|(b, d)| *b + *d).collect();
        let tires = [before, after].map(|p| OwnTires::from_parameters(&p));
        [0, 1].map(|axle| {
            let [before, after] = tires.map(|of| {
                let formula = if axle == 0 { of.front } else { of.rear };
                formula.normalized_force(Dual::from(slip_rad[axle]))
            });
            let by = after - before;
            let gradient = DVector::from_row_slice(by.derivatives());
            let sigma = gradient.dot(&(covariance * &gradient)).max(0.0).sqrt();
            let (before, by) = (before.re(), by.re());
            let shared = SHARED_ERROR * by.hypot(size * before);
            Self { slip_rad: slip_rad[axle], before, by, half_width: NINETY * sigma.hypot(shared) }
        })
    }

    /// How many half widths of its interval the difference is away from nothing.
    pub(crate) fn told(&self) -> f64 {
        self.by.abs() / self.half_width
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axle_pushes_with_less_by_what_its_curve_does_there() {
        let before = [9.0, 1.4, 0.9, 0.0, 10.0, 1.3, 0.95, -0.2];
        let by = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.1, 0.0];
        let slip_rad = [0.05, 0.1];
        let of = |by: &[f64]| {
            let p: Vec<f64> = before.iter().zip(by).map(|(b, d)| b + d).collect();
            OwnTires::from_parameters(&p).rear.normalized_force(slip_rad[1])
        };
        let sigma = 0.02;
        let mut covariance = DMatrix::zeros(BOTH, BOTH);
        // The rear axle's D differs by so much more or less.
        covariance[(TIRES + 6, TIRES + 6)] = sigma * sigma;
        let [front, rear] = ForceChange::of_axles(0.1, [&before, &by], &covariance, slip_rad);
        approx::assert_relative_eq!(rear.before, of(&[0.0; 8]), epsilon = 1e-12);
        approx::assert_relative_eq!(rear.by, of(&by) - of(&[0.0; 8]), epsilon = 1e-12);
        let more: Vec<f64> = (0..TIRES).map(|i| if i == 6 { by[i] + 1e-6 } else { by[i] }).collect();
        let slope = (of(&more) - of(&by)) / 1e-6;
        let shared = SHARED_ERROR * rear.by.hypot(0.1 * rear.before);
        approx::assert_relative_eq!(rear.half_width, NINETY * (slope * sigma).hypot(shared), epsilon = 1e-6);
        assert_eq!(front.by, 0.0);
        assert!(rear.told() > 1.0 && front.told() == 0.0, "{rear:?}");
    }
}
