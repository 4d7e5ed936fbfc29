//! Watches the set in use: does it still fit what the car does, and if not, what became of the grip?
//!
//! On the last seconds of each window of telemetry the peak factors D of both axles are fitted anew, everything else held at the accepted set. A change that is
//! both larger than its uncertainty and worth acting on is a notice; small corners tell nothing and give none. Where the change lies is where the
//! windows before fit best with the old D and those after it with the new: a run that is told of a change leaves out what lies before it.
//!
//! A set whose peak was not reached says nothing of slips beyond those that it is valid within: a car that is driven harder than before shows what its tires
//! do there, and that is no change.

use gripsight_model::{Rollout, Window};
use gripsight_signals::{DataHealth, StateSequence};
use gripsight_vehicle::{GRAVITY_MPS2, MagicFormula, VehicleParameters};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::data::Data;
use crate::judge::rollout_errors;
use crate::rollout::{TireRollout, vector_of};
use crate::tires::D_BOUNDS;
use crate::{AcceptedSet, Estimate, FrictionPrior, IdentificationError, PerAxle, Usable, vehicle_hash};
use gripsight_estimation::shooting::{Parameter, Problem, TOLERANCE, fit};

/// Smallest change of the force where the car was driven that is worth a notice, as a share of it.
const NOTICEABLE: f64 = 0.08;
/// Chance, one side, of a change that is none: three standard errors, were these known.
const FALSE_ALARM: f64 = 0.001_35;
/// What is looked at: long enough for some corners, short enough for a notice while the change is fresh.
const LOOK_S: f64 = 10.0;
/// Fewest windows of the telemetry to look at.
const WINDOWS: usize = 4;
/// Robustness of the window loss, in noises.
const ROBUST_K: f64 = 3.0;

/// What a look at the latest telemetry gave.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reading {
    /// End of the telemetry looked at, in nanoseconds.
    pub stamp_ns: i64,
    /// Rollout error with the set in use over what it was when it was accepted: 1 is as good as then.
    pub error_ratio: f64,
    /// Peak factor that fits the telemetry looked at, everything else held.
    pub peak_factor: PerAxle<Estimate>,
    /// Whether the grip has changed: identify anew.
    pub changed: bool,
    /// From here on the telemetry fits better with that peak factor than with the set in use, in nanoseconds: where the grip changed, if it has.
    pub since_ns: i64,
}

impl Reading {
    /// The change in words, if there was one, against the set that was watched.
    #[must_use]
    pub fn notice(&self, set: &AcceptedSet) -> Option<String> {
        let (now, then) = (&self.peak_factor, &set.fitted);
        self.changed.then(|| {
            format!(
                "the grip has changed: D {:.2} -> {:.2} front, {:.2} -> {:.2} rear",
                then.front.d, now.front.value, then.rear.d, now.rear.value
            )
        })
    }

    /// Whether grip has fallen below what a set promises.
    #[must_use]
    pub fn fallen(&self, set: &AcceptedSet) -> bool {
        let below = |now: &Estimate, promised: f64| now.high < promised;
        self.changed
            && (below(&self.peak_factor.front, set.promised.front.d)
                || below(&self.peak_factor.rear, set.promised.rear.d))
    }

    /// What the change says of the road, if there was one: the tires' shape is the old one, so the force below the peak tells the peak.
    pub(crate) fn prior(&self) -> Option<FrictionPrior> {
        let PerAxle { front, rear } = self.peak_factor;
        let sigma = [front, rear].map(|d| (d.high - d.value) / Estimate::Z90);
        let apart = 0.5 * (front.value - rear.value).abs();
        self.changed.then(|| FrictionPrior {
            mu: 0.5 * (front.value + rear.value),
            sigma: sigma.into_iter().fold(apart, f64::max),
        })
    }
}

/// Watches one accepted set.
#[derive(Debug, Clone)]
pub struct Monitor {
    vehicle: VehicleParameters,
    set: AcceptedSet,
}

impl Monitor {
    /// Watches a set.
    ///
    /// # Errors
    /// [`IdentificationError::OtherCar`] for a set of a car with other parameters.
    pub fn new(vehicle: &VehicleParameters, set: &AcceptedSet) -> Result<Self, IdentificationError> {
        let expected = vehicle_hash(vehicle);
        if set.vehicle_hash != expected {
            return Err(IdentificationError::OtherCar { expected, got: set.vehicle_hash.clone() });
        }
        Ok(Self { vehicle: vehicle.clone(), set: set.clone() })
    }

    /// Looks at the last 10 s of telemetry.
    ///
    /// # Errors
    /// [`IdentificationError`] for telemetry that is malformed or holds less than 2.4 s of driving.
    pub fn look(&self, sequence: &StateSequence) -> Result<Reading, IdentificationError> {
        let usable = Usable::of(sequence, &self.vehicle)?;
        self.read(&Data::new(&usable, &self.vehicle, &DataHealth::of(sequence)?, WINDOWS)?, sequence)
    }

    /// Whether the set says what the car does in a window: of all of them where both peaks were reached, else where slips, by its own account, and lateral
    /// acceleration are within what it was shown.
    fn speaks_of(&self, model: &TireRollout<'_>, p: &[f64], window: &Window) -> bool {
        let (reached, valid, promised) =
            (self.set.peak_reached, self.set.valid_within.slip_rad, &self.set.promised);
        let most_mps2 = GRAVITY_MPS2 * promised.front.d.min(promised.rear.d);
        let segment = &model.segments[window.segment];
        let turned = |k: usize| (segment.v_x_mps[k] * segment.yaw_rate_radps[k]).abs();
        let both = reached.front && reached.rear;
        let mut within = both || (window.from..window.from + window.len).all(|k| turned(k) <= most_mps2);
        model.trajectory(p, model.start_guess(window), window, |visit| {
            let (front, rear) = visit.slip_rad;
            within &= reached.front || front.abs() <= valid.front;
            within &= reached.rear || rear.abs() <= valid.rear;
        });
        within
    }

    /// Largest slips of front and rear axle in windows, by the set's own account.
    fn slips_driven_rad(&self, model: &TireRollout<'_>, p: &[f64], windows: &[Window]) -> [f64; 2] {
        let mut most_rad = [0.0_f64; 2];
        for window in windows {
            model.trajectory(p, model.start_guess(window), window, |visit| {
                let (front, rear) = visit.slip_rad;
                most_rad = [most_rad[0].max(front.abs()), most_rad[1].max(rear.abs())];
            });
        }
        most_rad
    }

    /// The same with the telemetry made ready.
    pub(crate) fn read(&self, data: &Data, sequence: &StateSequence) -> Result<Reading, IdentificationError> {
        let model = TireRollout::new(&self.vehicle, data);
        let from_s = sequence.duration_s() - LOOK_S;
        let begin_s = |w: &Window| {
            let segment = &data.segments[w.segment];
            segment.start_time_s + w.from as f64 * segment.dt_s
        };
        let late = |w: &Window| begin_s(w) >= from_s;
        let all: Vec<Window> = data.windows.iter().map(|(w, _)| *w).collect();
        // With what braking and driving take: a few corners may be braked into harder than all of those before.
        let p = vector_of(&self.set.fitted, &self.set.corrections, &self.set.nuisance);
        let mut windows: Vec<Window> = all.iter().copied().filter(late).collect();
        let within: Vec<Window> = windows.iter().copied().filter(|w| self.speaks_of(&model, &p, w)).collect();
        let silent = within.len() < WINDOWS;
        if !silent {
            windows = within;
        }
        if windows.len() < WINDOWS {
            let length_s = windows.first().map_or(0.0, |w| w.len as f64 * data.dt_s);
            return Err(IdentificationError::TooLittle {
                what: "driving time in s at the end of the telemetry",
                got: windows.len() as f64 * length_s,
                needed: WINDOWS as f64 * length_s,
                drive: "drive on",
            });
        }
        let sigma = self.set.rollout_rmse.map(|s| s.max(1e-6));
        let solve = |p: &[f64], windows: &[Window], peaks_free: bool| {
            let parameter = |(j, &start): (usize, &f64)| {
                let free = peaks_free && (j == 2 || j == 6);
                let (low, high) = if free { D_BOUNDS } else { (f64::NEG_INFINITY, f64::INFINITY) };
                Parameter { start, low, high, free, prior: None }
            };
            let parameters: Vec<Parameter> = p.iter().enumerate().map(parameter).collect();
            let problem = Problem {
                model: &model,
                windows,
                sigma: &sigma,
                parameters: &parameters,
                robust_k: ROBUST_K,
                tolerance: TOLERANCE,
                max_iterations: 15,
            };
            fit(&problem, None)
        };
        let found = solve(&p, &windows, true);
        let costs = |p: &[f64]| solve(p, &all, false).linearization.window_costs;
        let since = change(&costs(&p), &costs(&found.parameters));
        let axle = |j: usize| (found.parameters[j], found.standard_error(j));
        // The errors are those of a few windows: Student's t, less the two peaks.
        let freedom = windows.len().saturating_sub(2).max(1) as f64;
        let significant =
            StudentsT::new(0.0, 1.0, freedom).map_or(f64::INFINITY, |t| t.inverse_cdf(1.0 - FALSE_ALARM));
        // What a change of D comes to where the car was driven: a peak is not known from gentle corners, and need not be.
        let driven = self.slips_driven_rad(&model, &p, &windows);
        let differs = |axle: usize, then: MagicFormula, promised: MagicFormula, reached: bool| {
            let (now, error, was) =
                (found.parameters[4 * axle + 2], found.standard_error(4 * axle + 2), p[4 * axle + 2]);
            let after = MagicFormula::from_stiffness(then.normalized_stiffness(), then.c, now, then.e);
            let force = |tire: &MagicFormula| tire.normalized_force(driven[axle]);
            // Of a peak that nobody reached it is no news that it lies elsewhere, only that the force shown is there no more.
            !silent
                && error.is_some_and(|e| (now - was).abs() > significant * e)
                && (force(&after) - force(&then)).abs() > NOTICEABLE * force(&then)
                && (reached || force(&after) < force(&promised))
        };
        let AcceptedSet { fitted, promised, peak_reached, .. } = &self.set;
        let changed = differs(0, fitted.front, promised.front, peak_reached.front)
            || differs(1, fitted.rear, promised.rear, peak_reached.rear);
        let stamp_ns = |time_s: f64| sequence.start_stamp_ns + (time_s * gripsight_signals::NS_PER_S) as i64;
        Ok(Reading {
            stamp_ns: stamp_ns(sequence.duration_s()),
            since_ns: stamp_ns(all.get(since).map_or(from_s, begin_s)),
            error_ratio: rollout_errors(&model, &p, &windows, &sigma).normalized,
            peak_factor: PerAxle { front: axle(2), rear: axle(6) }
                .map(|(now, error)| Estimate::from_error(now, error)),
            changed,
        })
    }
}

/// First window of the rest that fits best with the new tires against the old, from what either costs in each window.
fn change(old: &[f64], new: &[f64]) -> usize {
    let (mut gain, mut best, mut at) = (0.0, 0.0, old.len());
    for (k, (old, new)) in old.iter().zip(new).enumerate().rev() {
        gain += old - new;
        if gain > best {
            (best, at) = (gain, k);
        }
    }
    at
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_change_lies_where_the_new_tires_begin_to_fit_better() {
        assert_eq!(super::change(&[1.0, 1.0, 5.0, 1.5, 6.0], &[3.0, 2.0, 1.0, 2.0, 1.0]), 2);
        assert_eq!(super::change(&[1.0, 1.0], &[2.0, 2.0]), 2);
    }
}
