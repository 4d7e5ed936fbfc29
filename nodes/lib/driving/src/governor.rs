//! Notices, while the car drives, that the road gives less than the plan asks for.
//!
//! ```text
//! given     mean(v_x w) + slope(v_y)                   over the last 0.2 s
//! promised  mean((F_yf(alpha_f) cos d + F_yr(alpha_r))/m)   at the slips of the same time, on the planned tires
//! ```
//!
//! Where the plan's tires are far into their slip and the car turns much less than they say, the grip is what was given. It is the rule by which the
//! identifier warns of fallen grip, applied to a plan that may go beyond what was shown.

use std::collections::VecDeque;

use gripsight_vehicle::{GRAVITY_MPS2, Input, PacejkaParameters, SingleTrack, State, VehicleParameters};

use crate::CarState;

/// What is averaged over: a look.
const LOOK_S: f64 = 0.2;
/// Share of the planned grip from which a look says anything.
const ASKED: f64 = 0.8;
/// Share of what was promised below which the grip is less than planned.
const GIVEN: f64 = 0.88;
/// Looks in a row that must say so: noise alone never does.
const LOOKS: u32 = 4;

#[derive(Debug, Clone, Copy)]
struct Seen {
    stamp_s: f64,
    v_y_mps: f64,
    turned_mps2: f64,
    promised_mps2: f64,
}

/// Watches a plan.
#[derive(Debug, Clone, Default)]
pub(crate) struct Governor {
    recent: VecDeque<Seen>,
    low: u32,
}

impl Governor {
    /// Forgets what it has seen: after a new plan.
    pub(crate) fn reset(&mut self) {
        self.recent.clear();
        self.low = 0;
    }

    /// Takes a state with the road-wheel angle and the longitudinal acceleration that act on it. Gives the grip (acceleration over g) that the road
    /// gave, where that is clearly less than the plan's.
    pub(crate) fn look(
        &mut self,
        state: &CarState,
        acting: (f64, f64),
        vehicle: &VehicleParameters,
        tires: &PacejkaParameters,
    ) -> Option<f64> {
        let (steering_rad, a_x) = acting;
        let car = SingleTrack::new(vehicle, tires);
        let motion = State { v_y_mps: state.v_y_mps, yaw_rate_radps: state.yaw_rate_radps };
        let input = Input { v_x_mps: state.v_x_mps, steering_rad };
        let (front_n, rear_n) = car.lateral_forces_n(&motion, &input);
        let most = GRAVITY_MPS2 * tires.front.d.min(tires.rear.d);
        // Tires that also drive or brake push less to the side.
        let left = (1.0 - (a_x / most).powi(2)).max(0.1).sqrt();
        self.recent.push_back(Seen {
            stamp_s: state.stamp_s,
            v_y_mps: state.v_y_mps,
            turned_mps2: state.v_x_mps * state.yaw_rate_radps,
            promised_mps2: left * (front_n * steering_rad.cos() + rear_n) / vehicle.mass_kg,
        });
        while self.recent.get(1).is_some_and(|second| second.stamp_s <= state.stamp_s - LOOK_S) {
            self.recent.pop_front();
        }
        let span_s = state.stamp_s - self.recent.front()?.stamp_s;
        if span_s < 0.9 * LOOK_S {
            return None;
        }
        let n = self.recent.len();
        let mean = |from: usize, to: usize, of: fn(&Seen) -> f64| {
            self.recent.range(from..to).map(of).sum::<f64>() / (to - from).max(1) as f64
        };
        let end = (n / 4).max(1);
        let apart_s = mean(n - end, n, |s| s.stamp_s) - mean(0, end, |s| s.stamp_s);
        let slid = (mean(n - end, n, |s| s.v_y_mps) - mean(0, end, |s| s.v_y_mps)) / apart_s.max(1e-3);
        let given = mean(0, n, |s| s.turned_mps2) + slid;
        let promised = mean(0, n, |s| s.promised_mps2);
        let low = promised.abs() > ASKED * most * left && given / promised < GIVEN;
        self.low = if low { self.low + 1 } else { 0 };
        (self.low >= LOOKS).then_some((given / promised).max(0.2) * promised.abs() / left / GRAVITY_MPS2)
    }
}
