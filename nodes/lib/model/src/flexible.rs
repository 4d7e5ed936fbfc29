//! Flexible terms: what free functions could explain at best, room by room. A room is a place in which a cause can sit; its terms can do
//! roughly what any effect of that place does, known or not.
//!
//! All are linear in their parameters, so that one or two Gauss-Newton steps find them; a ridge keeps them small. Scales make the
//! parameters numbers around one.

use gripsight_vehicle::Real;

use crate::recording::{Channel, Recording, Run};
use crate::terms::{Moment, Outputs, delayed};

/// Where a cause can sit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Room {
    /// Between the command and the road wheels: a free impulse response of 0.2 s, curvature, friction.
    Steering,
    /// Between the motion and the recorded signals: each signal late, scaled, with shares of the yaw motion.
    Sensors,
    /// Lateral forces over slips, speed and longitudinal acceleration, and their memory.
    Forces,
    /// Longitudinal force over speed and command, and a free impulse response of the command.
    Drive,
    /// From outside: by the place on the lap, and by the heading (wind).
    Outside,
}

/// Lags of the steering's free impulse response.
const STEERING_LAGS_S: [f64; 8] = [0.0, 0.02, 0.04, 0.06, 0.09, 0.12, 0.16, 0.21];
const STEERING_TERMS: usize = STEERING_LAGS_S.len() + 5;
/// Lags of a signal's free impulse response.
const SENSOR_LAGS_S: [f64; 3] = [0.02, 0.05, 0.1];
const SENSOR_TERMS: usize = SENSOR_LAGS_S.len() + 4;
/// Signals that have terms of their own.
const SENSED: [Channel; 3] = [Channel::LateralVelocity, Channel::YawRate, Channel::LateralAcceleration];
/// Terms of one axle's force, and of the yaw moment besides.
const AXLE_TERMS: usize = 8;
const FORCE_TERMS: usize = 2 * AXLE_TERMS + 3;
/// Lags of the longitudinal command's free impulse response.
const DRIVE_LAGS_S: [f64; 4] = [0.0, 0.05, 0.12, 0.25];
const DRIVE_TERMS: usize = DRIVE_LAGS_S.len() + 5;
/// Harmonics of the lap, and terms of the wind.
const HARMONICS: usize = 2;
const OUTSIDE_TERMS: usize = 4 * HARMONICS + 8;

impl Room {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Steering, Self::Sensors, Self::Forces, Self::Drive, Self::Outside];

    /// In the result.
    pub fn name(self) -> &'static str {
        match self {
            Self::Steering => "steering",
            Self::Sensors => "sensors",
            Self::Forces => "lateral_forces",
            Self::Drive => "longitudinal_forces",
            Self::Outside => "road_and_wind",
        }
    }

    fn terms(self) -> usize {
        match self {
            Self::Steering => STEERING_TERMS,
            Self::Sensors => SENSOR_TERMS * SENSED.len(),
            Self::Forces => FORCE_TERMS,
            Self::Drive => DRIVE_TERMS,
            Self::Outside => OUTSIDE_TERMS,
        }
    }
}

/// Accelerations from outside the tires.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Push<T> {
    pub(crate) force_x_mps2: T,
    pub(crate) force_y_mps2: T,
    pub(crate) gravity_x_mps2: T,
    pub(crate) gravity_y_mps2: T,
    pub(crate) yaw_radps2: T,
}

/// The terms of some rooms, with their scales.
#[derive(Debug, Clone)]
pub struct Flexible {
    rooms: Vec<Room>,
    slip_rad: f64,
    speed_mps: f64,
    a_x_mps2: f64,
    a_y_mps2: f64,
    yaw_acceleration: f64,
    steering_rad: f64,
    steering_rate_radps: f64,
    /// Sizes of the signals in [`SENSED`]; nothing of those that the fitted recording lacks.
    sensed: [Option<f64>; 3],
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (n, square) = values.fold((0.0_f64, 0.0), |(n, s), v| (n + 1.0, s + v * v));
    (square / n.max(1.0)).sqrt().max(1e-6)
}

fn slope(series: &[f64], k: usize, dt_s: f64) -> f64 {
    let (a, b) = (k.saturating_sub(1), (k + 1).min(series.len() - 1));
    (series[b] - series[a]) / ((b - a).max(1) as f64 * dt_s)
}

/// The value `lag_s` before sample `k`.
fn before(series: &[f64], k: usize, lag_s: f64, dt_s: f64) -> f64 {
    let place = (k as f64 - lag_s / dt_s).max(0.0);
    let left = (place as usize).min(series.len() - 1);
    let right = (left + 1).min(series.len() - 1);
    series[left] + (series[right] - series[left]) * (place - left as f64)
}

fn weighted<T: Real>(terms: &[f64], p: &[T]) -> T {
    terms.iter().zip(p).fold(T::from(0.0), |s, (t, c)| s + *c * *t)
}

impl Flexible {
    /// Scales taken from a recording; `slip_rad` is a large slip angle of the fitted model on it.
    pub fn new(recording: &Recording, slip_rad: f64, wheelbase_m: f64, rooms: &[Room]) -> Self {
        let runs = &recording.runs;
        let speed_mps = recording.typical_speed_mps().max(0.5);
        let yaw = rms(runs.iter().flat_map(|r| r.measured[1].iter().copied()));
        let rate = |r: &Run| (0..r.len()).map(|k| slope(&r.steering_rad, k, r.dt_s)).collect::<Vec<_>>();
        Self {
            rooms: rooms.to_vec(),
            slip_rad: slip_rad.max(0.005),
            speed_mps,
            a_x_mps2: rms(runs.iter().flat_map(|r| r.a_x_mps2.iter().copied())),
            a_y_mps2: (yaw * speed_mps).max(0.5),
            yaw_acceleration: (yaw * speed_mps / wheelbase_m).max(0.5),
            steering_rad: rms(runs.iter().flat_map(|r| r.steering_rad.iter().copied())),
            steering_rate_radps: rms(runs.iter().flat_map(rate)),
            sensed: SENSED.map(|channel| {
                let place = recording.channels.iter().position(|c| *c == channel)?;
                Some(rms(runs.iter().flat_map(|r| r.measured[place].iter().copied())))
            }),
        }
    }

    /// How many parameters there are.
    pub fn parameters(&self) -> usize {
        self.rooms.iter().map(|r| r.terms()).sum()
    }

    /// A room's own parameters, where it is open.
    fn of<'p, T>(&self, p: &'p [T], room: Room) -> Option<&'p [T]> {
        let place = self.rooms.iter().position(|r| *r == room)?;
        let from: usize = self.rooms[..place].iter().map(|r| r.terms()).sum();
        Some(&p[from..from + room.terms()])
    }

    /// Adds to the road-wheel angles; the first of them belongs to sample `from` of the run.
    pub(crate) fn steer<T: Real>(&self, p: &[T], run: &Run, from: usize, angles: &mut [T]) {
        let Some(own) = self.of(p, Room::Steering) else { return };
        let size = self.steering_rad;
        for (i, angle) in angles.iter_mut().enumerate() {
            let k = (from + i).min(run.len() - 1);
            let u = run.steering_rad[k] / size;
            let mut terms = [0.0; STEERING_TERMS];
            for (term, lag_s) in terms.iter_mut().zip(STEERING_LAGS_S) {
                *term = before(&run.steering_rad, k, lag_s, run.dt_s) / size;
            }
            let rate = slope(&run.steering_rad, k, run.dt_s) / self.steering_rate_radps;
            let rest =
                [0.3, 0.1 * u * u.abs(), 0.1 * u.powi(3), 0.3 * (3.0 * rate).tanh(), 0.1 * rate * rate.abs()];
            terms[STEERING_LAGS_S.len()..].copy_from_slice(&rest);
            *angle += weighted(&terms, own) * (0.3 * size);
        }
    }

    /// Additional lateral and yaw acceleration from the tires.
    pub(crate) fn forces<T: Real>(
        &self,
        p: &[T],
        at: &Moment<T>,
        slip_rad: [T; 2],
        slip_rate_radps: [T; 2],
    ) -> [T; 2] {
        let zero = T::from(0.0);
        let Some(own) = self.of(p, Room::Forces) else { return [zero; 2] };
        let a_x = at.a_x_mps2 / self.a_x_mps2;
        let fast = at.v_x_mps / self.speed_mps - 1.0;
        let axle = |i: usize| {
            let s = (slip_rad[i] / self.slip_rad).tanh();
            let memory = slip_rate_radps[i] / at.v_x_mps * (0.1 * self.speed_mps / self.slip_rad);
            let terms: [T; AXLE_TERMS] =
                [T::from(1.0), s, s * s * s, s * s, s * fast, s * s * s * fast, s * a_x, memory];
            terms.iter().zip(&own[AXLE_TERMS * i..]).fold(zero, |sum, (t, c)| sum + *t * *c) * 0.1
        };
        let (front, rear) = (axle(0), axle(1));
        let turn = at.yaw_rate_radps * at.v_x_mps / self.a_y_mps2;
        let rest = &own[2 * AXLE_TERMS..];
        let moment = (rest[0] * turn + rest[1] * turn * a_x + rest[2] * turn * fast) * 0.1;
        [(front + rear) * self.a_y_mps2, (front - rear + moment) * self.yaw_acceleration]
    }

    /// Accelerations from outside the tires at sample `k` of a run.
    pub(crate) fn push<T: Real>(&self, p: &[T], run: &Run, k: usize) -> Push<T> {
        let zero = T::from(0.0);
        let mut push = Push {
            force_x_mps2: zero,
            force_y_mps2: zero,
            gravity_x_mps2: zero,
            gravity_y_mps2: zero,
            yaw_radps2: zero,
        };
        let v = run.v_x_mps[k] / self.speed_mps;
        if let Some(own) = self.of(p, Room::Drive) {
            let mut terms = [0.0; DRIVE_TERMS];
            for (term, lag_s) in terms.iter_mut().zip(DRIVE_LAGS_S) {
                *term = before(&run.force_x_mps2, k, lag_s, run.dt_s) / self.a_x_mps2;
            }
            let f = terms[0];
            let a_y = run.v_x_mps[k] * run.smooth[1][k] / self.a_y_mps2;
            terms[DRIVE_LAGS_S.len()..].copy_from_slice(&[1.0, v, v * v, f * f.abs(), a_y * a_y]);
            push.force_x_mps2 += weighted(&terms, own) * (0.1 * self.a_x_mps2);
        }
        if let Some(own) = self.of(p, Room::Outside) {
            let mut lap = [0.0; 2 * HARMONICS];
            for (i, pair) in lap.chunks_mut(2).enumerate() {
                let (sin, cos) = ((i + 1) as f64 * run.place_rad[k]).sin_cos();
                pair.copy_from_slice(&[sin, cos]);
            }
            let (sin, cos) = run.heading_rad[k].sin_cos();
            let wind = [sin, cos, v * sin, v * cos];
            let (across, rest) = own.split_at(2 * HARMONICS);
            let (along, rest) = rest.split_at(2 * HARMONICS);
            push.gravity_y_mps2 += weighted(&lap, across) * 0.3;
            push.gravity_x_mps2 += weighted(&lap, along) * 0.3;
            push.force_y_mps2 += weighted(&wind, &rest[..4]) * (0.1 * self.a_y_mps2);
            push.yaw_radps2 += weighted(&wind[2..], &rest[4..6]) * (0.1 * self.yaw_acceleration);
            push.force_x_mps2 += weighted(&wind[2..], &rest[6..8]) * (0.1 * self.a_x_mps2);
        }
        push
    }

    /// Adds to the signals.
    pub(crate) fn sense<T: Real>(&self, p: &[T], out: &mut Outputs<T>) {
        let Some(own) = self.of(p, Room::Sensors) else { return };
        let rate: Vec<T> = out.yaw_rate_radps.clone();
        for (c, channel) in SENSED.into_iter().enumerate() {
            let Some(size) = self.sensed[c] else { continue };
            let own = &own[SENSOR_TERMS * c..][..SENSOR_TERMS];
            let series = match channel {
                Channel::LateralVelocity => &mut out.v_y_mps,
                Channel::YawRate => &mut out.yaw_rate_radps,
                _ => &mut out.a_y_mps2,
            };
            let late = SENSOR_LAGS_S.map(|lag_s| delayed(series, T::from(lag_s), out.dt_s));
            for (k, value) in series.iter_mut().enumerate() {
                let mut more = *value * own[0];
                for (late, c) in late.iter().zip(&own[1..]) {
                    more += late[k] * *c;
                }
                let rest = &own[1 + SENSOR_LAGS_S.len()..];
                let turn = rate[k] * (self.speed_mps / self.a_y_mps2);
                let twist = out.yaw_acceleration_radps2[k] / self.yaw_acceleration;
                let yaw = rest[0] + rest[1] * turn + rest[2] * twist;
                *value += more * 0.3 + yaw * (0.1 * size);
            }
        }
    }
}
