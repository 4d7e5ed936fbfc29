//! Two recordings of one motion, sample by sample: a bag and its copy with a signal or the command processed anew. What no
//! model says of the car is in both and falls out of the difference of what is left of each (a paired comparison; Student 1908, "The probable error of a
//! mean"): no matching of blocks and no contradiction stands in the way of a change.

use std::ops::Range;

use gripsight_estimation::Windows;
use gripsight_estimation::selection::{Quadratic, Term, configuration, select};
use gripsight_model::{Recording, Site};
use nalgebra::{DMatrix, DVector};

use crate::changes::{self, Compared, SEED};
use crate::decisions;
use crate::engine::Engine;
use crate::frame::Frame;
use crate::hypotheses::terms;
use crate::infer::{FIRST, differences, repeated, starts};
use crate::inferred::Inferred;
use crate::joint::Joint;

/// Share of the windows that both recordings must have for them to be of one motion.
const SHARED: f64 = 0.5;
/// Share of a channel's noise to which a difference is followed at least: a model's derivatives are no better.
const LEAST_NOISE: f64 = 0.05;

/// Times at most that two recordings of one motion are linearised.
const ROUNDS: usize = 8;
/// Of these the first, in which effects alone are asked for: beside free terms a linearisation far from the cause would blame them.
const FAR_ROUNDS: usize = 3;

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

    /// What differs, linearised around what has changed until that stays.
    pub(crate) fn compared(
        &self,
        engine: &Engine<'_>,
        earlier: &Inferred,
        slip_rad: [f64; 2],
    ) -> Option<Compared> {
        let mut values = earlier.values.clone();
        let mut before = Vec::new();
        let mut round = 0;
        loop {
            round += 1;
            let by = self.difference(&mut values)?.at(&values, &earlier.values);
            let compared = compare(engine, earlier, &by, round > FAR_ROUNDS, slip_rad)?;
            let (next, changed) = compared.changed_model(earlier);
            if (changed == before && round > FAR_ROUNDS + 1) || round == ROUNDS {
                return Some(compared);
            }
            (values, before) = (next, changed);
        }
    }

    /// What the later recording says of the differences from the earlier one's model, linearised around a model of its own. Effects of a place that this lacks are
    /// looked for, and their places set.
    fn difference(&self, values: &mut [f64]) -> Option<Difference> {
        let Frame { columns, library, .. } = self.frame;
        let own = starts(&self.engine, columns, values, &self.windows);
        let joint = Joint::around(&self.engine, columns, values, &own, &self.windows)?;
        let mut joint = joint.beyond(&self.earlier);
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
struct Difference {
    problem: Quadratic,
    /// The error that is left there, in units of what all terms together leave.
    left: f64,
}

impl Difference {
    /// The same around other values.
    fn at(self, from: &[f64], to: &[f64]) -> Self {
        let Quadratic { information, gradient } = self.problem;
        let step = DVector::from_iterator(to.len(), to.iter().zip(from).map(|(to, from)| to - from));
        let pull = &information * &step;
        let left = self.left + (2.0 * &gradient + &pull).dot(&step);
        Self { problem: Quadratic { gradient: gradient + pull, information }, left }
    }
}

/// The windows that both recordings have, where they are of one motion: a measured signal that changes is the same in both, sample by sample. One series of commands
/// played twice is not: either drive has noise and ground of its own.
fn shared([a, b]: [&Recording; 2], [of_a, of_b]: [&Windows; 2]) -> Option<(Windows, Windows)> {
    let cut =
        |r: &Recording| r.runs.iter().map(|run| (run.start_time_s, run.dt_s, run.len())).collect::<Vec<_>>();
    if cut(a) != cut(b) || a.channels != b.channels {
        return None;
    }
    let mut same = (0..a.channels.len()).map(|channel| {
        let runs = || a.runs.iter().zip(&b.runs).map(|(a, b)| (&a.measured[channel], &b.measured[channel]));
        let alike =
            |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).all(|(a, b)| a == b || a.is_nan() && b.is_nan());
        let changes = |signal: &[f64]| signal.windows(2).any(|w| (w[0] - w[1]).abs() > 0.0);
        runs().all(alike) && runs().any(|(a, _)| changes(a))
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

/// Compares two recordings of one motion. `by`: what they differ by, around the earlier one's model; `free`: whether something that no effect does is asked for, too.
fn compare(
    engine: &Engine<'_>,
    earlier: &Inferred,
    by: &Difference,
    free: bool,
    slip_rad: [f64; 2],
) -> Option<Compared> {
    let n = earlier.columns.len();
    let mut problem =
        Quadratic { information: DMatrix::zeros(2 * n, 2 * n), gradient: DVector::zeros(2 * n) };
    let of_earlier = &earlier.weighed.total;
    let dispersion = earlier.dispersion;
    problem.information.view_mut((0, 0), (n, n)).copy_from(&(&of_earlier.information / dispersion));
    problem.information.view_mut((n, n), (n, n)).copy_from(&by.problem.information);
    problem.gradient.rows_mut(0, n).copy_from(&(&of_earlier.gradient / dispersion));
    problem.gradient.rows_mut(n, n).copy_from(&by.problem.gradient);
    let same = the_same(earlier, changes::differences(engine, earlier, 0.0));
    let alone: Vec<Term> = same.iter().map(|t| Term { from: t.from - n, ..t.clone() }).collect();
    let changed = forward(by, &alone, &candidates(earlier, free))?;
    let kept = same.into_iter().zip(&changed).map(|(t, &c)| if c > 0 { t } else { t.only(0) });
    let terms: Vec<Term> = earlier.terms.iter().cloned().chain(kept).collect();
    let start = [&earlier.selection.best[..], &changed].concat();
    let selection = select(&problem, 1.0, &terms, &start, SEED)?;
    Compared::of(engine, earlier, (&problem, &terms), (selection, 1.0), slip_rad)
}

/// Differences of one car in one motion: what has not changed is the same, and no large evidence makes it differ by as little as two drives of a car may.
fn the_same(earlier: &Inferred, mut differences: Vec<Term>) -> Vec<Term> {
    /// What is left of a standard deviation.
    const GONE: f64 = 1e-3;
    let sizing =
        |t: usize| earlier.columns.effects.get(t.wrapping_sub(FIRST)).map_or(usize::MAX, |e| e.sizing());
    for (t, term) in differences.iter_mut().enumerate() {
        term.priors.iter_mut().take(sizing(t)).for_each(|p| p.sigma[0] *= GONE);
    }
    differences
}

/// What may have changed, as groups of terms of the differences, each with the share of what it explains that counts beside an effect: an effect is taken for the cause where
/// it does nearly as much as tires or free terms, which do what any cause at their site does.
fn candidates(earlier: &Inferred, free: bool) -> Vec<(Range<usize>, f64)> {
    let effects = earlier.columns.effects.iter().filter(|e| earlier.is_open(**e));
    let effects = effects.filter_map(|e| earlier.term_of(*e)).map(|t| (t..t + 1, 1.0));
    let sites = Site::ALL.into_iter().filter(|_| free).map(|site| earlier.terms_of_site(site));
    let any = std::iter::once(0..1).chain(sites).map(|terms| (terms, 1.0 - decisions::RIVAL_LEAVES));
    effects.chain(any).collect()
}

/// Takes in the candidate that explains most, one after the other, as long as it closes a share of the error (forward selection; Efroymson 1960, "Multiple
/// regression analysis"), and takes out again what the others make needless.
fn forward(
    Difference { problem, left: all }: &Difference,
    terms: &[Term],
    candidates: &[(Range<usize>, f64)],
) -> Option<Vec<usize>> {
    let with = |chosen: &[usize], group: &Range<usize>, there: usize| {
        let mut out = chosen.to_vec();
        out[group.clone()].fill(there);
        out
    };
    let left = |chosen: &[usize]| {
        let step = configuration(problem, 1.0, terms, chosen)?.step;
        Some((2.0 * &problem.gradient + &problem.information * &step).dot(&step) / all)
    };
    let mut chosen = vec![0; terms.len()];
    let is_in = |chosen: &[usize], group: &Range<usize>| chosen[group.start] > 0;
    for _ in candidates {
        let now = left(&chosen)?;
        let closes = |(group, counts): &(Range<usize>, f64)| {
            Some((group.clone(), (now - left(&with(&chosen, group, 1))?) * counts))
        };
        let offered = candidates.iter().filter(|c| !is_in(&chosen, &c.0)).filter_map(closes);
        let best = offered.max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((group, _)) = best.filter(|b| b.1 >= decisions::LEAST_CLOSED) else { break };
        chosen = with(&chosen, &group, 1);
        loop {
            let now = left(&chosen)?;
            let closes = |(group, _): &(Range<usize>, f64)| {
                Some((group.clone(), left(&with(&chosen, group, 0))? - now))
            };
            let inside = candidates.iter().filter(|c| is_in(&chosen, &c.0)).filter_map(closes);
            let least = inside.min_by(|a, b| a.1.total_cmp(&b.1));
            match least.filter(|l| l.1 < decisions::LEAST_CLOSED) {
                Some((group, _)) => chosen = with(&chosen, &group, 0),
                None => break,
            }
        }
    }
    Some(chosen)
}

#[cfg(test)]
mod tests {
    use gripsight_estimation::selection::ColumnPrior;
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
        // The command may have been touched, and all that is measured but one signal.
        let mut touched = a.clone();
        touched.runs[0].steering_rad.iter_mut().for_each(|s| *s *= 1.1);
        touched.runs[0].measured[1..].iter_mut().flatten().for_each(|v| *v += 0.1);
        assert_eq!(of(&a, &touched), Some(all));
        // A signal that stands still is the same in many drives.
        let mut still = a.clone();
        for run in [&mut still.runs[0], &mut touched.runs[0]] {
            run.measured[0].fill(0.0);
        }
        assert_eq!(of(&still, &touched), None);
        // One series of commands played twice has noise of its own each time.
        let mut again = a.clone();
        again.runs[0].measured.iter_mut().flatten().for_each(|v| *v += 0.1);
        assert_eq!(of(&a, &again), None);
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

    /// What is left of a cause on the first column, which the second and third together explain wholly; the fourth explains something else.
    fn chosen(of_first: f64, of_fourth: f64) -> Vec<usize> {
        let prior = || ColumnPrior {
            offset: 0.0,
            sigma: vec![1e-6, 100.0],
            bounds: [f64::NEG_INFINITY, f64::INFINITY],
        };
        let terms: Vec<Term> = (0..4)
            .map(|from| Term { from, priors: vec![prior()], log_weights: vec![0.95_f64.ln(), 0.05_f64.ln()] })
            .collect();
        // The first column lies, but for a share of its square, in the plane of the second and third.
        let inside = of_first.sqrt();
        let rows = [[inside, 1.0, 0.0, 0.0], [(1.0 - of_first).sqrt(), 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
        let jacobian = DMatrix::from_fn(3, 4, |r, c| 100.0 * rows[r][c]);
        let residual = DVector::from_row_slice(&[100.0, 0.0, 100.0 * of_fourth]);
        let problem =
            Quadratic { information: jacobian.tr_mul(&jacobian), gradient: -jacobian.tr_mul(&residual) };
        let by = Difference { problem, left: residual.norm_squared() };
        forward(&by, &terms, &[(0..1, 1.0), (1..3, 1.0 - decisions::RIVAL_LEAVES), (3..4, 1.0)]).unwrap()
    }

    #[test]
    fn an_effect_that_does_nearly_as_much_as_free_terms_is_taken_for_the_cause() {
        assert_eq!(chosen(0.99, 0.0), [1, 0, 0, 0]);
        // One that does half of it is not.
        assert_eq!(chosen(0.5, 0.0), [0, 1, 1, 0]);
        // Another change beside it is told, and one that closes a hundredth is not.
        assert_eq!(chosen(0.99, 0.5), [1, 0, 0, 1]);
        assert_eq!(chosen(0.99, 0.1), [1, 0, 0, 0]);
    }
}
