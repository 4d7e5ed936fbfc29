//! The equations of motion with the effects in their places, integrated over a window.
//!
//! Explicit midpoint rule, like the nominal model; lags inside the loop (relaxation, roll) are solved exactly for an input that is linear
//! over the step, so that a lag of zero is no lag at all and its derivative there is right.

use crate::rollout::Window;
use gripsight_vehicle::{MagicFormula, OwnTires, Real};

use crate::effects::{EffectId, Lagging};
use crate::flexible::Push;
use crate::longitudinal_force::{Following, force_before_mps2};
use crate::model::ExtendedModel;
use crate::road_wheels::{RoadWheels, at_once};
use crate::terms::{Axle, Axles, Car, Lag, Moment, Motion, Outputs, Sprung, TURNING_SHARE};

/// Below this forward speed slip angles mean nothing; the model is evaluated as if at this speed.
const MIN_SPEED_MPS: f64 = 0.2;

/// Runs the car over one window.
pub(crate) struct Mover<'m, 'a, T> {
    model: &'m ExtendedModel<'a>,
    p: &'m [T],
    /// Its effects with their parameters.
    effects: Vec<(EffectId, &'m [T])>,
    car: &'m Car<T>,
    /// Yaw inertia that a moment has to turn.
    turned_kgm2: T,
    axles_at_rest: Axles<T>,
    tires: OwnTires<T>,
    wheels: &'m RoadWheels<T>,
    window: &'m Window,
    relaxes: bool,
    rolls: bool,
    /// The body in pitch, where that matters.
    pitch: Option<Sprung<T>>,
}

/// What goes with a sample up to the next.
struct Extra<T> {
    /// What is added to the accelerations of v_y and yaw rate throughout.
    push: [T; 2],
    flexible: Option<Push<T>>,
    /// Longitudinal acceleration as the springs carry it, at both ends.
    carried_a_x_mps2: [T; 2],
    force: Following,
}

/// Slip angle of an axle whose wheels are steered by an angle: it moves with the car's v_x, v_y and yaw rate, at a lever ahead (1) or behind (-1) the
/// centre of gravity.
fn slip_angle_rad<T: Real>(steer_rad: &T, [v_x, v_y, r]: [&T; 3], (side, lever_m): (f64, &T)) -> T {
    let course = (v_y.re() + side * r.re() * lever_m.re()) / v_x.re();
    let by_across = -1.0 / ((1.0 + course * course) * v_x.re());
    T::chain(
        steer_rad.re() - course.atan(),
        [
            (1.0, steer_rad),
            (by_across, v_y),
            (by_across * side * lever_m.re(), r),
            (by_across * side * r.re(), lever_m),
            (-by_across * course, v_x),
        ],
    )
}

/// Two forces or moments over what they move, and accelerations beside that.
fn over<T: Real>([(a, first), (b, second)]: [(f64, &T); 2], moved: &T, beside: [&T; 2]) -> T {
    let share = 1.0 / moved.re();
    let own = (a * first.re() + b * second.re()) * share;
    T::chain(
        own + beside[0].re() + beside[1].re(),
        [(a * share, first), (b * share, second), (-own * share, moved), (1.0, beside[0]), (1.0, beside[1])],
    )
}

/// The inputs of an instant.
struct Instant<'e, T> {
    /// Whether it lies in the middle of a step of integration, for all of it.
    is_middle: bool,
    v_x_mps: T,
    steering_rad: T,
    /// What the wheels are beyond that, just after a jump of their command: the tires have not rolled on it yet.
    jump_rad: f64,
    a_x_mps2: f64,
    carried_a_x_mps2: T,
    force_x_mps2: f64,
    minutes: f64,
    lap_share: f64,
    place_rad: f64,
    extra: &'e Extra<T>,
}

/// What an instant leaves behind for the next.
#[derive(Debug, Clone, Copy)]
struct Memory<T> {
    a_y_mps2: T,
    rolled_a_y_mps2: T,
    front_use: T,
    /// Slip angles behind the relaxation, and those they follow.
    slip_rad: [T; 2],
    steady_rad: [T; 2],
}

/// Accelerations of an instant.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rates<T> {
    v_y_mps2: T,
    pub(crate) yaw_radps2: T,
    pub(crate) v_x_mps2: T,
    pub(crate) a_y_mps2: T,
    pub(crate) a_x_mps2: T,
    memory: Memory<T>,
}

/// The car on its way.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moving<T> {
    /// v_y and yaw rate.
    pub(crate) x: [T; 2],
    /// Forward speed, but for a constant.
    pub(crate) speed_mps: T,
    /// Heading, but for a constant.
    pub(crate) heading_rad: T,
    pub(crate) rates: Rates<T>,
    /// The body in pitch.
    pub(crate) pitch: [T; 2],
    /// Longitudinal force of the tires over the nominal mass.
    pub(crate) force_mps2: f64,
}

impl Moving<f64> {
    /// Before anything is known.
    pub(crate) fn still() -> Self {
        let memory = Memory {
            a_y_mps2: 0.0,
            rolled_a_y_mps2: 0.0,
            front_use: 0.0,
            slip_rad: [0.0; 2],
            steady_rad: [0.0; 2],
        };
        let rates =
            Rates { v_y_mps2: 0.0, yaw_radps2: 0.0, v_x_mps2: 0.0, a_y_mps2: 0.0, a_x_mps2: 0.0, memory };
        Self { x: [0.0; 2], speed_mps: 0.0, heading_rad: 0.0, rates, pitch: [0.0; 2], force_mps2: 0.0 }
    }
}

impl<'m, 'a, T: Real> Mover<'m, 'a, T> {
    pub(crate) fn new(
        model: &'m ExtendedModel<'a>,
        p: &'m [T],
        car: &'m Car<T>,
        tires: OwnTires<T>,
        wheels: &'m RoadWheels<T>,
        window: &'m Window,
    ) -> Self {
        let dt_s = model.recording.runs[window.segment].dt_s;
        let lags = |what| model.effects.iter().any(|e| e.spec().lagging.contains(&what));
        Self {
            model,
            p,
            effects: model.with_parameters(p).collect(),
            car,
            turned_kgm2: car.turned_kgm2(),
            axles_at_rest: car.axles_at_rest(),
            tires,
            wheels,
            window,
            relaxes: lags(Lagging::Slip) && car.relaxation_m.re() >= 0.0,
            rolls: lags(Lagging::Roll),
            pitch: lags(Lagging::Pitch).then(|| Sprung::new(car.pitch_frequency_hz, dt_s)),
        }
    }

    /// The motion from a start, with accelerations of v_y and yaw rate added throughout.
    pub(crate) fn run(&self, start: [T; 2], push: [T; 2]) -> Outputs<T> {
        let run = &self.model.recording.runs[self.window.segment];
        let n = self.window.len;
        let mut out = Outputs::of(run.dt_s, n);
        let mut residual = self.model.residual.map(|r| r.stream(run, self.window));
        let mut state = self.begin(start, push);
        for k in 0..n {
            let push = match &mut residual {
                Some(stream) => stream.next(k, state.x.map(|v| v.re())).map(T::from),
                None => push,
            };
            out.v_y_mps.push(state.x[0]);
            out.yaw_rate_radps.push(state.x[1]);
            out.yaw_acceleration_radps2.push(state.rates.yaw_radps2);
            out.a_y_mps2.push(state.rates.a_y_mps2);
            out.a_x_mps2.push(state.rates.a_x_mps2);
            out.v_x_mps.push(state.speed_mps);
            out.heading_rad.push(state.heading_rad);
            if k + 1 < n {
                self.advance(k, &mut state, push);
            }
        }
        out
    }

    /// Number and length of the steps between two samples.
    fn substeps(&self) -> (usize, f64) {
        let dt_s = self.model.recording.runs[self.window.segment].dt_s;
        let substeps = (dt_s / self.model.substep_s - 1e-9).ceil().max(1.0);
        (substeps as usize, dt_s / substeps)
    }

    /// The car at the window's start.
    pub(crate) fn begin(&self, x: [T; 2], push: [T; 2]) -> Moving<T> {
        let zero = T::from(0.0);
        let (pitch, force_mps2) = (self.pitch_before(), force_before_mps2(self.model.recording, self.window));
        let rates = self.settled(x, self.substeps().1, &self.extra(0, push, [pitch; 2], force_mps2));
        Moving { x, speed_mps: zero, heading_rad: zero, rates, pitch, force_mps2 }
    }

    /// From sample `k` of the window to the next.
    pub(crate) fn advance(&self, k: usize, state: &mut Moving<T>, push: [T; 2]) {
        let (substeps, h_s) = self.substeps();
        let from = state.pitch;
        let to = self.pitched(from, self.window.from + k);
        let extra = self.extra(k, push, [from, to], state.force_mps2);
        let Moving { x, speed_mps, heading_rad, rates, pitch, force_mps2 } = state;
        *pitch = to;
        *force_mps2 = extra.force.end_mps2();
        if self.relaxes {
            let [before_rad, after_rad] = self.wheels.around_jump_rad(self.wheels.run_in() + k);
            rates.memory.steady_rad[0] += after_rad - before_rad;
        }
        for i in 0..substeps {
            let share = (i as f64 + 0.5) / substeps as f64;
            let middle = Instant { is_middle: true, ..self.instant(k, share, &extra) };
            let on = |from: &T, rate: &T, time_s: f64| T::weighted([(1.0, from), (time_s, rate)]);
            let half = [on(&x[0], &rates.v_y_mps2, h_s / 2.0), on(&x[1], &rates.yaw_radps2, h_s / 2.0)];
            let there = self.rates(half, &middle, &rates.memory, h_s / 2.0, self.relaxes);
            *x = [on(&x[0], &there.v_y_mps2, h_s), on(&x[1], &there.yaw_radps2, h_s)];
            *speed_mps = on(speed_mps, &there.v_x_mps2, h_s);
            *heading_rad = on(heading_rad, &half[1], h_s);
            let end = self.instant(k, (i as f64 + 1.0) / substeps as f64, &extra);
            *rates = self.rates(*x, &end, &rates.memory, h_s, self.relaxes);
        }
    }

    /// Rates at the start, as if the motion had gone on as it does there.
    fn settled(&self, x: [T; 2], h_s: f64, extra: &Extra<T>) -> Rates<T> {
        let now = self.instant(0, 0.0, extra);
        let zero = T::from(0.0);
        let a_y_mps2 = now.v_x_mps * x[1];
        let mut memory = Memory {
            a_y_mps2,
            rolled_a_y_mps2: a_y_mps2,
            front_use: zero,
            slip_rad: [zero; 2],
            steady_rad: [zero; 2],
        };
        // The front use settles in three turns.
        let mut rates = self.rates(x, &now, &memory, h_s, false);
        for _ in 0..2 {
            memory.front_use = rates.memory.front_use;
            rates = self.rates(x, &now, &memory, h_s, false);
        }
        if !self.relaxes {
            return rates;
        }
        memory = rates.memory;
        let behind = self.slip_behind();
        memory.slip_rad = [memory.steady_rad[0] + behind[0], memory.steady_rad[1] + behind[1]];
        self.rates(x, &now, &memory, 0.0, true)
    }

    /// How far the relaxed slip angles lie from the steady ones when the window starts: the filter run over the measured motion before it.
    /// Offsets of the measurement cancel.
    fn slip_behind(&self) -> [T; 2] {
        let run = &self.model.recording.runs[self.window.segment];
        let start = self.window.from;
        let zero = T::from(0.0);
        let mut steady = [zero; 2];
        let mut slip = [zero; 2];
        let count = self.wheels.run_in();
        for i in 0..=count {
            let (k, [steering_rad, after_rad]) = (start + i - count, self.wheels.around_jump_rad(i));
            let v_x = self.car.speed_factor * run.v_x_mps[k].max(MIN_SPEED_MPS);
            let (v_y, r) = (run.smooth[0][k], run.smooth[1][k]);
            let now = [
                steering_rad - ((self.car.l_f_m * r + v_y) / v_x).atan(),
                -((-(self.car.l_r_m * r) + v_y) / v_x).atan(),
            ];
            let lag = Lag::new(run.dt_s, self.car.relaxation_m / v_x);
            for axle in 0..2 {
                slip[axle] = if i == 0 { now[axle] } else { lag.step(slip[axle], steady[axle], now[axle]) };
            }
            steady = if i < count { [now[0] + (after_rad - steering_rad), now[1]] } else { now };
        }
        [slip[0] - steady[0], slip[1] - steady[1]]
    }

    /// The body in pitch at the window's start, from what was recorded before it.
    fn pitch_before(&self) -> [T; 2] {
        const FORGOTTEN_S: f64 = 0.5;
        let run = &self.model.recording.runs[self.window.segment];
        let start = self.window.from;
        let first =
            if self.pitch.is_some() { start - start.min((FORGOTTEN_S / run.dt_s) as usize) } else { start };
        let still = [T::from(run.a_x_mps2[first]), T::from(0.0)];
        (first..start).fold(still, |pitch, k| self.pitched(pitch, k))
    }

    /// The body in pitch a sample after `k` of the recording.
    fn pitched(&self, pitch: [T; 2], k: usize) -> [T; 2] {
        let a_x_mps2 = &self.model.recording.runs[self.window.segment].recorded_a_x_mps2;
        let next = (k + 1).min(a_x_mps2.len() - 1);
        self.pitch.map_or(pitch, |sprung| sprung.step(pitch, (a_x_mps2[k] + a_x_mps2[next]) / 2.0))
    }

    fn extra(&self, k: usize, push: [T; 2], pitch: [[T; 2]; 2], force_mps2: f64) -> Extra<T> {
        let run = &self.model.recording.runs[self.window.segment];
        let flexible = self.model.flexible.as_ref();
        let own = || self.model.flexible_parameters(self.p);
        Extra {
            push,
            flexible: flexible.map(|f| f.push(own(), run, self.window.from + k)),
            carried_a_x_mps2: pitch.map(|x| self.pitch.map_or(x[0], |sprung| sprung.carried(x))),
            force: Following::of(self.model.recording, run, self.window.from + k, force_mps2),
        }
    }

    fn instant<'e>(&self, k: usize, share: f64, extra: &'e Extra<T>) -> Instant<'e, T> {
        let run = &self.model.recording.runs[self.window.segment];
        let (a, b) = (self.window.from + k, (self.window.from + k + 1).min(run.len() - 1));
        let mix = |s: &[f64]| s[a] + (s[b] - s[a]) * share;
        // The lap's end is not a place to interpolate across.
        let lap = &run.lap_share;
        let turn = lap[b] - lap[a];
        let (v_x_mps, a_x_mps2) = (mix(&run.v_x_mps), mix(&run.a_x_mps2));
        let flexible = self.model.flexible.as_ref();
        let more =
            flexible.and_then(|f| f.speed_factor(self.model.flexible_parameters(self.p), v_x_mps, a_x_mps2));
        let true_mps = self.car.speed_factor * v_x_mps;
        let (mut steering_rad, mut jump_rad) =
            (self.wheels.angle_rad(k, share), self.wheels.jump_rad(k, share));
        let at_sample = share == 0.0 || share == 1.0;
        if self.relaxes && at_sample {
            // Relaxed slips follow the wheels as they were until the sample.
            let here = self.wheels.run_in() + k + usize::from(share == 1.0);
            let [before_rad, _] = self.wheels.around_jump_rad(here);
            jump_rad += (steering_rad - before_rad).re();
            steering_rad = before_rad;
        }
        Instant {
            is_middle: false,
            v_x_mps: more.map_or(true_mps, |more| true_mps * more),
            steering_rad,
            jump_rad,
            a_x_mps2,
            carried_a_x_mps2: {
                let [from, to] = &extra.carried_a_x_mps2;
                T::weighted([(1.0 - share, from), (share, to)])
            },
            force_x_mps2: extra.force.at_mps2(share, self.substeps().0),
            minutes: (run.time_s(a) + share * run.dt_s) / 60.0,
            lap_share: lap[a] + (turn - turn.round()) * share,
            place_rad: run.place_rad[a],
            extra,
        }
    }

    /// Accelerations `h_s` after an instant that left `memory`; where nothing `relaxes`, the slip is the steady one whatever the memory holds.
    fn rates(
        &self,
        x: [T; 2],
        now: &Instant<'_, T>,
        memory: &Memory<T>,
        h_s: f64,
        relaxes: bool,
    ) -> Rates<T> {
        let (model, car) = (self.model, self.car);
        let [v_y, r] = x;
        let v_x = if now.v_x_mps.re() < MIN_SPEED_MPS { T::from(MIN_SPEED_MPS) } else { now.v_x_mps };
        let at = Moment {
            v_x_mps: v_x,
            yaw_rate_radps: r,
            steering_rad: now.steering_rad,
            a_y_mps2: memory.a_y_mps2,
            rolled_a_y_mps2: memory.rolled_a_y_mps2,
            front_use: memory.front_use,
            a_x_mps2: now.a_x_mps2,
            carried_a_x_mps2: now.carried_a_x_mps2,
            force_x_mps2: now.force_x_mps2,
            minutes: now.minutes,
            lap_share: now.lap_share,
            lap_m: model.recording.laps.lap_m,
            place_rad: now.place_rad,
        };
        let mut axles = self.axles_at_rest;
        for (effect, values) in &self.effects {
            effect.loads(values, car, &at, &mut axles);
        }
        for (effect, values) in &self.effects {
            effect.grip(values, car, &at, &mut axles);
        }
        let front_rad = now.steering_rad + axles.front.steer_rad;
        let steady_rad = [
            slip_angle_rad(&front_rad, [&v_x, &v_y, &r], (1.0, &car.l_f_m)),
            slip_angle_rad(&axles.rear.steer_rad, [&v_x, &v_y, &r], (-1.0, &car.l_r_m)),
        ];
        let mut slip_rad = steady_rad;
        let relaxation_s = if relaxes { car.relaxation_m / v_x } else { T::from(0.0) };
        if relaxes && h_s > 0.0 {
            let step_s = if now.is_middle { 2.0 * h_s } else { h_s };
            let lag = Lag::new(step_s, relaxation_s);
            for (i, slip) in slip_rad.iter_mut().enumerate() {
                let (from, before) = (memory.slip_rad[i], memory.steady_rad[i]);
                *slip = if now.is_middle {
                    lag.mean(from, before, steady_rad[i])
                } else {
                    lag.step(from, before, steady_rad[i])
                };
            }
        } else if relaxes {
            slip_rad = memory.slip_rad;
        }
        let mut front_slip_rad = slip_rad[0];
        if now.jump_rad != 0.0 {
            let passed = if relaxes { at_once(relaxation_s) } else { T::from(1.0) };
            front_slip_rad += passed * now.jump_rad;
        }
        let force = |axle: &Axle<T>, tire: &MagicFormula<T>, slip: T| {
            tire.gripping_force(slip, axle.grip, axle.usable)
        };
        let front_use = force(&axles.front, &self.tires.front, front_slip_rad);
        let rear_use = force(&axles.rear, &self.tires.rear, slip_rad[1]);
        let (sin, cos) = now.steering_rad.re().sin_cos();
        let front_n = front_use * axles.front.carried_n(self.axles_at_rest.front.load_n);
        let rear_n = rear_use * axles.rear.carried_n(self.axles_at_rest.rear.load_n);
        let mut motion = Motion::none();
        for (effect, values) in &self.effects {
            effect.motion(values, car, &at, &mut motion);
        }
        let commanded = model.recording.has_command;
        // Force along the front wheels turns with them; it is known only where it is commanded.
        let front_x_n = if commanded {
            car.front_share(now.force_x_mps2 > 0.0) * (now.force_x_mps2 * car.nominal_mass_kg)
        } else {
            T::from(0.0)
        };
        let across_n = front_n.re() * cos + front_x_n.re() * sin;
        let turned_n = front_x_n.re() * cos - front_n.re() * sin;
        let front_y_n =
            T::chain(across_n, [(cos, &front_n), (sin, &front_x_n), (turned_n, &now.steering_rad)]);
        let mut a_y = over(
            [(1.0, &rear_n), (1.0, &front_y_n)],
            &car.mass_kg,
            [&motion.force_y_mps2, &now.extra.push[0]],
        );
        let moments_nm = [front_y_n * car.l_f_m, rear_n * car.l_r_m];
        let mut yaw_radps2 = over(
            [(1.0, &moments_nm[0]), (-1.0, &moments_nm[1])],
            &self.turned_kgm2,
            [&motion.yaw_radps2, &now.extra.push[1]],
        );
        if let Some(flexible) = &model.flexible {
            let own = model.flexible_parameters(self.p);
            let rate = |i: usize| {
                if h_s > 0.0 { (steady_rad[i] - memory.steady_rad[i]) / h_s } else { T::from(0.0) }
            };
            let [more_y, more_yaw] = flexible.forces(own, &at, steady_rad, [rate(0), rate(1)]);
            a_y += more_y;
            yaw_radps2 += more_yaw;
        }
        if let Some(push) = &now.extra.flexible {
            a_y += push.force_y_mps2;
            yaw_radps2 += push.yaw_radps2;
            motion.force_x_mps2 += push.force_x_mps2;
            motion.gravity_x_mps2 += push.gravity_x_mps2;
            motion.gravity_y_mps2 += push.gravity_y_mps2;
        }
        let along_mps2 = if commanded {
            // A command speaks of the car's own acceleration: the wheels' is on top of it, and everything else that pushes has to turn them, too.
            let turning_kg = TURNING_SHARE * car.nominal_mass_kg;
            let commanded_n = now.force_x_mps2 * (car.nominal_mass_kg + turning_kg);
            let pushed_mps2 = motion.force_x_mps2.re() + motion.gravity_x_mps2.re();
            let (mass_kg, moved_kg) = (car.mass_kg.re(), car.mass_kg.re() + turning_kg);
            let along = (commanded_n + pushed_mps2 * mass_kg - front_n.re() * sin) / moved_kg;
            T::chain(
                along,
                [
                    (-sin / moved_kg, &front_n),
                    (-front_n.re() * cos / moved_kg, &now.steering_rad),
                    (mass_kg / moved_kg, &motion.force_x_mps2),
                    (mass_kg / moved_kg, &motion.gravity_x_mps2),
                    ((pushed_mps2 - along) / moved_kg, &car.mass_kg),
                ],
            )
        } else {
            motion.gravity_x_mps2 + now.a_x_mps2
        };
        let rolled = if self.rolls && h_s > 0.0 {
            Lag::new(h_s, car.roll_time_s).step(memory.rolled_a_y_mps2, memory.a_y_mps2, a_y)
        } else {
            memory.rolled_a_y_mps2
        };
        Rates {
            v_y_mps2: T::chain(
                a_y.re() - now.v_x_mps.re() * r.re() + motion.gravity_y_mps2.re(),
                [
                    (1.0, &a_y),
                    (-r.re(), &now.v_x_mps),
                    (-now.v_x_mps.re(), &r),
                    (1.0, &motion.gravity_y_mps2),
                ],
            ),
            yaw_radps2,
            v_x_mps2: T::chain(
                along_mps2.re() + v_y.re() * r.re(),
                [(1.0, &along_mps2), (r.re(), &v_y), (v_y.re(), &r)],
            ),
            a_y_mps2: a_y,
            a_x_mps2: along_mps2 - motion.gravity_x_mps2,
            memory: Memory { a_y_mps2: a_y, rolled_a_y_mps2: rolled, front_use, slip_rad, steady_rad },
        }
    }
}

#[cfg(test)]
mod tests {
    use gripsight_vehicle::Dual;

    use super::*;
    use crate::terms::tests::assert_same;

    #[test]
    fn slips_and_accelerations_have_the_derivatives_of_their_formulas() {
        let of = |lane: usize, value: f64| Dual::<5>::variable(value, lane);
        let [steer_rad, v_x, v_y, r, lever_m] =
            [(0, 0.1), (1, 6.0), (2, -0.3), (3, 1.2), (4, 0.16)].map(|(lane, value)| of(lane, value));
        let [front, rear] =
            [1.0, -1.0].map(|side| slip_angle_rad(&steer_rad, [&v_x, &v_y, &r], (side, &lever_m)));
        assert_same(front, steer_rad - ((v_y + r * lever_m) / v_x).atan());
        assert_same(rear, steer_rad - ((v_y - r * lever_m) / v_x).atan());
        let rate = over([(1.0, &v_x), (-1.0, &v_y)], &lever_m, [&steer_rad, &r]);
        assert_same(rate, (v_x - v_y) / lever_m + steer_rad + r);
    }
}
