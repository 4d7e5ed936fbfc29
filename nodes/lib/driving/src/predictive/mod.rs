//! Model predictive control of the steering: a step of sequential quadratic programming on the single-track model for each command.
//!
//! Over the next second ([`problem`]) the car is to be on the line and go along it, within the track's edges and the servo's limits. The speed is that
//! of the profile. The model ([`model`]) is linear around the motion that the step before found, the tires around the slips of that motion. It begins
//! where the car will be when the command acts: what is under way is rolled out first, and wheels that lag are in the model.

mod lacks;
mod model;
mod problem;

use self::lacks::Lacks;
pub(crate) use self::model::PathModel;
use self::model::{Along, Motion};
use self::problem::{Hard, Problem, Scales, Solution, Solver, Stage};
use crate::Place;
use crate::state::CarState;
use crate::steering::{Moment, NoAngle, Steering};
use crate::track::wrap_angle;

/// Instants of the horizon, and the time between two.
const STEPS: usize = 20;
const STEP_S: f64 = 0.05;
/// Slowest that is predicted.
const SLOW_MPS: f64 = 1.0;
/// Oldest answer that the next one starts from.
const STALE_S: f64 = 0.1;
/// Time in which what the model lacks is over: a bend later it is something else.
const LACKS_S: f64 = 0.4;
/// Delay and lag that make the controller half as quick: on tires that are an eighth off, the quick one swings from 0.15 s on.
const GENTLE_S: f64 = 0.15;

/// What the controller weighs, and what the steering can do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Predictive {
    /// Distance to the line that weighs as much as `course_rad`, over the wheelbase.
    pub offset_wheelbases: f64,
    /// Direction of travel against the line.
    pub course_rad: f64,
    /// Rate of the steering command that weighs as much.
    pub rate_radps: f64,
    /// Weight of the horizon's end over that of the other instants.
    pub end: f64,
    /// Share of the track's width that is kept free inside of each edge, while that is possible.
    pub free: f64,
    /// Largest rate of the steering.
    pub most_rate_radps: f64,
    /// Time from one answer to the next: the commands in between are its, too. 0: each has its own.
    pub every_s: f64,
}

impl Default for Predictive {
    /// Chosen on the development tracks (club, esses, clover; 1:10 car), as the pursuit's. An answer for each command keeps the line no better than one
    /// every 40 ms.
    fn default() -> Self {
        Self {
            offset_wheelbases: 0.2,
            course_rad: 0.1,
            rate_radps: 1.0,
            end: 5.0,
            free: 0.15,
            most_rate_radps: 3.2,
            every_s: 0.04,
        }
    }
}

/// How the controller did so far.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Solves {
    /// Commands that it gave.
    pub commands: u64,
    /// Programs solved for them.
    pub solved: u64,
    /// Commands of the pursuit in its place, as the solver did not converge.
    pub not_converged: u64,
    /// Commands of the pursuit because the car was too slow.
    pub slow: u64,
    /// Iterations of the solver, altogether.
    pub iterations: u64,
}

/// What a step found.
#[derive(Debug, Clone)]
struct Answer {
    /// When it begins to act.
    acts_s: f64,
    command_rad: f64,
    /// From one step later on.
    motion: Vec<Motion>,
    commands_rad: Vec<f64>,
}

impl Answer {
    /// The instant before a time, the next one, and the share of the way between them; instant 0 is one step after the begin.
    fn place(&self, time_s: f64) -> (usize, usize, f64) {
        let place = (time_s - self.acts_s) / STEP_S - 1.0;
        let last = self.motion.len() - 1;
        let first = (place.max(0.0).floor() as usize).min(last);
        (first, (first + 1).min(last), (place - first as f64).clamp(0.0, 1.0))
    }

    /// The motion at a time; that of the first or last instant, beyond.
    fn motion(&self, time_s: f64) -> Motion {
        let (first, next, share) = self.place(time_s);
        let (a, b) = (&self.motion[first], &self.motion[next]);
        std::array::from_fn(|lane| a[lane] + share * (b[lane] - a[lane]))
    }

    /// The command at a time.
    fn command_rad(&self, time_s: f64) -> f64 {
        let begins = ((time_s - self.acts_s) / STEP_S).max(0.0);
        if begins < 1.0 {
            return self.command_rad + begins * (self.commands_rad[0] - self.command_rad);
        }
        let (first, next, share) = self.place(time_s);
        self.commands_rad[first] + share * (self.commands_rad[next] - self.commands_rad[first])
    }
}

/// The controller on a drive.
#[derive(Debug, Clone)]
pub(crate) struct Predicting {
    style: Predictive,
    lacks: Lacks,
    solver: Solver,
    last: Option<Answer>,
    pub(crate) solves: Solves,
}

impl Predicting {
    pub(crate) fn new(style: Predictive) -> Self {
        Self {
            style,
            lacks: Lacks::default(),
            solver: Solver::default(),
            last: None,
            solves: Solves::default(),
        }
    }

    fn solve(&mut self, at: &Moment<'_>) -> Result<f64, NoAngle> {
        let lacks = self.lacks.look(at);
        let (car, place) = at.car(0.0, lacks);
        if car.v_x_mps < SLOW_MPS || at.now.v_x_mps < SLOW_MPS {
            self.last = None;
            return Err(NoAngle::Slow);
        }
        let acts_s = at.goes_s() + at.delay_s;
        let fresh = self
            .last
            .as_ref()
            .is_some_and(|last| (last.acts_s..last.acts_s + self.style.every_s - 1e-6).contains(&acts_s));
        if !fresh {
            self.renew(at, (&car, place), acts_s, lacks)?;
        }
        let last = self.last.as_ref().ok_or(NoAngle::NotConverged)?;
        // As far as it gets until the next command goes out.
        let angle_rad = last.command_rad(acts_s + at.dt_s().clamp(0.0, STEP_S));
        let (most_rad, turn_rad) = (at.vehicle.max_steering_rad, self.style.most_rate_radps * at.dt_s());
        let before_rad = at.asked.back().map_or(0.0, |asked| asked.angle_rad);
        let angle_rad = at.within_slip(&car, angle_rad).clamp(-most_rad, most_rad);
        Ok(angle_rad.clamp(before_rad - turn_rad, before_rad + turn_rad))
    }

    /// The next answer.
    fn renew(
        &mut self,
        at: &Moment<'_>,
        (car, place): (&CarState, Place),
        acts_s: f64,
        lacks: [f64; 2],
    ) -> Result<(), NoAngle> {
        let line = at.track.at(place.station_m);
        let command_rad = at.asked.back().map_or(0.0, |last| last.angle_rad);
        let start: Motion = [
            place.offset_m,
            wrap_angle(car.heading_rad - line.heading_rad),
            car.v_y_mps,
            car.yaw_rate_radps,
            at.wheels_rad().unwrap_or(command_rad),
        ];
        let stages = self.stages(at, start, (place.station_m, car.v_x_mps), acts_s, lacks);
        let wheelbase_m = at.vehicle.wheelbase_m();
        let problem = Problem {
            start,
            command_rad,
            stages: &stages,
            step_s: STEP_S,
            lag_s: at.lag_s,
            scales: Scales {
                offset_m: self.style.offset_wheelbases * wheelbase_m,
                course_rad: self.style.course_rad,
                // Who sees later what it brought about steers more gently.
                rate_radps: self.style.rate_radps / (1.0 + (at.age_s + at.delay_s + at.lag_s) / GENTLE_S),
                outside_m: 0.05 * wheelbase_m,
                slip_rad: 0.01,
                end: self.style.end,
            },
            hard: Hard {
                angle_rad: at.vehicle.max_steering_rad,
                rate_radps: self.style.most_rate_radps,
                slip_rad: at.plan.model.most_slip_rad(),
            },
        };
        self.last = None;
        let Solution { motion, commands_rad, iterations } =
            self.solver.solve(&problem).ok_or(NoAngle::NotConverged)?;
        self.last = Some(Answer { acts_s, command_rad, motion, commands_rad });
        self.solves.solved += 1;
        self.solves.iterations += u64::from(iterations);
        Ok(())
    }

    /// The line, the speed and the model along the horizon.
    fn stages(
        &self,
        at: &Moment<'_>,
        start: Motion,
        (mut station_m, mut v_x_mps): (f64, f64),
        acts_s: f64,
        lacks: [f64; 2],
    ) -> Vec<Stage> {
        let limits = &at.plan.limits;
        let recent = self.last.as_ref().filter(|last| (0.0..STALE_S).contains(&(acts_s - last.acts_s)));
        let mut stages = Vec::with_capacity(STEPS + 1);
        for k in 0..=STEPS {
            let point = at.track.at(station_m);
            let ahead_s = k as f64 * STEP_S;
            let near = match recent {
                _ if k == 0 => start,
                Some(last) => last.motion(acts_s + ahead_s),
                None => steady(at, point.curvature_1pm, v_x_mps),
            };
            let fades = (-ahead_s / LACKS_S).exp();
            let along = Along { point, v_x_mps };
            let keeps = 1.0 - self.style.free;
            stages.push(Stage {
                linear: at.plan.model.linear(&near, &along, lacks.map(|l| fades * l)),
                v_x_mps,
                room_m: [keeps * point.right_m, keeps * point.left_m],
            });
            let (speed_mps, slope) = at.plan.profile.at(station_m);
            let towards = slope + at.speed_gain_1ps * (speed_mps - v_x_mps);
            let a_x = towards.clamp(-limits.brake_mps2, limits.drive_at_mps2(v_x_mps));
            let nearer = (1.0 - near[0] * point.curvature_1pm).max(0.2);
            station_m += STEP_S * (v_x_mps * near[1].cos() - near[2] * near[1].sin()) / nearer;
            v_x_mps = (v_x_mps + STEP_S * a_x).max(SLOW_MPS);
        }
        stages
    }
}

/// A steady turn along the line.
fn steady(at: &Moment<'_>, curvature_1pm: f64, v_x_mps: f64) -> Motion {
    let table = &at.plan.table;
    let a = v_x_mps * v_x_mps * curvature_1pm;
    let yaw_rate_radps = a.clamp(-table.most_mps2(), table.most_mps2()) / v_x_mps;
    let rear_rad = table.slips_rad(a).1;
    let v_y_mps = at.vehicle.l_r_m * yaw_rate_radps - v_x_mps * rear_rad.tan();
    [0.0, -(v_y_mps / v_x_mps).atan(), v_y_mps, yaw_rate_radps, table.steering_rad(a, v_x_mps)]
}

impl Steering for Predicting {
    fn angle_rad(&mut self, at: &Moment<'_>) -> Result<f64, NoAngle> {
        let angle = self.solve(at);
        match angle {
            Ok(_) => self.solves.commands += 1,
            Err(NoAngle::NotConverged) => self.solves.not_converged += 1,
            Err(NoAngle::Slow) => self.solves.slow += 1,
        }
        angle
    }
}
