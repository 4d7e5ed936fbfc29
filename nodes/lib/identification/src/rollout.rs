//! The single-track model behind imperfect signals, as the shooting engine runs it.
//!
//! Beyond [`SingleTrack`] it shifts load between the axles as the car brakes and accelerates, F_zf = F_zf0 - m a_x h/L, from the known height of
//! the centre of gravity: F_y/F_z is the tires' own only with the load that was on them. And the slip that makes the force follows the slip of
//! the axle over a relaxation length, d(alpha')/dt = (alpha - alpha') v_x/sigma: without it the lag of a real tire reads as stiffness, delay and lever arm.
//! And driving and braking take from the lateral force along the friction ellipse, F_y sqrt(1 - (k F_x/(D F_z))^2), F_x from the acceleration and the
//! known split of drive and brake; the front wheels' F_x pulls to the side that they are turned to. That acceleration is what moves the car and what
//! the turned front wheels brake: F_x = m a_x + F_yf sin d.
//!
//! The front wheel on the outside of a corner carries more load, gives more of F_yf, and so brakes more of it where it is turned by d:
//! that turns the car out of the corner by (F_outer - F_inner) (t/2) sin d. Where both axles share the load transfer as they do the weight,
//! F_outer - F_inner = F_yf (F_yf/F_zf) 2 h/t: the moment F_yf (F_yf/F_zf) h sin d needs neither the track width t nor a parameter. It is 0.95 to 1.2 times
//! that in plants that have wheels, and 2 to 4 % of the moment of the rear axle.
//!
//! Relaxation length, k and the share of m a_x h/L that really is shifted (springs, and tires that gain less grip than load) are nuisances of the
//! estimation, not results: Phi_p goes to models that have none of them.
//!
//! The scales of v_x and yaw rate and the share of the sideslip that v_y shows are held at one while tires are fitted, and opened when it is asked how well
//! those are known: hardly any drive tells a scale from the tires, so that what nothing checks of a signal is in the intervals.

mod vector;

use gripsight_model::{Rollout, Window};
use gripsight_signals::Segment;
use gripsight_vehicle::{GRAVITY_MPS2, Input, MagicFormula, Real, SingleTrack, State, VehicleParameters};

use crate::data::Data;

pub use vector::Nuisance;
pub(crate) use vector::{
    COMBINED, NAMES, PARAMETERS, RELAXATION, SIGNALS, SLIP_SHARE, TRANSFER, V_X_SCALE, YAW_RATE_SCALE,
    corrections_of, nuisance_of, tires_of, vector_of,
};

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
    v_x_mps: T,
    steering_rad: T,
    /// Share of the front and of the rear static load that is on the axle.
    load: [T; 2],
    /// Longitudinal over vertical force of either axle.
    pull: [T; 2],
    /// Longitudinal force of the front axle.
    front_pull_n: T,
}

/// What a rollout shows at a sample.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Visit<T = f64> {
    pub(crate) state: State<T>,
    pub(crate) input: Input<T>,
    /// Slips, front and rear, that make the force: behind those of the axles by the relaxation length.
    pub(crate) slip_rad: (T, T),
    pull: [T; 2],
}

impl Visit {
    /// F_y/F_z of the front and the rear axle, with what the longitudinal forces leave of them.
    pub(crate) fn normalized_forces(&self, p: &[f64]) -> (f64, f64) {
        let (tires, combined) = (tires_of(p), p[COMBINED]);
        (
            left_beside(&tires.front, combined, self.slip_rad.0, self.pull[0]),
            left_beside(&tires.rear, combined, self.slip_rad.1, self.pull[1]),
        )
    }
}

/// F_y/F_z at a slip beside a longitudinal force.
fn left_beside<T: Real>(tire: &MagicFormula<T>, combined: T, slip: T, pull: T) -> T {
    let (d, k, pull_share) = (tire.d.re(), combined.re(), pull.re());
    let used = k * pull_share / d;
    let left = 1.0 - used * used;
    let left = if left > LEAST_LEFT {
        let left = left.sqrt();
        let by = -used / (d * left);
        T::chain(left, [(by * pull_share, &combined), (-by * used, &tire.d), (by * k, &pull)])
    } else {
        T::from(LEAST_LEFT.sqrt())
    };
    tire.normalized_force(slip) * left
}

/// Square of the share of the lateral force that is always left beside the longitudinal.
const LEAST_LEFT: f64 = 0.1;
/// An axle never loses more of its load than this in the model: beyond, wheels lift and the model ends.
const LEAST_LOAD: f64 = 0.2;

impl<'a> TireRollout<'a> {
    pub(crate) fn new(vehicle: &'a VehicleParameters, data: &'a Data) -> Self {
        Self { vehicle, segments: &data.segments, a_x_mps2: &data.a_x_mps2 }
    }

    /// Runs over a window, signals corrected, and shows every sample.
    pub(crate) fn trajectory<T: Real>(
        &self,
        p: &[T],
        start: [T; 2],
        window: &Window,
        mut visit: impl FnMut(&Visit<T>),
    ) {
        let segment = &self.segments[window.segment];
        let car = SingleTrack::new(self.vehicle, &tires_of(p));
        let delay_samples = p[SIGNALS] / segment.dt_s;
        let (front_n, rear_n) = (self.vehicle.static_load_front_n(), self.vehicle.static_load_rear_n());
        let transfer_kg = self.vehicle.mass_kg * self.vehicle.h_cg_m / self.vehicle.wheelbase_m();
        let faster = p[V_X_SCALE].recip();
        let least = |load: T| if load.re() < LEAST_LOAD { T::from(LEAST_LOAD) } else { load };
        let drive = |k: usize| {
            let shifted_n = p[TRANSFER] * (transfer_kg * self.a_x_mps2[window.segment][k]);
            let steering_rad =
                delayed(&segment.steering_rad, k, delay_samples) * p[SIGNALS + 1] + p[SIGNALS + 2];
            let load = [least(-shifted_n / front_n + 1.0), least(shifted_n / rear_n + 1.0)];
            // What the tires give along the car: also what the turned front wheels brake.
            let across_mps2 = self.vehicle.l_r_m / self.vehicle.wheelbase_m()
                * segment.v_x_mps[k]
                * segment.yaw_rate_radps[k];
            let force_n =
                (steering_rad.sin() * across_mps2 + self.a_x_mps2[window.segment][k]) * self.vehicle.mass_kg;
            let driving = force_n.re() > 0.0;
            let front =
                if driving { self.vehicle.front_drive_share() } else { self.vehicle.front_brake_share() };
            let front_pull_n = force_n * front;
            let pull = [
                load[0].recip() * front_pull_n * (1.0 / front_n),
                load[1].recip() * force_n * ((1.0 - front) / rear_n),
            ];
            Drive { v_x_mps: faster * segment.v_x_mps[k], steering_rad, load, pull, front_pull_n }
        };
        let end = window.from + window.len;
        let slowest = segment.v_x_mps[window.from..end].iter().copied().fold(f64::INFINITY, f64::min);
        let longest_s = substep_s(p[0].re().max(p[4].re()), slowest);
        let substeps = (segment.dt_s / longest_s - 1e-9).ceil().max(1.0) as usize;
        let h_s = segment.dt_s / substeps as f64;
        let mut x = State { v_y_mps: start[0], yaw_rate_radps: start[1] };
        let mut here = drive(window.from);
        let mut slip = car.slip_angles_rad(&x, &here.input());
        // The steering part of the front slip lags from the start.
        let lag_samples = p[RELAXATION] / (segment.v_x_mps[window.from].max(1.0) * segment.dt_s);
        let before = delayed(&segment.steering_rad, window.from, delay_samples + lag_samples)
            * p[SIGNALS + 1]
            + p[SIGNALS + 2];
        slip.0 += before - here.steering_rad;
        for k in window.from..end {
            visit(&Visit { state: x, input: here.input(), slip_rad: slip, pull: here.pull });
            if k + 1 == end {
                break;
            }
            let next = drive(k + 1);
            // Shares of the way that the lagging slip goes in half a substep and in a whole one.
            let half = -(-(p[RELAXATION].recip() * (0.5 * h_s * segment.v_x_mps[k]))).exp() + 1.0;
            let whole = half * (-half + 2.0);
            for i in 0..substeps {
                // The midpoint rule, inputs linear over the sample.
                let at = here.towards(&next, i as f64 / substeps as f64);
                let slope = self.derivative(&car, p[COMBINED], &x, &at, slip);
                let middle = moved(&x, &slope, 0.5 * h_s);
                let at = here.towards(&next, (i as f64 + 0.5) / substeps as f64);
                let target = car.slip_angles_rad(&middle, &at.input());
                let follow =
                    |share: T| (between(&slip.0, &target.0, share), between(&slip.1, &target.1, share));
                let slope = self.derivative(&car, p[COMBINED], &middle, &at, follow(half));
                slip = follow(whole);
                x = moved(&x, &slope, h_s);
            }
            here = next;
        }
    }

    fn derivative<T: Real>(
        &self,
        car: &SingleTrack<T>,
        combined: T,
        x: &State<T>,
        drive: &Drive<T>,
        slip: (T, T),
    ) -> State<T> {
        let v = self.vehicle;
        let front = left_beside(&car.front, combined, slip.0, drive.pull[0]);
        let rear = left_beside(&car.rear, combined, slip.1, drive.pull[1]);
        let static_n = [v.static_load_front_n(), v.static_load_rear_n()];
        let loads_n = [static_n[0] * drive.load[0].re(), static_n[1] * drive.load[1].re()];
        let (sin, cos) = drive.steering_rad.re().sin_cos();
        let (across_n, along_n) = (front.re() * loads_n[0], drive.front_pull_n.re());
        let (front_n, rear_n) = (across_n * cos + along_n * sin, rear.re() * loads_n[1]);
        let drag_m = v.h_cg_m * front.re();
        // The same line for v_y and yaw rate: what a newton at the front and one at the rear do, and what the front wheels' drag does.
        let rate = |value: f64, by_front: f64, by_drag: f64, by_rear: f64, by_turning: [f64; 2]| {
            let slope = by_front * cos - by_drag * drag_m * sin;
            let turned = by_front * (along_n * cos - across_n * sin) - by_drag * drag_m * across_n * cos;
            T::chain(
                value,
                [
                    (loads_n[0] * (slope - by_drag * drag_m * sin), &front),
                    (static_n[0] * front.re() * slope, &drive.load[0]),
                    (turned, &drive.steering_rad),
                    (by_front * sin, &drive.front_pull_n),
                    (by_rear * loads_n[1], &rear),
                    (by_rear * rear.re() * static_n[1], &drive.load[1]),
                    (by_turning[0], &x.yaw_rate_radps),
                    (by_turning[1], &drive.v_x_mps),
                ],
            )
        };
        let (mass_kg, inertia_kgm2) = (v.mass_kg, v.yaw_inertia_kgm2);
        let (v_x_mps, yaw_rate_radps) = (drive.v_x_mps.re(), x.yaw_rate_radps.re());
        State {
            v_y_mps: rate(
                (rear_n + front_n) / mass_kg - v_x_mps * yaw_rate_radps,
                1.0 / mass_kg,
                0.0,
                1.0 / mass_kg,
                [-v_x_mps, -yaw_rate_radps],
            ),
            yaw_rate_radps: rate(
                (front_n * v.l_f_m - across_n * drag_m * sin - rear_n * v.l_r_m) / inertia_kgm2,
                v.l_f_m / inertia_kgm2,
                1.0 / inertia_kgm2,
                -v.l_r_m / inertia_kgm2,
                [0.0; 2],
            ),
        }
    }
}

impl<T: Real> Drive<T> {
    fn input(&self) -> Input<T> {
        Input { v_x_mps: self.v_x_mps, steering_rad: self.steering_rad }
    }

    fn towards(&self, next: &Self, share: f64) -> Self {
        Self {
            v_x_mps: between(&self.v_x_mps, &next.v_x_mps, T::from(share)),
            steering_rad: between(&self.steering_rad, &next.steering_rad, T::from(share)),
            load: std::array::from_fn(|i| self.load[i] + (next.load[i] - self.load[i]) * share),
            pull: std::array::from_fn(|i| self.pull[i] + (next.pull[i] - self.pull[i]) * share),
            front_pull_n: between(&self.front_pull_n, &next.front_pull_n, T::from(share)),
        }
    }
}

/// A share of the way from one to the other.
fn between<T: Real>(from: &T, to: &T, share: T) -> T {
    let (way, part) = (to.re() - from.re(), share.re());
    T::chain(from.re() + way * part, [(1.0 - part, from), (part, to), (way, &share)])
}

fn moved<T: Real>(x: &State<T>, slope: &State<T>, h_s: f64) -> State<T> {
    let along = |x: &T, slope: &T| T::chain(x.re() + slope.re() * h_s, [(1.0, x), (h_s, slope)]);
    State {
        v_y_mps: along(&x.v_y_mps, &slope.v_y_mps),
        yaw_rate_radps: along(&x.yaw_rate_radps, &slope.yaw_rate_radps),
    }
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
        let (slip_share, scale) = (p[SLIP_SHARE], p[YAW_RATE_SCALE]);
        // Sideslip is what the rear axle does beside rolling.
        let arm = (-slip_share + 1.0) * self.vehicle.l_r_m + lever;
        self.trajectory(p, start, window, |at| {
            out.push(slip_share * at.state.v_y_mps + arm * at.state.yaw_rate_radps + v_y_bias);
            out.push(scale * at.state.yaw_rate_radps + yaw_rate_bias);
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

#[cfg(test)]
mod tests;
