//! A new model on the last lap's data, before it is driven with.
//!
//! From each tenth of a second of the lap the model predicts what will be measured of v_y and yaw rate some tenths of a second later, with the
//! commands that were sent and the speed that was measured. A model is taken if it predicts better than the one in use, no channel worse, and better than
//! a steering that is merely late: nearly every effect predicts a late car better than none does, and none is as dangerous where it is not there.

use std::collections::VecDeque;

use gripsight_vehicle::{Input, PacejkaParameters, SingleTrack, State, VehicleParameters};

use crate::extended::Named;
use crate::{Actuator, CarState};

/// Longest lap that is remembered.
const LONGEST_S: f64 = 60.0;
/// Least driving that a model is checked on.
const LEAST_S: f64 = 5.0;
/// Time from one start to the next, and predicted.
const EVERY_S: f64 = 0.1;
const AHEAD_S: [f64; 2] = [0.2, 0.4];
/// Slowest that is predicted.
const SLOW_MPS: f64 = 1.0;
/// Squared error over that of the model in use from which a model is better, and from which a channel is worse.
const BETTER: f64 = 0.95;
const WORSE: f64 = 1.05;
/// Delays that are tried beside what is named, beyond that in use.
const LATER_S: [f64; 6] = [0.02, 0.04, 0.06, 0.09, 0.13, 0.2];
/// Integration step.
const SUBSTEP_S: f64 = 0.005;
/// Longest step between two states.
const GAP_S: f64 = 0.05;

/// What the driver measured and sent.
#[derive(Debug, Clone, Default)]
pub(crate) struct Memory {
    measured: VecDeque<CarState>,
    /// Stamp and steering command, as it was sent.
    sent: VecDeque<(f64, f64)>,
}

impl Memory {
    pub(crate) fn push(&mut self, measured: CarState, sent_s: f64, command_rad: f64, lap_s: f64) {
        if self.measured.back().is_some_and(|last| last.stamp_s >= measured.stamp_s) {
            *self = Self::default();
        }
        let from_s = measured.stamp_s - lap_s.clamp(LEAST_S, LONGEST_S);
        self.measured.push_back(measured);
        self.sent.push_back((sent_s, command_rad));
        while self.measured.front().is_some_and(|first| first.stamp_s < from_s) {
            self.measured.pop_front();
        }
        // Commands act later than they were sent.
        while self.sent.front().is_some_and(|first| first.0 < from_s - 1.0) {
            self.sent.pop_front();
        }
    }

    pub(crate) fn span_s(&self) -> f64 {
        let ends = self.measured.front().zip(self.measured.back());
        ends.map_or(0.0, |(first, last)| last.stamp_s - first.stamp_s)
    }

    pub(crate) fn last_s(&self) -> f64 {
        self.measured.back().map_or(0.0, |last| last.stamp_s)
    }

    /// The wheels' angles when the states were measured.
    fn wheels_rad(&self, actuator: &Actuator) -> Vec<f64> {
        let (mut place, mut at, mut before_s) = (0, None, 0.0);
        let mut wheels = Vec::with_capacity(self.measured.len());
        for state in &self.measured {
            let then_s = state.stamp_s - actuator.delay_s;
            while place + 1 < self.sent.len() && self.sent[place + 1].0 <= then_s + 1e-9 {
                place += 1;
            }
            let asked = self.sent.get(place).map_or(0.0, |sent| sent.1) * actuator.gain + actuator.offset_rad;
            let follows = 1.0 - (-(state.stamp_s - before_s) / actuator.lag_s.max(1e-9)).exp();
            let angle = at.map_or(asked, |at: f64| at + follows * (asked - at));
            (at, before_s) = (Some(angle), state.stamp_s);
            wheels.push(angle);
        }
        wheels
    }

    /// Medians of the squared errors of v_y and yaw rate, as measured, on what is remembered. A car near its limit is predicted wildly now and then,
    /// whatever the model: a mean would rest on these moments alone.
    fn errors(&self, model: &Model<'_>) -> [f64; 2] {
        let wheels = self.wheels_rad(&model.actuator);
        let tires = model.named.tires(model.tires);
        let car = SingleTrack::new(model.vehicle, &tires);
        let (mut squares, mut next_s) = ([Vec::new(), Vec::new()], f64::NEG_INFINITY);
        for first in 0..self.measured.len() {
            let from_s = self.measured[first].stamp_s;
            if from_s < next_s {
                continue;
            }
            next_s = from_s + EVERY_S;
            let start = model.named.state(&self.measured[first]);
            let mut at = State { v_y_mps: start.v_y_mps, yaw_rate_radps: start.yaw_rate_radps };
            let mut horizons = AHEAD_S.iter().peekable();
            for k in first..self.measured.len() - 1 {
                let (here, there) = (&self.measured[k], &self.measured[k + 1]);
                let dt_s = there.stamp_s - here.stamp_s;
                if here.v_x_mps < SLOW_MPS || dt_s > GAP_S {
                    break;
                }
                let input = |k: usize| Input { v_x_mps: self.measured[k].v_x_mps, steering_rad: wheels[k] };
                at = car.step(at, &input(k), &input(k + 1), dt_s, SUBSTEP_S);
                let Some(&&ahead_s) = horizons.peek() else { break };
                if there.stamp_s - from_s < ahead_s - 1e-6 {
                    continue;
                }
                horizons.next();
                let [v_y, yaw_rate] = model.named.measured([at.v_y_mps, at.yaw_rate_radps]);
                squares[0].push((v_y - there.v_y_mps).powi(2));
                squares[1].push((yaw_rate - there.yaw_rate_radps).powi(2));
            }
        }
        squares.map(|mut channel| {
            channel.sort_by(f64::total_cmp);
            channel.get(channel.len() / 2).copied().unwrap_or(f64::NAN)
        })
    }
}

/// A controller's model.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Model<'a> {
    pub(crate) vehicle: &'a VehicleParameters,
    /// Of the set in use.
    pub(crate) tires: &'a PacejkaParameters,
    pub(crate) named: Named,
    pub(crate) actuator: Actuator,
}

/// How a model did on the last lap, beside the one in use. Errors are medians of predictions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial {
    /// Driving that it was checked on.
    pub driven_s: f64,
    /// Error of v_y with the model in use, and with the new one.
    pub v_y_mps: [f64; 2],
    /// Error of the yaw rate, likewise.
    pub yaw_rate_radps: [f64; 2],
    /// Squared errors over those of the model in use, mean of both channels.
    pub ratio: f64,
    /// How much later than in the model in use the steering may be instead: it predicts better than what was named, of which it is no part.
    pub later_s: Option<f64>,
    /// Whether it is driven with from now on.
    pub taken: bool,
}

/// Tries a model; `None` where too little was driven.
pub(crate) fn trial(memory: &Memory, used: &Model<'_>, new: &Model<'_>) -> Option<Trial> {
    let driven_s = memory.span_s();
    if driven_s < LEAST_S {
        return None;
    }
    let (before, after) = (memory.errors(used), memory.errors(new));
    let over = |errors: [f64; 2]| [0, 1].map(|k| errors[k] / before[k].max(1e-12));
    let mean = |ratios: [f64; 2]| 0.5 * (ratios[0] + ratios[1]);
    let ratios = over(after);
    let ratio = mean(ratios);
    // What is not finite is not better.
    let better = ratio < BETTER && ratios.iter().all(|r| *r < WORSE);
    let later = |by_s: f64| {
        let actuator = Actuator { delay_s: used.actuator.delay_s + by_s, ..used.actuator };
        (by_s, mean(over(memory.errors(&Model { actuator, ..*used }))))
    };
    let asks = better && new.actuator == used.actuator;
    let rivals = LATER_S.iter().take(if asks { LATER_S.len() } else { 0 }).map(|by_s| later(*by_s));
    let least = rivals.filter(|(_, late)| *late < ratio).min_by(|a, b| a.1.total_cmp(&b.1));
    let later_s = least.map(|(by_s, _)| by_s);
    let taken = better && later_s.is_none();
    let both = |k: usize| [before[k].sqrt(), after[k].sqrt()];
    Some(Trial { driven_s, v_y_mps: both(0), yaw_rate_radps: both(1), ratio, later_s, taken })
}
