//! What the effects' hooks see and change: the terms of the equations of motion.

use gripsight_vehicle::{GRAVITY_MPS2, Real, VehicleParameters};

/// Constants of the car.
#[derive(Debug, Clone, Copy)]
pub struct Car<T> {
    /// Mass.
    pub mass_kg: T,
    /// Mass that the vehicle file states: what commanded accelerations refer to.
    pub nominal_mass_kg: f64,
    /// Yaw inertia, of a car whose wheels stand still.
    pub yaw_inertia_kgm2: T,
    /// What the turning wheels add to it: in yaw the outer ones are turned faster, the inner ones slower.
    pub wheels_kgm2: f64,
    /// Centre of gravity to front axle.
    pub l_f_m: T,
    /// Centre of gravity to rear axle.
    pub l_r_m: T,
    /// How far the true centre of gravity lies ahead of the nominal one, where the sensors are.
    pub cog_shift_m: T,
    /// Relaxation length of the tires; 0: none.
    pub relaxation_m: T,
    /// Time in which the body follows the lateral acceleration in roll.
    pub roll_time_s: T,
    /// Frequency at which the body pitches.
    pub pitch_frequency_hz: T,
    /// Drag of the air over nominal mass and square of the speed.
    pub drag_1pm: T,
    /// True forward speed over the reported one.
    pub speed_factor: T,
    /// Grip of the front and the rear axle, D of the Magic Formula.
    pub peak: [T; 2],
    /// Share of the drive force at the front axle.
    pub drive_front_share: T,
    /// Share of the brake force at the front axle.
    pub brake_front_share: T,
}

/// What the inertia of the turning wheels adds to the mass along the road, as a share of it. Wong, Theory of Ground Vehicles, section 3.1: 1.04 and more.
pub(crate) const TURNING_SHARE: f64 = 0.06;

/// Yaw inertia of the turning of the wheels. A wheel half a track t off the middle runs at v_x -+ r t/2: what of the mass they add along the road, they add
/// to the yaw inertia at that lever, whatever moment yaw_inertia_kgm2 was measured with.
pub(crate) fn wheels_kgm2(vehicle: &VehicleParameters) -> f64 {
    let lever_m = 0.5 * vehicle.track_m();
    TURNING_SHARE * vehicle.mass_kg * lever_m * lever_m
}

/// Time in which a car's body follows the lateral acceleration in roll, where nothing is known of it: 2 zeta/omega of a body that rolls at 3.5 Hz with
/// half of the critical damping. Between 1.5 Hz and 5 Hz, at a third to two thirds of it: 0.02 to 0.1 s.
pub(crate) const ROLL_TIME_S: f64 = 0.045;

/// Frequency at which a car's body pitches, where nothing is known of it.
pub(crate) const PITCH_FREQUENCY_HZ: f64 = 4.0;

impl<T: Real> Car<T> {
    /// Yaw inertia that a moment has to turn, wheels included.
    pub fn turned_kgm2(&self) -> T {
        self.yaw_inertia_kgm2 + self.wheels_kgm2
    }

    /// The car as the vehicle file states it.
    pub fn nominal(vehicle: &VehicleParameters, peak: [T; 2]) -> Self {
        Self {
            mass_kg: T::from(vehicle.mass_kg),
            nominal_mass_kg: vehicle.mass_kg,
            yaw_inertia_kgm2: T::from(vehicle.yaw_inertia_kgm2),
            wheels_kgm2: wheels_kgm2(vehicle),
            l_f_m: T::from(vehicle.l_f_m),
            l_r_m: T::from(vehicle.l_r_m),
            cog_shift_m: T::from(0.0),
            relaxation_m: T::from(0.0),
            roll_time_s: T::from(ROLL_TIME_S),
            pitch_frequency_hz: T::from(PITCH_FREQUENCY_HZ),
            drag_1pm: T::from(0.0),
            speed_factor: T::from(1.0),
            peak,
            drive_front_share: T::from(vehicle.front_drive_share()),
            brake_front_share: T::from(vehicle.front_brake_share()),
        }
    }

    /// Distance between the axles.
    pub fn wheelbase_m(&self) -> T {
        self.l_f_m + self.l_r_m
    }

    /// The axles at rest.
    pub fn axles_at_rest(&self) -> Axles<T> {
        let axle =
            |load_n| Axle { load_n, steer_rad: T::from(0.0), grip: T::from(1.0), usable: T::from(1.0) };
        let rear_n = self.mass_kg * GRAVITY_MPS2 * self.l_f_m / self.wheelbase_m();
        Axles { front: axle(self.front_load_at_rest_n()), rear: axle(rear_n) }
    }

    /// Load of the front axle at rest.
    pub fn front_load_at_rest_n(&self) -> T {
        self.mass_kg * GRAVITY_MPS2 * self.l_r_m / self.wheelbase_m()
    }

    /// Share of the longitudinal force at the front axle.
    pub fn front_share(&self, driving: bool) -> T {
        if driving { self.drive_front_share } else { self.brake_front_share }
    }

    /// The largest lateral acceleration that the tires give with these loads.
    pub fn largest_a_y_mps2(&self, axles: &Axles<T>) -> T {
        (self.peak[0] * axles.front.load_n + self.peak[1] * axles.rear.load_n) / self.mass_kg
    }
}

/// One axle at an instant.
#[derive(Debug, Clone, Copy)]
pub struct Axle<T> {
    /// Vertical load.
    pub load_n: T,
    /// Steering angle on top of the driver's.
    pub steer_rad: T,
    /// Factor on D at constant cornering stiffness.
    pub grip: T,
    /// Factor on the lateral force.
    pub usable: T,
}

/// How much less a tire carries, per load, for every share of load that comes on top of the one at rest.
const LOAD_SENSITIVITY: f64 = 0.1;

impl<T: Real> Axle<T> {
    /// The load as the tire makes use of it: a tire's force grows less than its load does (Pacejka, Tire and Vehicle Dynamics, section 4.3.1,
    /// `p_Dy2`).
    pub fn carried_n(&self, at_rest_n: T) -> T {
        let (load_n, share) = (self.load_n.re(), self.load_n.re() / at_rest_n.re());
        let used = 1.0 - LOAD_SENSITIVITY * (share - 1.0);
        T::chain(
            load_n * used,
            [(used - LOAD_SENSITIVITY * share, &self.load_n), (LOAD_SENSITIVITY * share * share, &at_rest_n)],
        )
    }
}

/// Both axles at an instant.
#[derive(Debug, Clone, Copy)]
pub struct Axles<T> {
    /// Front axle.
    pub front: Axle<T>,
    /// Rear axle.
    pub rear: Axle<T>,
}

/// What is known of an instant before the tires are asked.
#[derive(Debug, Clone, Copy)]
pub struct Moment<T> {
    /// Forward speed.
    pub v_x_mps: T,
    /// Yaw rate.
    pub yaw_rate_radps: T,
    /// Angle of the front wheels, but for what the axles' effects add.
    pub steering_rad: T,
    /// Lateral acceleration from the tires, a moment ago.
    pub a_y_mps2: T,
    /// The same behind the roll of the body.
    pub rolled_a_y_mps2: T,
    /// F_y/F_z of the front axle, a moment ago.
    pub front_use: T,
    /// Longitudinal acceleration (specific force).
    pub a_x_mps2: f64,
    /// The same as the springs carry it, behind the pitch of the body.
    pub carried_a_x_mps2: T,
    /// Commanded longitudinal force over the nominal mass, or its stand-in, the longitudinal acceleration.
    pub force_x_mps2: f64,
    /// Time since the start of the recording.
    pub minutes: f64,
    /// Distance along the lap over the lap's length, in 0..1, or along the way driven where no lap was closed; 0 without a pose.
    pub lap_share: f64,
    /// Length of the lap, or of the way driven and a fifth more; 0 without a pose.
    pub lap_m: f64,
    /// Where on the course, as an angle that comes round once a lap: of the distance along it, without a pose the heading.
    pub place_rad: f64,
}

/// Accelerations from outside the tires.
#[derive(Debug, Clone, Copy)]
pub struct Motion<T> {
    /// On v_x and on an accelerometer alike (drag, rolling resistance).
    pub force_x_mps2: T,
    /// On v_x alone (gravity along the road).
    pub gravity_x_mps2: T,
    /// On v_y alone (gravity across the road).
    pub gravity_y_mps2: T,
    /// On v_y and on an accelerometer alike.
    pub force_y_mps2: T,
    /// On the yaw rate.
    pub yaw_radps2: T,
}

impl<T: Real> Motion<T> {
    /// Nothing from outside.
    #[must_use]
    pub fn none() -> Self {
        let zero = T::from(0.0);
        Self {
            force_x_mps2: zero,
            gravity_x_mps2: zero,
            gravity_y_mps2: zero,
            force_y_mps2: zero,
            yaw_radps2: zero,
        }
    }
}

/// The motion of the car over a window, sample by sample, on its way to the recorded signals.
#[derive(Debug, Clone)]
pub struct Outputs<T> {
    /// Step between samples.
    pub dt_s: f64,
    /// Lateral velocity at the odometry's point.
    pub v_y_mps: Vec<T>,
    /// Yaw rate of odometry and gyroscope.
    pub yaw_rate_radps: Vec<T>,
    /// Yaw acceleration.
    pub yaw_acceleration_radps2: Vec<T>,
    /// Specific force to the left.
    pub a_y_mps2: Vec<T>,
    /// Specific force forward.
    pub a_x_mps2: Vec<T>,
    /// Forward speed, but for a constant.
    pub v_x_mps: Vec<T>,
    /// Heading, but for a constant.
    pub heading_rad: Vec<T>,
}

impl<T> Outputs<T> {
    /// Room for `n` samples.
    pub(crate) fn of(dt_s: f64, n: usize) -> Self {
        let room = || Vec::with_capacity(n);
        Self {
            dt_s,
            v_y_mps: room(),
            yaw_rate_radps: room(),
            yaw_acceleration_radps2: room(),
            a_y_mps2: room(),
            a_x_mps2: room(),
            v_x_mps: room(),
            heading_rad: room(),
        }
    }
}

/// A first-order lag over a step in which its input is linear: exact, and at `tau_s` = 0 exactly the input, with the right derivative.
///
/// tau y' + y = u,  u = u0 + s t:  y(h) = u1 - s tau + (y0 - u0 + s tau) exp(-h/tau)
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lag<T> {
    h_s: f64,
    tau_s: T,
    /// exp(-h/tau)
    decay: f64,
    /// Its derivative by tau, 1/s.
    decay_by_tau_1ps: f64,
}

/// A number and its derivatives by others.
type Derived<const K: usize> = (f64, [f64; K]);

impl<T: Real> Lag<T> {
    pub(crate) fn new(h_s: f64, tau_s: T) -> Self {
        /// Times tau in a step after which nothing is left of the start.
        const NIL: f64 = 30.0;
        let steps = h_s / tau_s.re();
        let decay = if steps <= NIL { (-steps).exp() } else { 0.0 };
        let decay_by_tau_1ps = if decay > 0.0 { decay * steps / tau_s.re() } else { 0.0 };
        Self { h_s, tau_s, decay, decay_by_tau_1ps }
    }

    /// The output after a step in which the input goes from `u0` to `u1`.
    pub(crate) fn step(&self, y0: T, u0: T, u1: T) -> T {
        let (end, [by_y0, by_u0, by_u1, by_tau]) = self.end(y0.re(), u0.re(), u1.re());
        T::chain(end, [(by_y0, &y0), (by_u0, &u0), (by_u1, &u1), (by_tau, &self.tau_s)])
    }

    /// The output on average over the step: where the lag is short, the end of the step does not show that it came late. `middle`: the input halfway.
    pub(crate) fn mean(&self, y0: T, u0: T, middle: T) -> T {
        let share = self.tau_s.re() / self.h_s;
        let end_of = self.end(y0.re(), u0.re(), 2.0 * middle.re() - u0.re());
        let (end, [by_y0, by_u0, by_u1, by_tau]) = end_of;
        let risen = end - y0.re();
        T::chain(
            middle.re() - share * risen,
            [
                (share * (1.0 - by_y0), &y0),
                (share * (by_u1 - by_u0), &u0),
                (1.0 - 2.0 * share * by_u1, &middle),
                (-share * by_tau - risen / self.h_s, &self.tau_s),
            ],
        )
    }

    /// The output after a step, with its derivatives by y0, u0, u1 and tau.
    fn end(&self, y0: f64, u0: f64, u1: f64) -> Derived<4> {
        let (share, rise) = (self.tau_s.re() / self.h_s, u1 - u0);
        let behind = y0 - u0 + share * rise;
        let end = u1 - share * rise + behind * self.decay;
        let gone = 1.0 - self.decay;
        let by_tau = behind * self.decay_by_tau_1ps - gone * rise / self.h_s;
        (end, [self.decay, share * gone - self.decay, 1.0 - share * gone, by_tau])
    }
}

/// A body on springs and dampers, half critically damped, over steps of one length: what they carry of an acceleration a,
/// x'' = w^2 (a - x) - w x', carried: x + x'/w.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sprung<T> {
    frequency_radps: T,
    /// How x - a and x' go on.
    transition: [[T; 2]; 2],
}

impl<T: Real> Sprung<T> {
    pub(crate) fn new(frequency_hz: T, step_s: f64) -> Self {
        const DAMPING_RATIO: f64 = 0.5;
        let undamped = (1.0 - DAMPING_RATIO * DAMPING_RATIO).sqrt();
        let w = frequency_hz * std::f64::consts::TAU;
        let (sin, cos) = (w * (undamped * step_s)).sin_cos();
        let decay = (w * (-DAMPING_RATIO * step_s)).exp();
        let (turn, across) = (sin * (DAMPING_RATIO / undamped), sin * undamped.recip());
        let transition =
            [[(cos + turn) * decay, across / w * decay], [-(across * w * decay), (cos - turn) * decay]];
        Self { frequency_radps: w, transition }
    }

    /// x and x' a step later, in which a is `a_mps2` on average.
    pub(crate) fn step(&self, [x, rate]: [T; 2], a_mps2: f64) -> [T; 2] {
        let [to_x, to_rate] = self.transition;
        let away = x - a_mps2;
        [to_x[0] * away + to_x[1] * rate + a_mps2, to_rate[0] * away + to_rate[1] * rate]
    }

    pub(crate) fn carried(&self, [x, rate]: [T; 2]) -> T {
        x + rate / self.frequency_radps
    }
}

/// A series `delay_s` later, linear between samples; before the first sample it is taken as going on straight.
pub(crate) fn delayed<T: Real>(series: &[T], delay_s: T, dt_s: f64) -> Vec<T> {
    let n = series.len();
    if n < 2 {
        return series.to_vec();
    }
    let shift = delay_s / dt_s;
    (0..n)
        .map(|k| {
            if shift.re().abs() < 1e-9 {
                let (a, b) = (k.saturating_sub(1), (k + 1).min(n - 1));
                return series[k] - (series[b] - series[a]) / (b - a) as f64 * shift;
            }
            let place = -shift + k as f64;
            let left = (place.re().floor().max(0.0) as usize).min(n - 2);
            series[left] + (series[left + 1] - series[left]) * (place - left as f64)
        })
        .collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use gripsight_vehicle::Dual;

    use super::*;

    #[test]
    fn a_tire_makes_less_of_more_load() {
        let carried = |load_n: f64| Axle { load_n, steer_rad: 0.0, grip: 1.0, usable: 1.0 }.carried_n(1000.0);
        approx::assert_relative_eq!(carried(1000.0), 1000.0);
        approx::assert_relative_eq!(carried(1100.0), 1100.0 * 0.99);
        approx::assert_relative_eq!(carried(800.0), 800.0 * 1.02);
    }

    /// Asserts that a number is another one with its derivatives.
    pub(crate) fn assert_same<const N: usize>(a: Dual<N>, b: Dual<N>) {
        approx::assert_relative_eq!(a.re(), b.re(), max_relative = 1e-12);
        for (a, b) in a.derivatives().iter().zip(b.derivatives()) {
            approx::assert_relative_eq!(a, b, max_relative = 1e-10, epsilon = 1e-13);
        }
    }

    #[test]
    fn steps_that_are_derived_at_once_are_what_their_formulas_give() {
        const H_S: f64 = 0.01;
        let of = |lane: usize, value: f64| Dual::<4>::variable(value, lane);
        for tau_s in [1e-5, 2e-3, 0.02] {
            let [y0, u0, u1, tau_s] =
                [0.3, 1.0, 1.4, tau_s].into_iter().enumerate().map(|(i, v)| of(i, v)).collect::<Vec<_>>()[..]
            else {
                unreachable!()
            };
            let decay = (-(tau_s.recip() * H_S)).exp();
            let step = |u1: Dual<4>| {
                let ramp = (u1 - u0) / H_S * tau_s;
                u1 - ramp + (y0 - u0 + ramp) * decay
            };
            let lag = Lag::new(H_S, tau_s);
            assert_same(lag.step(y0, u0, u1), step(u1));
            let end = step(u1 * 2.0 - u0);
            assert_same(lag.mean(y0, u0, u1), u1 - (end - y0) / H_S * tau_s);
        }
        let [load_n, at_rest_n, one] = [of(0, 900.0), of(1, 1000.0), Dual::from(1.0)];
        let axle = Axle { load_n, steer_rad: one, grip: one, usable: one };
        let more = load_n / at_rest_n - 1.0;
        assert_same(axle.carried_n(at_rest_n), load_n * (-(more * LOAD_SENSITIVITY) + 1.0));
    }

    #[test]
    fn a_lag_is_the_solution_of_its_equation_at_the_end_of_a_step_and_on_average() {
        const STEPS: usize = 100_000;
        const H_S: f64 = 0.005;
        let (y0, u0, u1) = (0.3, 1.0, 1.4);
        for tau_s in [1e-4, 1e-3, 0.01] {
            let (mut y, mut sum) = (y0, 0.0);
            for i in 0..STEPS {
                let u = u0 + (u1 - u0) * (i as f64 + 0.5) / STEPS as f64;
                let next = u + (y - u) * (-H_S / STEPS as f64 / tau_s).exp();
                sum += 0.5 * (y + next) / STEPS as f64;
                y = next;
            }
            let lag = Lag::new(H_S, tau_s);
            approx::assert_relative_eq!(lag.step(y0, u0, u1), y, epsilon = 1e-6);
            approx::assert_relative_eq!(lag.mean(y0, u0, 0.5 * (u0 + u1)), sum, epsilon = 1e-6);
        }
    }
}
