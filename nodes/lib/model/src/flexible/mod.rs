//! Flexible terms: what free functions could explain at best, site by site. The terms of a site can do roughly what any effect of that place
//! does, known or not.
//!
//! All are linear in their parameters, so that one or two Gauss-Newton steps find them; a ridge keeps them small. Scales make the
//! parameters numbers around one; at 0 they leave the model as it is.
//!
//! | site | terms |
//! | --- | --- |
//! | steering | impulse response of 0.2 s, offset, curvature, friction |
//! | front_axle, rear_axle | force over slip, speed, longitudinal acceleration, slip rate; grip over braking, time and place |
//! | loads_and_body | yaw moment over the turn, load that moves or comes with the speed, moments without a force, what the command does |
//! | drive_train | impulse response of the command, force over the speed, yaw moment over the curvature, under and off power |
//! | v_x | scale, with the speed, late |
//! | v_y, yaw_rate, imu | late, scaled, off, shares of the yaw motion |
//! | road_and_wind | pull by the place on the lap, force and moment by the heading |

mod blocks;
mod series;
#[cfg(test)]
mod tests;

use gripsight_vehicle::Real;

use crate::recording::{Recording, Run};
use crate::site::Site;
use crate::terms::{Moment, Outputs, delayed};
use blocks::{Block, DRIVE_LAGS_S, HARMONICS, SENSED, SENSOR_LAGS_S, STEERING_LAGS_S};
use series::{harmonics, increments, rms, slope, weighted};

/// The terms of one site.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Group {
    /// Whose terms they are.
    pub site: Site,
    /// How many parameters they have.
    pub parameters: usize,
}

impl Group {
    /// The group of a site.
    #[must_use]
    pub fn of(site: Site) -> Self {
        Self { site, parameters: blocks::of_site(site).iter().map(|b| b.terms()).sum() }
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

/// The terms of some sites, with their scales.
#[derive(Debug, Clone)]
pub struct Flexible {
    blocks: Vec<Block>,
    groups: Vec<Group>,
    slip_rad: f64,
    speed_mps: f64,
    a_x_mps2: f64,
    a_y_mps2: f64,
    yaw_acceleration: f64,
    steering_rad: f64,
    steering_rate_radps: f64,
    minutes: f64,
    /// Sizes of the signals in [`SENSED`]; nothing of those that the fitted recording lacks.
    sensed: [Option<f64>; 3],
}

impl Flexible {
    /// The terms of some sites, in that order. Scales are taken from a recording; `slip_rad` is a large slip angle of the fitted model on it.
    #[must_use]
    pub fn new(recording: &Recording, slip_rad: f64, wheelbase_m: f64, sites: &[Site]) -> Self {
        let runs = &recording.runs;
        let speed_mps = recording.typical_speed_mps().max(0.5);
        let yaw = rms(runs.iter().flat_map(|r| r.measured[1].iter().copied()));
        let rate =
            |r: &Run| (0..r.len()).map(|k| slope(r.steering_course_rad(), k, r.dt_s)).collect::<Vec<_>>();
        Self {
            blocks: sites.iter().flat_map(|site| blocks::of_site(*site)).copied().collect(),
            groups: sites.iter().copied().map(Group::of).collect(),
            slip_rad: slip_rad.max(0.005),
            speed_mps,
            a_x_mps2: rms(runs.iter().flat_map(|r| r.a_x_mps2.iter().copied())),
            a_y_mps2: (yaw * speed_mps).max(0.5),
            yaw_acceleration: (yaw * speed_mps / wheelbase_m).max(0.5),
            steering_rad: rms(runs.iter().flat_map(|r| r.steering_course_rad().iter().copied())),
            steering_rate_radps: rms(runs.iter().flat_map(rate)),
            minutes: (recording.recorded_s / 60.0).max(1e-3),
            sensed: SENSED.map(|(_, channel)| {
                let place = recording.channels.iter().position(|c| *c == channel)?;
                Some(rms(runs.iter().flat_map(|r| r.measured[place].iter().copied())))
            }),
        }
    }

    /// How many parameters there are.
    #[must_use]
    pub fn parameters(&self) -> usize {
        self.blocks.iter().map(|b| b.terms()).sum()
    }

    /// The same scales for the terms of some of the sites.
    #[must_use]
    pub fn with_sites(&self, sites: &[Site]) -> Self {
        let blocks = sites.iter().flat_map(|site| blocks::of_site(*site)).copied().collect();
        Self { blocks, groups: sites.iter().copied().map(Group::of).collect(), ..self.clone() }
    }

    /// The sites with their parameters, in the parameters' order.
    #[must_use]
    pub fn groups(&self) -> &[Group] {
        &self.groups
    }

    /// A block's own parameters, where it is open.
    fn of<'p, T>(&self, p: &'p [T], block: Block) -> Option<&'p [T]> {
        let place = self.blocks.iter().position(|b| *b == block)?;
        let from: usize = self.blocks[..place].iter().map(|b| b.terms()).sum();
        Some(&p[from..from + block.terms()])
    }

    /// Adds to the road-wheel angles; the first of them belongs to sample `from` of the run.
    pub(crate) fn steer<T: Real>(&self, p: &[T], run: &Run, from: usize, angles: &mut [T]) {
        let Some(own) = self.of(p, Block::Steering) else { return };
        let (size, course) = (self.steering_rad, run.steering_course_rad());
        for (i, angle) in angles.iter_mut().enumerate() {
            let k = (from + i).min(run.len() - 1);
            let u = course[k] / size;
            let mut terms = [0.0; Block::Steering.terms()];
            increments(&mut terms, course, k, &STEERING_LAGS_S, run.dt_s, size);
            let rate = slope(course, k, run.dt_s) / self.steering_rate_radps;
            let rest =
                [0.3, 0.1 * u * u.abs(), 0.1 * u.powi(3), 0.3 * (3.0 * rate).tanh(), 0.1 * rate * rate.abs()];
            terms[STEERING_LAGS_S.len()..].copy_from_slice(&rest);
            *angle += weighted(&terms, own) * (0.3 * size);
        }
    }

    /// The true forward speed over the recorded one, where that is open.
    pub(crate) fn speed_factor<T: Real>(&self, p: &[T], v_x_mps: f64, a_x_mps2: f64) -> Option<T> {
        let own = self.of(p, Block::Speed)?;
        let terms = [1.0, v_x_mps / self.speed_mps - 1.0, a_x_mps2 / self.a_x_mps2];
        Some(weighted(&terms, own) * SPEED_SHARE + 1.0)
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
        if !self.blocks.iter().any(|b| b.is_of_the_tires()) {
            return [zero; 2];
        }
        let a_x = at.a_x_mps2 / self.a_x_mps2;
        let fast = at.v_x_mps / self.speed_mps - 1.0;
        let slip = slip_rad.map(|slip| (slip / self.slip_rad).tanh());
        let mut force = [zero; 2];
        for (i, (stiff, grip)) in AXLES.into_iter().enumerate() {
            let s = slip[i];
            if let Some(own) = self.of(p, stiff) {
                let memory = slip_rate_radps[i] / at.v_x_mps * (0.1 * self.speed_mps / self.slip_rad);
                let terms: [T; Block::FrontForce.terms()] =
                    [T::from(1.0), s, s * s * s, s * s, s * fast, s * s * s * fast, s * a_x, memory];
                force[i] = terms.iter().zip(own).fold(zero, |sum, (t, c)| sum + *t * *c) * 0.1;
            }
            if let Some(own) = self.of(p, grip) {
                let place: [f64; 2 * HARMONICS] = harmonics(at.place_rad);
                let mut shares = [0.0; 1 + 2 * HARMONICS];
                shares[0] = 2.0 * at.minutes / self.minutes - 1.0;
                shares[1..].copy_from_slice(&place);
                let of_brakes = s * (own[0] * (a_x * a_x)) + s * s * s * (own[1] * a_x);
                force[i] += (of_brakes + s * s * s * weighted(&shares, &own[2..])) * 0.1;
            }
        }
        let mut moment = zero;
        let turn = at.yaw_rate_radps * at.v_x_mps / self.a_y_mps2;
        if let Some(rest) = self.of(p, Block::Moment) {
            moment = (rest[0] * turn + rest[1] * turn * a_x + rest[2] * turn * fast) * 0.1;
        }
        if let Some(own) = self.of(p, Block::Loads) {
            let cubes = slip.map(|s| s * s * s);
            let lift = at.v_x_mps * at.v_x_mps / (self.speed_mps * self.speed_mps) - 1.0;
            for (i, sign) in [-0.1, 0.1].into_iter().enumerate() {
                let moved = (slip[i] * own[0] + cubes[i] * own[1]) * (sign * a_x);
                force[i] += moved + cubes[i] * lift * own[2 + i] * 0.1;
            }
            moment += (slip[0] * own[4] + slip[1] * own[5]) * 0.1;
        }
        if let Some(own) = self.of(p, Block::Differential) {
            let curvature =
                at.yaw_rate_radps / at.v_x_mps * (self.speed_mps * self.speed_mps / self.a_y_mps2);
            moment += curvature * own[usize::from(at.force_x_mps2 <= 0.0)] * 0.1;
        }
        let [front, rear] = force;
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
        if let Some(own) = self.of(p, Block::Drive) {
            let mut terms = [0.0; Block::Drive.terms()];
            increments(&mut terms, &run.force_x_mps2, k, &DRIVE_LAGS_S, run.dt_s, self.a_x_mps2);
            let f = terms[0];
            let a_y = run.v_x_mps[k] * run.smooth[1][k] / self.a_y_mps2;
            terms[DRIVE_LAGS_S.len()..].copy_from_slice(&[1.0, v, v * v, f * f.abs(), a_y * a_y]);
            push.force_x_mps2 += weighted(&terms, own) * (0.1 * self.a_x_mps2);
        }
        if let Some(own) = self.of(p, Block::Mass) {
            push.force_x_mps2 += own[0] * (0.1 * run.force_x_mps2[k]);
        }
        if let Some(own) = self.of(p, Block::Outside) {
            let lap: [f64; 2 * HARMONICS] = harmonics(run.place_rad[k]);
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
        let rate: Vec<T> = out.yaw_rate_radps.clone();
        let turn = |r: T| r * (self.speed_mps / self.a_y_mps2);
        for ((block, _), size) in SENSED.into_iter().zip(self.sensed) {
            let (Some(own), Some(size)) = (self.of(p, block), size) else { continue };
            let series = match block {
                Block::LateralVelocity => &mut out.v_y_mps,
                Block::YawRate => &mut out.yaw_rate_radps,
                _ => &mut out.a_y_mps2,
            };
            let late = SENSOR_LAGS_S.map(|lag_s| delayed(series, T::from(lag_s), out.dt_s));
            for (k, value) in series.iter_mut().enumerate() {
                let mut more = *value * own[0];
                let mut newer = *value;
                for (late, c) in late.iter().zip(&own[1..]) {
                    more += (late[k] - newer) * *c;
                    newer = late[k];
                }
                let rest = &own[1 + SENSOR_LAGS_S.len()..];
                let twist = out.yaw_acceleration_radps2[k] / self.yaw_acceleration;
                let yaw = rest[0] + rest[1] * turn(rate[k]) + rest[2] * twist;
                *value += more * 0.3 + yaw * (0.1 * size);
            }
        }
        if let Some(own) = self.of(p, Block::LongitudinalAcceleration) {
            for (k, value) in out.a_x_mps2.iter_mut().enumerate() {
                let twist = out.yaw_acceleration_radps2[k] / self.yaw_acceleration;
                let spin = turn(rate[k]);
                *value += (own[0] + own[1] * twist + own[2] * spin * spin) * (0.1 * self.a_x_mps2);
            }
        }
        if let Some(own) = self.of(p, Block::Speed) {
            // The recording says less where the car is faster than it says.
            out.v_x_mps.iter_mut().for_each(|v| *v *= -(own[0] * SPEED_SHARE) + 1.0);
        }
    }
}

/// A parameter of one is that share of the speed.
const SPEED_SHARE: f64 = 0.05;
/// The terms of the axles' forces and grip, front and rear.
const AXLES: [(Block, Block); 2] =
    [(Block::FrontForce, Block::FrontGrip), (Block::RearForce, Block::RearGrip)];
