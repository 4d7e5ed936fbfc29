//! Whether the grip stayed the same over a run: tires fitted to two floors are those of neither.
//!
//! D of both axles is fitted anew to what lies before a place in time and to what lies after it, everything else held. The place is where the linearized
//! problem gains most, then where each window fits better with the D of its side. A floor changed there if an axle's D differs by more than its uncertainty and by more than what tires and models make of one floor, and
//! if both sides came near their D: one that was not come near rests on the curve's form, too, and then both axles' D have to differ by as much.

use std::fmt;
use std::ops::Range;

use gripsight_estimation::shooting::{Fit, Linearization, Parameter, Problem, TOLERANCE, fit};
use gripsight_model::Window;
use gripsight_vehicle::GRAVITY_MPS2;
use nalgebra::{Matrix2, Vector2};
use serde::Serialize;

use super::{ROBUST_K, SEARCH_TOLERANCE, SPREAD};
use crate::data::{Data, quantile};
use crate::rollout::TireRollout;
use crate::tires::D_BOUNDS;
use crate::{Estimate, PerAxle};

/// Fewer windows on a side say nothing.
const LEAST_WINDOWS: usize = 10;
/// How often the place is moved to where it fits better.
const REFINED: usize = 3;
/// D of both sides has to differ by so many standard errors,
const SIGNIFICANT: f64 = 4.0;
/// and by this share of the smaller: slips of other sizes, warm tires and a model that is too simple make less of one floor.
const NOTICEABLE: f64 = 0.2;
/// A side that turned with at least this share of its mean D came near it. One that turned with less than the other share says nothing. Chosen on development
/// drives on one floor, of which either half has its own pace (`envelope paces`: of 60 others none is cut), and one of 300 draws at one (`envelope draws`).
const SHOWN: f64 = 0.75;
const SHOWN_AT_ALL: f64 = 0.5;
/// What a side turned with is this quantile of the lateral acceleration.
const TURNED: f64 = 0.98;
/// Place of D of either axle.
const D: [usize; 2] = [2, 6];

/// A change of the grip within a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GripChange {
    /// Since the start of the sequence.
    pub at_s: f64,
    /// D before.
    pub before: PerAxle<Estimate>,
    /// D after.
    pub after: PerAxle<Estimate>,
}

impl fmt::Display for GripChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (then, now) = (&self.before, &self.after);
        write!(
            f,
            "the grip changed {:.1} s after the start: D {:.2} -> {:.2} front, {:.2} -> {:.2} rear",
            self.at_s, then.front.value, now.front.value, then.rear.value, now.rear.value
        )
    }
}

/// The change of grip, if there was one. `parameters`: of the fit to all; `sigma`: what its residuals were divided by.
pub(super) fn change_within(
    model: &TireRollout<'_>,
    data: &Data,
    parameters: &[f64],
    sigma: &[f64; 2],
) -> Option<GripChange> {
    let windows: Vec<Window> = data.windows.iter().map(|(w, _)| *w).collect();
    let last = windows.len().checked_sub(LEAST_WINDOWS)?;
    let on = OnOneFloor { model, sigma };
    // D moves where the windows begin only a little: each fit begins where they do with one D.
    let starts = on.fitted(&windows, parameters, None, Peaks::Held).starts;
    let fitted =
        |windows, starts: &[[f64; 2]], peaks| on.fitted(windows, parameters, Some(starts.to_vec()), peaks);
    let around = fitted(&windows, &starts, Peaks::Linearized).linearization;
    let mut place = (LEAST_WINDOWS..=last).max_by(|&a, &b| gain(&around, a).total_cmp(&gain(&around, b)))?;
    let sides = |place: usize| {
        (
            fitted(&windows[..place], &starts[..place], Peaks::Free),
            fitted(&windows[place..], &starts[place..], Peaks::Free),
        )
    };
    let costs = |side: &Fit| {
        on.fitted(&windows, &side.parameters, Some(starts.clone()), Peaks::Held).linearization.window_costs
    };
    // That place mixes both floors on one side: from there to where each window fits better with the other side's D.
    let (mut before, mut after) = sides(place);
    for _ in 0..REFINED {
        let better = between(&costs(&before), &costs(&after), last)?;
        if better == place {
            break;
        }
        place = better;
        (before, after) = sides(place);
    }
    // As a share of the smaller D; a D on its bound is not known.
    let share = |j: usize| {
        let (a, b) = (before.parameters[j], after.parameters[j]);
        let known = !before.on_bound.contains(&j) && !after.on_bound.contains(&j);
        known.then(|| (b - a) / a.min(b))
    };
    let shown = |fit: &Fit, windows: &[Window]| {
        turned(data, windows) / (0.5 * (fit.parameters[D[0]] + fit.parameters[D[1]]))
    };
    let shown = shown(&before, &windows[..place]).min(shown(&after, &windows[place..]));
    let significant = |j: usize| {
        let change = (after.parameters[j] - before.parameters[j]).abs();
        let errors = before.standard_error(j).zip(after.standard_error(j));
        errors.is_some_and(|(e, f)| change > SIGNIFICANT * SPREAD * e.hypot(f))
    };
    let shares = [share(D[0])?, share(D[1])?];
    let differs = |axle: usize| shares[axle].abs() > NOTICEABLE && significant(D[axle]);
    // A floor lies under both axles.
    let both = |least: f64| shares[0] * shares[1] > 0.0 && shares.into_iter().all(|s| s.abs() > least);
    let changed = if shown > SHOWN {
        (differs(0) || differs(1)) && both(0.5 * NOTICEABLE)
    } else {
        shown > SHOWN_AT_ALL && differs(0) && differs(1) && both(NOTICEABLE)
    };
    let window = &windows[place];
    let segment = &data.segments[window.segment];
    let peaks = |fit: &Fit| {
        let axle =
            |j: usize| Estimate::from_error(fit.parameters[j], fit.standard_error(j).map(|e| SPREAD * e));
        PerAxle { front: axle(D[0]), rear: axle(D[1]) }
    };
    changed.then(|| GripChange {
        at_s: segment.start_time_s + window.from as f64 * segment.dt_s,
        before: peaks(&before),
        after: peaks(&after),
    })
}

/// By how much a D of its own on either side of a place lowers the cost of the linearized problem.
fn gain(around: &Linearization, place: usize) -> f64 {
    let side = |windows: Range<usize>| {
        let information =
            around.window_information[windows.clone()].iter().fold(Matrix2::zeros(), |sum, i| sum + i);
        let gradient = around.window_gradients[windows].iter().fold(Vector2::zeros(), |sum, g| sum + g);
        information.cholesky().map_or(0.0, |root| gradient.dot(&root.solve(&gradient)))
    };
    side(0..place) + side(place..around.window_costs.len())
}

/// What a fit does with D of both axles.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Peaks {
    /// They stay, and only the windows' starts are fitted.
    Held,
    /// They stay, and how the cost depends on them is wanted.
    Linearized,
    Free,
}

/// Fits of D of both axles, everything else held.
struct OnOneFloor<'a> {
    model: &'a TireRollout<'a>,
    sigma: &'a [f64; 2],
}

impl OnOneFloor<'_> {
    fn fitted(&self, windows: &[Window], at: &[f64], starts: Option<Vec<[f64; 2]>>, peaks: Peaks) -> Fit {
        let parameter = |(j, &start): (usize, &f64)| {
            let free = peaks != Peaks::Held && D.contains(&j);
            let (low, high) = if free { D_BOUNDS } else { (f64::NEG_INFINITY, f64::INFINITY) };
            Parameter { start, low, high, free, prior: None }
        };
        let parameters: Vec<Parameter> = at.iter().enumerate().map(parameter).collect();
        let problem = Problem {
            model: self.model,
            windows,
            sigma: self.sigma,
            parameters: &parameters,
            robust_k: ROBUST_K,
            tolerance: if peaks == Peaks::Free { TOLERANCE } else { SEARCH_TOLERANCE },
            max_iterations: if peaks == Peaks::Linearized { 0 } else { 15 },
        };
        fit(&problem, starts)
    }
}

/// Lateral acceleration that the car turned with in some windows, over gravity: in a turn the force over the load of either axle.
fn turned(data: &Data, windows: &[Window]) -> f64 {
    let samples = windows.iter().flat_map(|w| {
        let s = &data.segments[w.segment];
        (w.from..w.from + w.len).map(|k| (s.v_x_mps[k] * s.yaw_rate_radps[k]).abs())
    });
    quantile(&mut samples.collect::<Vec<f64>>(), TURNED).unwrap_or(0.0) / GRAVITY_MPS2
}

/// The window before which the old tires and from which on the new ones cost least together, at least [`LEAST_WINDOWS`] from either end.
fn between(old: &[f64], new: &[f64], last: usize) -> Option<usize> {
    let total = |place: usize| old[..place].iter().sum::<f64>() + new[place..].iter().sum::<f64>();
    (LEAST_WINDOWS..=last).min_by(|&a, &b| total(a).total_cmp(&total(b)))
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_change_lies_where_both_sides_cost_least() {
        let mut old = [1.0; 26];
        old[14..].fill(5.0);
        assert_eq!(super::between(&old, &[4.0; 26], 16), Some(14));
        assert_eq!(super::between(&old, &[0.0; 26], 16), Some(10));
        assert_eq!(super::between(&old[..12], &[4.0; 12], 2), None);
    }
}
