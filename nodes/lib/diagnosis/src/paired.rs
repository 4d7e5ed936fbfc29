//! Two recordings of one motion, sample by sample: a bag and its copy with a signal processed anew, or one series of commands played to a car twice. What no
//! model says of the car is in both and falls out of the difference of what is left of each (a paired comparison; Student 1908, "The probable error of a
//! mean"): no matching of blocks and no contradiction stands in the way of a change.

use gripsight_estimation::Windows;
use gripsight_estimation::selection::{Quadratic, configuration};
use gripsight_model::Recording;
use nalgebra::DVector;

use crate::engine::Engine;
use crate::frame::Frame;
use crate::hypotheses::terms;
use crate::infer::{differences, repeated, starts};
use crate::joint::Joint;

/// Share of the windows that both recordings must have for them to be of one motion.
const SHARED: f64 = 0.5;
/// Share of a channel's noise to which a difference is followed at least: a model's derivatives are no better.
const LEAST_NOISE: f64 = 0.05;

/// The later of two recordings of one motion, and what the earlier one's model leaves of the earlier one.
pub(crate) struct Paired<'p, 'a> {
    frame: &'p Frame,
    engine: Engine<'a>,
    windows: Windows,
    earlier: Joint,
}

impl<'p, 'a> Paired<'p, 'a> {
    /// Nothing where the two are not of one motion.
    pub(crate) fn of(
        frame: &'p Frame,
        (before, here): (&Engine<'a>, &Windows),
        (after, there): (&Engine<'a>, &Windows),
    ) -> Option<Self> {
        let (here, windows) = shared([before.recording, after.recording], [here, there])?;
        let with_noise = |engine: &Engine<'a>| Engine { sigma: frame.sigma.clone(), ..engine.clone() };
        let (before, engine) = (with_noise(before), with_noise(after));
        let of_earlier = starts(&before, &frame.columns, &frame.values, &here);
        let earlier = Joint::around(&before, &frame.columns, &frame.values, &of_earlier, &here)?;
        Some(Self { frame, engine, windows, earlier })
    }

    /// What the later recording says of the differences from the earlier one's model, linearised around a model of its own. Effects of a place that this lacks are
    /// looked for, and their places set.
    pub(crate) fn difference(&self, values: &mut [f64]) -> Option<Difference> {
        let Frame { columns, library, .. } = self.frame;
        let own = starts(&self.engine, columns, values, &self.windows);
        let around = |values: &[f64]| {
            Some(Joint::around(&self.engine, columns, values, &own, &self.windows)?.beyond(&self.earlier))
        };
        let mut joint = around(values)?;
        differences(&self.engine, columns, values, &own, &self.windows, &mut joint);
        let terms = terms(&self.engine, columns, values, library);
        let open: Vec<usize> = terms.iter().map(|t| t.log_weights.len() - 1).collect();
        let none = vec![1.0; self.engine.sigma.len()];
        let step = configuration(&joint.weighed(&none).total, 1.0, &terms, &open)?.step;
        let scale: Vec<f64> =
            joint.left_by_channel(&step).into_iter().map(|left| left.sqrt().max(LEAST_NOISE)).collect();
        let weighed = joint.weighed(&scale);
        let dispersion = repeated(&weighed, &terms, &open)?;
        let problem = Quadratic {
            information: &weighed.total.information / dispersion,
            gradient: &weighed.total.gradient / dispersion,
        };
        Some(Difference { problem, left: weighed.cost / dispersion })
    }
}

/// What two recordings of one motion differ by, around a model of the later one.
#[derive(Debug, Clone)]
pub(crate) struct Difference {
    pub(crate) problem: Quadratic,
    /// The error that is left there, in units of what all terms together leave.
    pub(crate) left: f64,
}

impl Difference {
    /// The same around other values.
    pub(crate) fn at(self, from: &[f64], to: &[f64]) -> Self {
        let Quadratic { information, gradient } = self.problem;
        let step = DVector::from_iterator(to.len(), to.iter().zip(from).map(|(to, from)| to - from));
        let pull = &information * &step;
        let left = self.left + (2.0 * &gradient + &pull).dot(&step);
        Self { problem: Quadratic { gradient: gradient + pull, information }, left }
    }
}

/// The windows that both recordings have, where they are of one motion: a signal that changes is the same in both, sample by sample.
fn shared([a, b]: [&Recording; 2], [of_a, of_b]: [&Windows; 2]) -> Option<(Windows, Windows)> {
    let cut =
        |r: &Recording| r.runs.iter().map(|run| (run.start_time_s, run.dt_s, run.len())).collect::<Vec<_>>();
    if cut(a) != cut(b) || a.channels != b.channels {
        return None;
    }
    let mut same = (0..=a.channels.len()).map(|channel| {
        let signal = |r: &Recording, run: usize| match r.runs[run].measured.get(channel) {
            Some(measured) => measured.clone(),
            None => r.runs[run].steering_rad.clone(),
        };
        let runs = || (0..a.runs.len()).map(|run| (signal(a, run), signal(b, run)));
        let alike =
            |(a, b): (Vec<f64>, Vec<f64>)| a.iter().zip(&b).all(|(a, b)| a == b || a.is_nan() && b.is_nan());
        let changes = |signal: &[f64]| signal.windows(2).any(|w| (w[0] - w[1]).abs() > 0.0);
        runs().all(alike) && runs().any(|(a, _)| changes(&a))
    });
    if !same.any(|same| same) {
        return None;
    }
    let places = |of: &Windows, other: &Windows| -> Vec<usize> {
        (0..of.windows.len()).filter(|&k| other.windows.contains(&of.windows[k])).collect()
    };
    let (in_a, in_b) = (places(of_a, of_b), places(of_b, of_a));
    let enough = in_a.len() as f64 >= SHARED * of_a.windows.len().max(of_b.windows.len()) as f64;
    (enough && !in_a.is_empty()).then(|| (of_a.picked(&in_a), of_b.picked(&in_b)))
}

#[cfg(test)]
mod tests {
    use gripsight_estimation::split;
    use gripsight_vehicle::VehicleParameters;

    use super::*;
    use crate::testing::drive;

    #[test]
    fn recordings_are_of_one_motion_where_a_signal_that_changes_is_the_same() {
        let vehicle = VehicleParameters::f1tenth();
        let a = drive(&vehicle, 0.0);
        let of = |a: &Recording, b: &Recording| {
            let [here, there] = [a, b].map(|r| split(r, true).training);
            shared([a, b], [&here, &there]).map(|(windows, _)| windows.windows.len())
        };
        let all = split(&a, true).training.windows.len();
        assert_eq!(of(&a, &a), Some(all));
        // Either of what is measured and what is commanded may have been touched.
        let mut turned = a.clone();
        turned.runs[0].steering_rad.iter_mut().for_each(|s| *s *= 1.1);
        assert_eq!(of(&a, &turned), Some(all));
        let mut touched = a.clone();
        touched.runs[0].measured.iter_mut().flatten().for_each(|v| *v += 0.1);
        assert_eq!(of(&a, &touched), Some(all));
        touched.runs[0].steering_rad.iter_mut().for_each(|s| *s *= 1.1);
        assert_eq!(of(&a, &touched), None);
        // A signal that stands still is the same in many drives.
        let mut still = a.clone();
        for run in [&mut still.runs[0], &mut touched.runs[0]] {
            run.measured[0].fill(0.0);
        }
        assert_eq!(of(&still, &touched), None);
    }

    #[test]
    fn a_difference_around_other_values_is_the_same_parabola() {
        let problem = Quadratic {
            information: nalgebra::dmatrix![4.0, 1.0; 1.0, 3.0],
            gradient: nalgebra::dvector![-2.0, 1.0],
        };
        let error = |d: &Difference, step: DVector<f64>| {
            d.left + (2.0 * &d.problem.gradient + &d.problem.information * &step).dot(&step)
        };
        let here = Difference { problem, left: 10.0 };
        let there = here.clone().at(&[1.0, 2.0], &[1.5, 1.0]);
        let to = |from: [f64; 2]| nalgebra::dvector![3.0 - from[0], -1.0 - from[1]];
        approx::assert_relative_eq!(
            error(&here, to([1.0, 2.0])),
            error(&there, to([1.5, 1.0])),
            max_relative = 1e-12
        );
    }
}
