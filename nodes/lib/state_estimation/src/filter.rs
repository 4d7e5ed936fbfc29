//! The filter: one step of time, one observation at a time.

use nalgebra::{Matrix3, SMatrix, Vector3};
use serde::Serialize;

use crate::events::Observation;
use crate::levels::Levels;
use crate::state::{
    A_X, A_Y, ALPHA, ARM, B_R, B_X, B_Y, Drive, LATE, MOTION, Matrix, N, OFF, PLACE, PSI, R, RATE, SCALE,
    TILT, V_X, V_Y, Vector, X, Y, between, jacobian, rate, step,
};

/// v_x, v_y and yaw rate with their covariance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Motion {
    /// Since the start of the sequence.
    pub time_s: f64,
    /// Forward speed.
    pub v_x_mps: f64,
    /// Lateral speed, left positive, at the point of the poses.
    pub v_y_mps: f64,
    /// Yaw rate.
    pub yaw_rate_radps: f64,
    /// Covariance of the three.
    pub covariance: [[f64; 3]; 3],
}

impl Motion {
    /// Places of the three in the state.
    pub(crate) const PLACES: [usize; 3] = [V_X, V_Y, R];

    pub(crate) fn of(time_s: f64, s: &Vector, p: &Matrix) -> Self {
        let covariance = Self::PLACES.map(|i| Self::PLACES.map(|j| p[(i, j)]));
        Self { time_s, v_x_mps: s[V_X], v_y_mps: s[V_Y], yaw_rate_radps: s[R], covariance }
    }

    /// Standard deviation of v_y.
    #[must_use]
    pub fn v_y_sigma_mps(&self) -> f64 {
        self.covariance[1][1].max(0.0).sqrt()
    }
}

/// Of three numbers, 1 in 1000 chi-squared lies beyond; a pose further off is left out.
const GATE_POSE: f64 = 16.27;
/// Of one number, likewise.
const GATE_ONE: f64 = 10.83;
/// So many poses in a row that contradict are a jump of the localisation.
pub(crate) const JUMP_POSES: usize = 4;

/// What an observation did to the state: what the way back needs of it.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "the large one is the usual one")]
pub(crate) enum Update {
    /// A number was taken, by its row.
    One { h: Vector, gain: Vector, innovation: f64, variance: f64 },
    /// A pose was taken, by its rows.
    Pose(Box<PoseUpdate>),
    /// So many of the first states began anew.
    Anew(usize),
}

/// A pose that was taken.
#[derive(Debug)]
pub(crate) struct PoseUpdate {
    pub(crate) h: SMatrix<f64, 3, N>,
    pub(crate) gain: SMatrix<f64, N, 3>,
    pub(crate) innovation: Vector3<f64>,
    /// Inverse of the innovation's covariance.
    pub(crate) inverse: Matrix3<f64>,
}

/// The filter, live.
#[derive(Debug, Clone)]
pub struct Filter {
    levels: Levels,
    drive: Drive,
    time_s: Option<f64>,
    pub(crate) s: Vector,
    pub(crate) p: Matrix,
    spread: Vector,
    contradicting: usize,
    /// Poses since the last jump that did not contradict.
    agreeing: usize,
    /// Times at which the localisation jumped.
    pub(crate) jumps_s: Vec<f64>,
    /// Observations left out.
    pub(crate) left_out: usize,
}

impl Filter {
    /// A filter that knows nothing yet but the levels of noise.
    #[must_use]
    pub fn new(levels: Levels) -> Self {
        let mut spread = Vector::repeat(1e6);
        for (place, sigma) in [
            (PSI, 10.0),
            (V_X, 100.0),
            (V_Y, levels.v_y_spread_mps),
            (R, 10.0),
            (A_X, 20.0),
            (A_Y, 20.0),
            (ALPHA, 10.0),
            // A cheap unit on a tilted plate; a gyroscope out of its box; an arm of the car's size; a speed's scale by wheel or gear.
            (B_X, 0.5),
            (B_Y, 0.5),
            (B_R, 0.05),
            (ARM, levels.arm_m),
            (SCALE, 0.1),
            // A body that rolls by 3 degrees a g.
            (TILT, 0.05),
            // A gyroscope by its data sheet is better; an odometry's, counted from the steering, is not.
            (RATE, 0.1),
            (LATE, levels.late_s),
        ] {
            spread[place] = f64::powi(sigma, 2);
        }
        let drive = levels.drive();
        for (place, wander) in OFF.into_iter().zip(drive.wander()) {
            spread[place] = wander.sigma.powi(2);
        }
        Self {
            levels,
            drive,
            time_s: None,
            s: Vector::zeros(),
            p: Matrix::from_diagonal(&spread),
            spread,
            contradicting: 0,
            agreeing: 0,
            jumps_s: Vec::new(),
            left_out: 0,
        }
    }

    /// Goes on to a time; a time before the last changes nothing. Gives the transition for the way back.
    pub(crate) fn advance(&mut self, time_s: f64) -> Matrix {
        let dt_s = self.time_s.map_or(0.0, |t| time_s - t);
        self.time_s = Some(self.time_s.map_or(time_s, |t| t.max(time_s)));
        if dt_s <= 0.0 {
            return Matrix::identity();
        }
        let (s, transition, noise) = step(&self.s, dt_s, &self.drive);
        self.s = s;
        self.p = between(&self.p, &transition.transpose()) + noise;
        transition
    }

    /// Takes an observation at its time.
    pub fn push(&mut self, time_s: f64, observation: &Observation) -> Motion {
        self.advance(time_s);
        self.observe(observation, &mut |_| ());
        self.motion()
    }

    /// What is known now.
    #[must_use]
    pub fn motion(&self) -> Motion {
        Motion::of(self.time_s.unwrap_or(0.0), &self.s, &self.p)
    }

    /// Takes an observation at the time reached, and tells what it did.
    pub(crate) fn observe(&mut self, observation: &Observation, tell: &mut impl FnMut(Update)) {
        let l = self.levels;
        let s = self.s;
        let mut h = Vector::zeros();
        match *observation {
            Observation::Pose { x_m, y_m, yaw_rad } => self.pose(x_m, y_m, yaw_rad, tell),
            Observation::Speed(v_mps) => {
                h[V_X] = 1.0 + s[SCALE];
                h[SCALE] = s[V_X];
                self.one(v_mps - (1.0 + s[SCALE]) * s[V_X], &h, l.v_x_mps, tell);
            }
            Observation::LateralSpeed(v_mps) => {
                h[V_Y] = 1.0;
                self.one(v_mps - s[V_Y], &h, l.v_y_mps, tell);
            }
            Observation::YawRate(r_radps) => {
                h[R] = 1.0 + s[RATE];
                h[B_R] = 1.0;
                h[RATE] = s[R];
                self.one(r_radps - (1.0 + s[RATE]) * s[R] - s[B_R], &h, l.yaw_rate_radps, tell);
            }
            Observation::Acceleration { a_x_mps2, a_y_mps2 } => {
                h[A_X] = 1.0;
                h[B_X] = 1.0;
                h[R] = -2.0 * s[ARM] * s[R];
                h[ARM] = -s[R] * s[R];
                // A product of two unknowns is less certain than its slopes say: the second-order term counts as noise.
                let product = 2.0 * s[R].abs() * self.product(ARM, R);
                self.one(
                    a_x_mps2 - (s[A_X] + s[B_X] - s[ARM] * s[R] * s[R]),
                    &h,
                    l.a_x_mps2.hypot(product),
                    tell,
                );
                let s = self.s;
                let mut h = Vector::zeros();
                let (force, scale) = (s[A_Y] + s[ARM] * s[ALPHA], 1.0 + s[TILT]);
                h[A_Y] = scale;
                h[B_Y] = 1.0;
                h[ALPHA] = scale * s[ARM];
                h[ARM] = scale * s[ALPHA];
                h[TILT] = force;
                let product = self.product(ARM, ALPHA).hypot(self.product(TILT, A_Y));
                self.one(a_y_mps2 - (scale * force + s[B_Y]), &h, l.a_y_mps2.hypot(product), tell);
            }
        }
    }

    /// Standard deviation of the second-order part of a product of two states.
    fn product(&self, a: usize, b: usize) -> f64 {
        (self.p[(a, a)] * self.p[(b, b)] + self.p[(a, b)].powi(2)).max(0.0).sqrt()
    }

    /// Takes one number by the row `h`.
    fn one(&mut self, innovation: f64, h: &Vector, sigma: f64, tell: &mut impl FnMut(Update)) {
        let ph = self.p * h;
        let mut variance = h.dot(&ph) + sigma * sigma;
        if innovation * innovation > GATE_ONE * variance {
            self.left_out += 1;
            // What goes on contradicting is true: the more, the less is known of the motion's change; and it counts a little, the less the farther off
            // it is, so that the filter finds back from wherever it was led.
            for place in [A_X, A_Y, ALPHA] {
                self.p[(place, place)] *= 1.5;
            }
            variance = innovation * innovation / GATE_ONE;
        }
        let gain = ph / variance;
        self.s += gain * innovation;
        self.p.ger(-1.0, &gain, &ph, 1.0);
        tell(Update::One { h: *h, gain, innovation, variance });
    }

    fn pose(&mut self, x_m: f64, y_m: f64, yaw_rad: f64, tell: &mut impl FnMut(Update)) {
        let turns = ((self.s[PSI] - yaw_rad) / std::f64::consts::TAU).round();
        // A pose that is later than was taken off says where the car was.
        let late_s = self.s[LATE];
        let moved = rate(&self.s);
        let predicted = [X, Y, PSI].map(|place| self.s[place] + self.s[OFF[place]] - late_s * moved[place]);
        let innovation = Vector3::new(
            x_m - predicted[0],
            y_m - predicted[1],
            yaw_rad + turns * std::f64::consts::TAU - predicted[2],
        );
        let mut h: SMatrix<f64, 3, N> = -late_s * jacobian(&self.s).fixed_rows::<3>(0).into_owned();
        for place in 0..3 {
            h[(place, place)] += 1.0;
            h[(place, OFF[place])] += 1.0;
            h[(place, LATE)] = -moved[place];
        }
        let here = Matrix3::from_diagonal(&Vector3::new(
            self.levels.position_m.powi(2),
            self.levels.position_m.powi(2),
            self.levels.heading_rad.powi(2),
        ));
        // A stamp that is off a little is off along the way.
        let along = Vector3::new(moved[X], moved[Y], moved[PSI]) * self.levels.pose_stamp_s;
        let noise = here + along * along.transpose();
        let columns = self.p * h.transpose();
        let Some(inverse) = (h * columns + noise).try_inverse() else { return };
        let distance = (innovation.transpose() * inverse * innovation)[0];
        if distance > GATE_POSE {
            self.left_out += 1;
            self.contradicting += 1;
            if self.contradicting < JUMP_POSES {
                return;
            }
            tell(Update::Anew(self.begin_anew(x_m, y_m, predicted[2] + innovation[2])));
            return;
        }
        self.contradicting = 0;
        self.agreeing += 1;
        let gain = columns * inverse;
        self.s += gain * innovation;
        self.p -= gain * columns.transpose();
        tell(Update::Pose(Box::new(PoseUpdate { h, gain, innovation, inverse })));
    }

    /// The localisation has jumped: place and heading are what it says now, and the motion is what it was. Where it jumps again and again it is the motion
    /// that is not known any more. Gives how many of the first states begin anew.
    fn begin_anew(&mut self, x_m: f64, y_m: f64, yaw_rad: f64) -> usize {
        self.contradicting = 0;
        let mut anew = PLACE;
        if self.agreeing < JUMP_POSES && !self.jumps_s.is_empty() {
            anew = MOTION;
            for place in PLACE..MOTION {
                for other in 0..N {
                    self.p[(place, other)] = 0.0;
                    self.p[(other, place)] = 0.0;
                }
                self.p[(place, place)] = self.spread[place];
            }
            // The speed along is known best.
            self.p[(V_X, V_X)] = self.spread[V_Y];
            for place in [V_Y, A_X, A_Y, ALPHA] {
                self.s[place] = 0.0;
            }
        }
        self.agreeing = 0;
        self.jumps_s.extend(self.time_s);
        // A late pose says where the car was.
        let (late_s, moved) = (self.s[LATE], rate(&self.s));
        let values = [x_m + late_s * moved[X], y_m + late_s * moved[Y], yaw_rad + late_s * moved[PSI]];
        let sigmas = [self.levels.position_m, self.levels.position_m, self.levels.heading_rad];
        for place in 0..PLACE {
            for other in 0..N {
                self.p[(place, other)] = 0.0;
                self.p[(other, place)] = 0.0;
            }
        }
        for place in 0..3 {
            // What it is off by now is known by nothing.
            let (off, off2) = (OFF[place], self.spread[OFF[place]]);
            (self.s[place], self.s[off]) = (values[place], 0.0);
            self.p[(place, place)] = sigmas[place].powi(2) + off2;
            self.p[(off, off)] = off2;
            (self.p[(place, off)], self.p[(off, place)]) = (-off2, -off2);
        }
        anew
    }
}
