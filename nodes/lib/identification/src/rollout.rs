//! The single-track model behind imperfect signals, as the shooting engine runs it.
//!
//! Beyond [`SingleTrack`] it shifts load between the axles as the car brakes and accelerates, F_zf = F_zf0 - m a_x h/L, from the known height of
//! the centre of gravity: F_y/F_z is the tires' own only with the load that was on them. And the slip that makes the force follows the slip of
//! the axle over a relaxation length, d(alpha')/dt = (alpha - alpha') v_x/sigma: without it the lag of a real tire reads as stiffness, delay and lever arm.

use gripsight_signals::Segment;
use gripsight_vehicle::{
    GRAVITY_MPS2, Input, MagicFormula, PacejkaParameters, Real, SingleTrack, State, VehicleParameters,
};

use crate::SignalCorrections;
use crate::data::Data;
use crate::shooting::{Rollout, Window};

/// Number of parameters of [`TireRollout`]: (k, C, D, E) front and rear with k = B C D, the
/// signal corrections, and the tires' relaxation length.
pub(crate) const PARAMETERS: usize = 15;
/// Place of the first signal correction.
pub(crate) const SIGNALS: usize = 8;
/// Place of the relaxation length.
pub(crate) const RELAXATION: usize = 14;
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
    "relaxation_m",
];

/// Predicts what the sensors report of v_y and yaw rate.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TireRollout<'a> {
    pub(crate) vehicle: &'a VehicleParameters,
    pub(crate) segments: &'a [Segment],
    /// Forward acceleration at every sample of every segment, m/s2.
    pub(crate) a_x_mps2: &'a [Vec<f64>],
}

/// Input and load transfer at a sample.
#[derive(Debug, Clone, Copy)]
struct Drive<T> {
    input: Input<T>,
    /// Share of the front and of the rear static load that is on the axle.
    load: [f64; 2],
}

/// An axle never loses more of its load than this in the model: beyond, wheels lift and the model ends.
const LEAST_LOAD: f64 = 0.2;

impl<'a> TireRollout<'a> {
    pub(crate) fn new(vehicle: &'a VehicleParameters, data: &'a Data) -> Self {
        Self { vehicle, segments: &data.segments, a_x_mps2: &data.a_x_mps2 }
    }

    /// States and inputs, signals corrected, at every sample of a window.
    pub(crate) fn trajectory<T: Real>(
        &self,
        p: &[T],
        start: [T; 2],
        window: &Window,
        mut visit: impl FnMut(&State<T>, &Input<T>),
    ) {
        let segment = &self.segments[window.segment];
        let car = SingleTrack::new(self.vehicle, &tires_of(p));
        let delay_samples = p[SIGNALS] / segment.dt_s;
        let (front_n, rear_n) = (self.vehicle.static_load_front_n(), self.vehicle.static_load_rear_n());
        let transfer_kg = self.vehicle.mass_kg * self.vehicle.h_cg_m / self.vehicle.wheelbase_m();
        let drive = |k: usize| {
            let shifted_n = transfer_kg * self.a_x_mps2[window.segment][k];
            let steering_rad =
                delayed(&segment.steering_rad, k, delay_samples) * p[SIGNALS + 1] + p[SIGNALS + 2];
            Drive {
                input: Input { v_x_mps: T::from(segment.v_x_mps[k]), steering_rad },
                load: [
                    (1.0 - shifted_n / front_n).max(LEAST_LOAD),
                    (1.0 + shifted_n / rear_n).max(LEAST_LOAD),
                ],
            }
        };
        let end = window.from + window.len;
        let slowest = segment.v_x_mps[window.from..end].iter().copied().fold(f64::INFINITY, f64::min);
        let longest_s = substep_s(p[0].re().max(p[4].re()), slowest);
        let substeps = (segment.dt_s / longest_s - 1e-9).ceil().max(1.0) as usize;
        let h_s = segment.dt_s / substeps as f64;
        let mut x = State { v_y_mps: start[0], yaw_rate_radps: start[1] };
        let mut here = drive(window.from);
        let mut slip = car.slip_angles_rad(&x, &here.input);
        // The steering part of the front slip lags from the start.
        let lag_samples = p[RELAXATION] / (segment.v_x_mps[window.from].max(1.0) * segment.dt_s);
        let before = delayed(&segment.steering_rad, window.from, delay_samples + lag_samples)
            * p[SIGNALS + 1]
            + p[SIGNALS + 2];
        slip.0 += before - here.input.steering_rad;
        for k in window.from..end {
            visit(&x, &here.input);
            if k + 1 == end {
                break;
            }
            let next = drive(k + 1);
            // Shares of the way that the lagging slip goes in half a substep and in a whole one.
            let half = T::one() - (-(T::from(0.5 * h_s * segment.v_x_mps[k]) / p[RELAXATION])).exp();
            let whole = half * (-half + 2.0);
            for i in 0..substeps {
                // The midpoint rule, inputs linear over the sample.
                let at = here.towards(&next, i as f64 / substeps as f64);
                let slope = self.derivative(&car, &x, &at, slip);
                let middle = moved(&x, &slope, 0.5 * h_s);
                let at = here.towards(&next, (i as f64 + 0.5) / substeps as f64);
                let target = car.slip_angles_rad(&middle, &at.input);
                let follow =
                    |share: T| (slip.0 + (target.0 - slip.0) * share, slip.1 + (target.1 - slip.1) * share);
                let slope = self.derivative(&car, &middle, &at, follow(half));
                slip = follow(whole);
                x = moved(&x, &slope, h_s);
            }
            here = next;
        }
    }

    fn derivative<T: Real>(
        &self,
        car: &SingleTrack<T>,
        x: &State<T>,
        drive: &Drive<T>,
        slip: (T, T),
    ) -> State<T> {
        let (v, input) = (self.vehicle, &drive.input);
        let front_n = car.front.normalized_force(slip.0)
            * (v.static_load_front_n() * drive.load[0])
            * input.steering_rad.cos();
        let rear_n = car.rear.normalized_force(slip.1) * (v.static_load_rear_n() * drive.load[1]);
        State {
            v_y_mps: (rear_n + front_n) / v.mass_kg - input.v_x_mps * x.yaw_rate_radps,
            yaw_rate_radps: (front_n * v.l_f_m - rear_n * v.l_r_m) / v.yaw_inertia_kgm2,
        }
    }
}

impl<T: Real> Drive<T> {
    fn towards(&self, next: &Self, share: f64) -> Self {
        Self {
            input: Input {
                v_x_mps: self.input.v_x_mps + (next.input.v_x_mps - self.input.v_x_mps) * share,
                steering_rad: self.input.steering_rad
                    + (next.input.steering_rad - self.input.steering_rad) * share,
            },
            load: std::array::from_fn(|i| self.load[i] + (next.load[i] - self.load[i]) * share),
        }
    }
}

fn moved<T: Real>(x: &State<T>, slope: &State<T>, h_s: f64) -> State<T> {
    State {
        v_y_mps: x.v_y_mps + slope.v_y_mps * h_s,
        yaw_rate_radps: x.yaw_rate_radps + slope.yaw_rate_radps * h_s,
    }
}

/// Tires of a parameter vector.
pub(crate) fn tires_of<T: Real>(p: &[T]) -> PacejkaParameters<T> {
    let axle = |v: &[T]| MagicFormula { b: v[0] / (v[1] * v[2]), c: v[1], d: v[2], e: v[3] };
    PacejkaParameters { front: axle(&p[..4]), rear: axle(&p[4..8]) }
}

/// The parameter vector of tires and corrections.
pub(crate) fn vector_of(
    tires: &PacejkaParameters,
    corrections: &SignalCorrections,
    relaxation_m: f64,
) -> [f64; PARAMETERS] {
    let axle = |f: &MagicFormula| [f.normalized_stiffness(), f.c, f.d, f.e];
    let (front, rear, signals) = (axle(&tires.front), axle(&tires.rear), corrections.to_array());
    std::array::from_fn(|j| match j {
        0..4 => front[j],
        4..8 => rear[j - 4],
        RELAXATION => relaxation_m,
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
        let [lever, v_y_bias, yaw_rate_bias] = [p[SIGNALS + 3], p[SIGNALS + 4], p[SIGNALS + 5]];
        self.trajectory(p, start, window, |x, _| {
            out.push(x.v_y_mps + lever * x.yaw_rate_radps + v_y_bias);
            out.push(x.yaw_rate_radps + yaw_rate_bias);
        });
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
