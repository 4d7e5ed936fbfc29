//! The single-track model behind imperfect signals, as the shooting engine runs it.

use gripsight_signals::Segment;
use gripsight_vehicle::{
    GRAVITY_MPS2, Input, MagicFormula, PacejkaParameters, Real, SingleTrack, State, VehicleParameters,
};

use crate::SignalCorrections;
use crate::shooting::{Rollout, Window};

/// Number of parameters of [`TireRollout`]: (k, C, D, E) front and rear with k = B C D, then the signal corrections.
pub(crate) const PARAMETERS: usize = 14;
/// Place of the first signal correction.
pub(crate) const SIGNALS: usize = 8;
/// Names of the parameters, with their units where they have one.
pub(crate) const NAMES: [&str; PARAMETERS] = [
    "front.k",
    "front.c",
    "front.d",
    "front.e",
    "rear.k",
    "rear.c",
    "rear.d",
    "rear.e",
    "steering_delay_s",
    "steering_gain",
    "steering_offset_rad",
    "v_y_lever_arm_m",
    "v_y_bias_mps",
    "yaw_rate_bias_radps",
];

/// Predicts what the sensors report of v_y and yaw rate.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TireRollout<'a> {
    pub(crate) vehicle: &'a VehicleParameters,
    pub(crate) segments: &'a [Segment],
}

/// Tires of a parameter vector.
pub(crate) fn tires_of<T: Real>(p: &[T]) -> PacejkaParameters<T> {
    let axle = |v: &[T]| MagicFormula { b: v[0] / (v[1] * v[2]), c: v[1], d: v[2], e: v[3] };
    PacejkaParameters { front: axle(&p[..4]), rear: axle(&p[4..8]) }
}

/// The parameter vector of tires and corrections.
pub(crate) fn vector_of(tires: &PacejkaParameters, corrections: &SignalCorrections) -> [f64; PARAMETERS] {
    let axle = |f: &MagicFormula| [f.normalized_stiffness(), f.c, f.d, f.e];
    let (front, rear, signals) = (axle(&tires.front), axle(&tires.rear), corrections.to_array());
    std::array::from_fn(|j| match j {
        0..4 => front[j],
        4..8 => rear[j - 4],
        _ => signals[j - SIGNALS],
    })
}

/// Signal corrections of a parameter vector.
pub(crate) fn corrections_of(p: &[f64]) -> SignalCorrections {
    SignalCorrections::from_array(std::array::from_fn(|j| p[SIGNALS + j]))
}

/// The recorded steering at sample `k` less a delay; held before the first sample.
pub(crate) fn delayed<T: Real>(recorded: &[f64], k: usize, delay_samples: T) -> T {
    let at = k as f64 - delay_samples.re();
    if at <= 0.0 {
        return T::from(recorded[0]);
    }
    let before = (at.floor() as usize).min(recorded.len().saturating_sub(2));
    let (a, b) = (recorded[before], recorded[(before + 1).min(recorded.len() - 1)]);
    (-delay_samples + (k as f64 - before as f64)) * (b - a) + a
}

/// Longest step of the integration: the fastest mode of the linear car decays with k g/v_x, and the midpoint rule follows it well up to
/// half of its time.
pub(crate) fn substep_s(stiffness: f64, v_x_mps: f64) -> f64 {
    const LONGEST_S: f64 = 0.01;
    const SHORTEST_S: f64 = 0.001;
    (0.5 * v_x_mps / (stiffness.max(1.0) * GRAVITY_MPS2)).clamp(SHORTEST_S, LONGEST_S)
}

impl Rollout for TireRollout<'_> {
    fn channels(&self) -> usize {
        2
    }

    fn rollout<T: Real>(&self, p: &[T], start: [T; 2], window: &Window, out: &mut Vec<T>) {
        out.clear();
        let segment = &self.segments[window.segment];
        let model = SingleTrack::new(self.vehicle, &tires_of(p));
        let [delay_s, gain, offset, lever, v_y_bias, yaw_rate_bias] =
            [p[SIGNALS], p[SIGNALS + 1], p[SIGNALS + 2], p[SIGNALS + 3], p[SIGNALS + 4], p[SIGNALS + 5]];
        let delay_samples = delay_s / segment.dt_s;
        let input = |k: usize| Input {
            v_x_mps: T::from(segment.v_x_mps[k]),
            steering_rad: delayed(&segment.steering_rad, k, delay_samples) * gain + offset,
        };
        let end = window.from + window.len;
        let slowest = segment.v_x_mps[window.from..end].iter().copied().fold(f64::INFINITY, f64::min);
        let step_s = substep_s(p[0].re().max(p[4].re()), slowest);
        let mut x = State { v_y_mps: start[0], yaw_rate_radps: start[1] };
        let mut here = input(window.from);
        for k in window.from..end {
            out.push(x.v_y_mps + lever * x.yaw_rate_radps + v_y_bias);
            out.push(x.yaw_rate_radps + yaw_rate_bias);
            if k + 1 < end {
                let next = input(k + 1);
                x = model.step(x, &here, &next, segment.dt_s, step_s);
                here = next;
            }
        }
    }

    fn measured(&self, window: &Window, out: &mut Vec<f64>) {
        out.clear();
        let segment = &self.segments[window.segment];
        for k in window.from..window.from + window.len {
            out.push(segment.v_y_mps[k]);
            out.push(segment.yaw_rate_radps[k]);
        }
    }

    fn start_guess(&self, window: &Window) -> [f64; 2] {
        let segment = &self.segments[window.segment];
        [segment.v_y_mps[window.from], segment.yaw_rate_radps[window.from]]
    }
}
