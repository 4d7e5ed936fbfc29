//! The dynamic single-track model (paper eq. 1-5), static axle loads.
//!
//! ```text
//! dv_y/dt = (F_yr + F_yf cos d - m v_x w)/m
//! dw/dt   = (F_yf l_f cos d - F_yr l_r)/I_z
//! alpha_f = d - atan((v_y + l_f w)/v_x),  alpha_r = -atan((v_y - l_r w)/v_x)
//! F_yi    = F_zi (F_y/F_z)(alpha_i),      F_zf = m g l_r/L,  F_zr = m g l_f/L
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | v_x, v_y | velocity of the centre of gravity, forward and left | m/s |
//! | w | yaw rate | rad/s |
//! | d | road-wheel steering angle | rad |
//! | alpha | slip angle of an axle | rad |
//! | F_y, F_z | lateral force and vertical load of an axle | N |
//!
//! v_x is an input. Not in it: load transfer, relaxation, combined slip, aero, longitudinal forces.

use crate::{GRAVITY_MPS2, MagicFormula, PacejkaParameters, Real, VehicleParameters};

/// Below this forward speed slip angles mean nothing; the model is evaluated as if at this speed.
const MIN_SPEED_MPS: f64 = 0.2;

/// The state that the model integrates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<T = f64> {
    /// Lateral velocity of the centre of gravity.
    pub v_y_mps: T,
    /// Yaw rate.
    pub yaw_rate_radps: T,
}

/// What acts on the model from outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Input<T = f64> {
    /// Forward velocity.
    pub v_x_mps: T,
    /// Road-wheel steering angle.
    pub steering_rad: T,
}

/// Car and tires together.
#[derive(Debug, Clone, Copy)]
pub struct SingleTrack<T = f64> {
    /// Front axle's tires.
    pub front: MagicFormula<T>,
    /// Rear axle's tires.
    pub rear: MagicFormula<T>,
    mass_kg: f64,
    yaw_inertia_kgm2: f64,
    l_f_m: f64,
    l_r_m: f64,
    load_front_n: f64,
    load_rear_n: f64,
}

impl<T: Real> SingleTrack<T> {
    /// The model of a car on given tires.
    #[must_use]
    pub fn new(vehicle: &VehicleParameters, tires: &PacejkaParameters<T>) -> Self {
        Self {
            front: tires.front,
            rear: tires.rear,
            mass_kg: vehicle.mass_kg,
            yaw_inertia_kgm2: vehicle.yaw_inertia_kgm2,
            l_f_m: vehicle.l_f_m,
            l_r_m: vehicle.l_r_m,
            load_front_n: vehicle.static_load_front_n(),
            load_rear_n: vehicle.static_load_rear_n(),
        }
    }

    /// Slip angles of the front and the rear axle.
    pub fn slip_angles_rad(&self, state: &State<T>, input: &Input<T>) -> (T, T) {
        let (v_x_mps, follows) = match input.v_x_mps.re() {
            slow if slow < MIN_SPEED_MPS => (MIN_SPEED_MPS, 0.0),
            v_x_mps => (v_x_mps, 1.0),
        };
        // The angle of the velocity of a point ahead of the centre of gravity.
        let angle = |ahead_m: f64| {
            let slope = (state.v_y_mps.re() + ahead_m * state.yaw_rate_radps.re()) / v_x_mps;
            let by_slope = 1.0 / (1.0 + slope * slope);
            let by_v_y = by_slope / v_x_mps;
            T::chain(
                slope.atan(),
                [
                    (by_v_y, &state.v_y_mps),
                    (by_v_y * ahead_m, &state.yaw_rate_radps),
                    (-by_v_y * slope * follows, &input.v_x_mps),
                ],
            )
        };
        let (front, rear) = (input.steering_rad - angle(self.l_f_m), -angle(-self.l_r_m));
        (front, rear)
    }

    /// Lateral forces of the front and the rear axle, each across its own wheels.
    pub fn lateral_forces_n(&self, state: &State<T>, input: &Input<T>) -> (T, T) {
        let (front, rear) = self.slip_angles_rad(state, input);
        (
            self.front.normalized_force(front) * self.load_front_n,
            self.rear.normalized_force(rear) * self.load_rear_n,
        )
    }

    /// Time derivative of the state (dv_y/dt in m/s2, dw/dt in rad/s2, in the fields of a [`State`]).
    pub fn derivative(&self, state: &State<T>, input: &Input<T>) -> State<T> {
        let (force_front, force_rear) = self.lateral_forces_n(state, input);
        let force_front = force_front * input.steering_rad.cos();
        State {
            v_y_mps: (force_rear + force_front) / self.mass_kg - input.v_x_mps * state.yaw_rate_radps,
            yaw_rate_radps: (force_front * self.l_f_m - force_rear * self.l_r_m) / self.yaw_inertia_kgm2,
        }
    }

    /// One step of the explicit midpoint rule (second order) over `dt_s`, the input linear between `from` and `to`, in
    /// substeps of at most `max_substep_s`.
    pub fn step(
        &self,
        state: State<T>,
        from: &Input<T>,
        to: &Input<T>,
        dt_s: f64,
        max_substep_s: f64,
    ) -> State<T> {
        let substeps = (dt_s / max_substep_s - 1e-9).ceil().max(1.0);
        let h_s = dt_s / substeps;
        let at = |share: f64| Input {
            v_x_mps: from.v_x_mps + (to.v_x_mps - from.v_x_mps) * share,
            steering_rad: from.steering_rad + (to.steering_rad - from.steering_rad) * share,
        };
        let mut x = state;
        for k in 0..substeps as usize {
            let slope = self.derivative(&x, &at(k as f64 / substeps));
            let middle = advance(&x, &slope, h_s / 2.0);
            let slope = self.derivative(&middle, &at((k as f64 + 0.5) / substeps));
            x = advance(&x, &slope, h_s);
        }
        x
    }
}

fn advance<T: Real>(x: &State<T>, slope: &State<T>, h_s: f64) -> State<T> {
    State {
        v_y_mps: x.v_y_mps + slope.v_y_mps * h_s,
        yaw_rate_radps: x.yaw_rate_radps + slope.yaw_rate_radps * h_s,
    }
}

impl VehicleParameters {
    /// Static load of the front axle, m g l_r/L.
    #[must_use]
    pub fn static_load_front_n(&self) -> f64 {
        self.mass_kg * GRAVITY_MPS2 * self.l_r_m / self.wheelbase_m()
    }

    /// Static load of the rear axle, m g l_f/L.
    #[must_use]
    pub fn static_load_rear_n(&self) -> f64 {
        self.mass_kg * GRAVITY_MPS2 * self.l_f_m / self.wheelbase_m()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn car() -> SingleTrack {
        let tires = PacejkaParameters::from_array([7.0, 1.6, 0.9, 0.1, 9.0, 1.5, 0.95, -0.2]);
        SingleTrack::new(&VehicleParameters::f1tenth(), &tires)
    }

    proptest! {
        #[test]
        fn mirrored_input_mirrors_the_car(v_x in 1.0..10.0, v_y in -1.0..1.0, w in -3.0..3.0, d in -0.4..0.4) {
            let left = car().derivative(
                &State { v_y_mps: v_y, yaw_rate_radps: w }, &Input { v_x_mps: v_x, steering_rad: d });
            let right = car().derivative(
                &State { v_y_mps: -v_y, yaw_rate_radps: -w }, &Input { v_x_mps: v_x, steering_rad: -d });
            prop_assert_eq!(left.v_y_mps, -right.v_y_mps);
            prop_assert_eq!(left.yaw_rate_radps, -right.yaw_rate_radps);
        }
    }

    #[test]
    fn the_step_is_of_second_order() {
        let input = Input { v_x_mps: 4.0, steering_rad: 0.1 };
        let run = |h_s: f64| {
            let mut x = State { v_y_mps: 0.0, yaw_rate_radps: 0.0 };
            for _ in 0..(0.2 / h_s).round() as usize {
                x = car().step(x, &input, &input, h_s, h_s);
            }
            nalgebra::Vector2::new(x.v_y_mps, x.yaw_rate_radps)
        };
        let exact = run(1e-5);
        let ratio = (run(2e-3) - exact).norm() / (run(1e-3) - exact).norm();
        assert!((3.6..4.4).contains(&ratio), "error ratio {ratio}");
    }

    #[test]
    fn steady_cornering_balances_the_paper_s_forces() {
        // Paper eq. 14: F_yr = m l_f/L v_x w, F_yf = m l_r/L v_x w / cos d in a steady turn.
        let (car, vehicle) = (car(), VehicleParameters::f1tenth());
        let input = Input { v_x_mps: 4.0, steering_rad: 0.08 };
        let mut x = State { v_y_mps: 0.0, yaw_rate_radps: 0.0 };
        for _ in 0..5000 {
            x = car.step(x, &input, &input, 1e-3, 1e-3);
        }
        let (front_n, rear_n) = car.lateral_forces_n(&x, &input);
        let share = vehicle.mass_kg * input.v_x_mps * x.yaw_rate_radps / vehicle.wheelbase_m();
        approx::assert_relative_eq!(rear_n, share * vehicle.l_f_m, max_relative = 1e-6);
        approx::assert_relative_eq!(front_n, share * vehicle.l_r_m / 0.08_f64.cos(), max_relative = 1e-6);
    }
}
