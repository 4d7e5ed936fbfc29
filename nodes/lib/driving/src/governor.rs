//! Notices, while the car drives, that the road gives less than the plan asks for.
//!
//! ```text
//! given_f     (l_r (mean(v_x w) + slope(v_y)) + I_z/m slope(w))/(l_r cos d)    over the last 0.2 s, front axle; the rear one with l_f and -I_z
//! promised_f  mean(g n_f(alpha_f))                                            at the slips of the same time, on the planned tires
//! ```
//!
//! Each axle is judged alone, and the car as a whole, more strictly: a car that pushes over its front wheels has most of its rear grip left.
//! Where the plan's tires are far into their slip and an axle pushes much less than they say, the grip is what was given. It is the rule by which
//! the identifier warns of fallen grip, applied to a plan that may go beyond what was shown.
//!
//! Tires that nobody measured may be half as stiff as the car's: such a curve promises a force only at slips where the road has long given all. Their
//! stiffness is therefore taken from the car, where little of the grip is used.

use std::collections::VecDeque;

use gripsight_vehicle::{
    GRAVITY_MPS2, Input, MagicFormula, PacejkaParameters, SingleTrack, State, VehicleParameters,
};

use crate::CarState;

/// What is averaged over: a look.
const LOOK_S: f64 = 0.2;
/// Share of the planned grip from which a look says anything.
const ASKED: f64 = 0.8;
/// Share of what was promised below which the grip is less than planned.
const GIVEN: f64 = 0.88;
/// The same for one axle, which may lose some to the drive and to the load that moves.
const GIVEN_AXLE: f64 = 0.7;
/// Looks in a row that must say so: noise alone never does.
const LOOKS: u32 = 4;
/// Shares of the planned grip between which the stiffness shows.
const STIFFNESS_SHOWS: std::ops::Range<f64> = 0.06..0.25;
/// What a look less counts than the next, for the stiffness.
const FORGETS: f64 = 0.998;
/// Most that a car's tires are stiffer than those assumed.
const STIFFER: f64 = 4.0;

/// What a look says.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Looked {
    /// Grip (acceleration over g) that the car turned with.
    pub(crate) turned: f64,
    /// Grip that the road gave, where that is clearly less than the plan's.
    pub(crate) given: Option<f64>,
}

#[derive(Debug, Clone, Copy)]
struct Seen {
    stamp_s: f64,
    v_x_mps: f64,
    v_y_mps: f64,
    yaw_rate_radps: f64,
    turned_mps2: f64,
    cos: f64,
    /// Of each axle, over the mass that it carries.
    promised_mps2: [f64; 2],
    /// The same on the tires as they were assumed.
    assumed_mps2: [f64; 2],
}

/// Watches a plan.
#[derive(Debug, Clone)]
pub(crate) struct Governor {
    recent: VecDeque<Seen>,
    low: u32,
    /// Sums of given times promised and of promised squared, where little is asked: the stiffness of the car's tires over those assumed.
    stiffness: (f64, f64),
}

impl Default for Governor {
    fn default() -> Self {
        Self { recent: VecDeque::new(), low: 0, stiffness: (0.0, 0.0) }
    }
}

impl Governor {
    /// Forgets what it has seen: after a new plan.
    pub(crate) fn reset(&mut self) {
        self.recent.clear();
        self.low = 0;
    }

    fn stiffer(&self) -> f64 {
        let (both, square) = self.stiffness;
        if square > 0.0 { (both / square).clamp(1.0, STIFFER) } else { 1.0 }
    }

    /// Takes a state with the road-wheel angle that acts on it. `assumed`: nobody measured the tires.
    pub(crate) fn look(
        &mut self,
        state: &CarState,
        steering_rad: f64,
        vehicle: &VehicleParameters,
        tires: &PacejkaParameters,
        assumed: bool,
    ) -> Option<Looked> {
        let motion = State { v_y_mps: state.v_y_mps, yaw_rate_radps: state.yaw_rate_radps };
        let input = Input { v_x_mps: state.v_x_mps, steering_rad };
        let loads = [vehicle.static_load_front_n(), vehicle.static_load_rear_n()];
        let most = GRAVITY_MPS2 * tires.front.d.min(tires.rear.d);
        let push_mps2 = |tires: &PacejkaParameters| {
            let (front_n, rear_n) = SingleTrack::new(vehicle, tires).lateral_forces_n(&motion, &input);
            [front_n / loads[0], rear_n / loads[1]].map(|share| GRAVITY_MPS2 * share)
        };
        let assumed_mps2 = push_mps2(tires);
        let promised_mps2 = if assumed { push_mps2(&stiffened(tires, self.stiffer())) } else { assumed_mps2 };
        self.recent.push_back(Seen {
            stamp_s: state.stamp_s,
            v_x_mps: state.v_x_mps,
            v_y_mps: state.v_y_mps,
            yaw_rate_radps: state.yaw_rate_radps,
            turned_mps2: state.v_x_mps * state.yaw_rate_radps,
            cos: steering_rad.cos(),
            promised_mps2,
            assumed_mps2,
        });
        while self.recent.get(1).is_some_and(|second| second.stamp_s <= state.stamp_s - LOOK_S) {
            self.recent.pop_front();
        }
        let span_s = state.stamp_s - self.recent.front()?.stamp_s;
        if span_s < 0.9 * LOOK_S {
            return None;
        }
        let n = self.recent.len();
        let mean = |from: usize, to: usize, of: &dyn Fn(&Seen) -> f64| {
            self.recent.range(from..to).map(of).sum::<f64>() / (to - from).max(1) as f64
        };
        let end = (n / 4).max(1);
        let apart_s = mean(n - end, n, &|s| s.stamp_s) - mean(0, end, &|s| s.stamp_s);
        let slope = |of: &dyn Fn(&Seen) -> f64| (mean(n - end, n, of) - mean(0, end, of)) / apart_s.max(1e-3);
        let sideways = mean(0, n, &|s| s.turned_mps2) + slope(&|s| s.v_y_mps);
        let turning = vehicle.yaw_inertia_kgm2 / vehicle.mass_kg * slope(&|s| s.yaw_rate_radps);
        let given = [
            (sideways + turning / vehicle.l_r_m) / mean(0, n, &|s| s.cos).max(0.5),
            sideways - turning / vehicle.l_f_m,
        ];
        let (mut road, mut sums): (Option<f64>, _) = (None, [0.0; 2]);
        let mut looks = Vec::with_capacity(3);
        // What drives or brakes each axle, over the mass that it carries.
        let a_x = slope(&|s| s.v_x_mps) - mean(0, n, &|s| s.v_y_mps * s.yaw_rate_radps);
        let front = if a_x > 0.0 { vehicle.front_drive_share() } else { vehicle.front_brake_share() };
        let weight_n = loads[0] + loads[1];
        let along = [front * a_x * weight_n / loads[0], (1.0 - front) * a_x * weight_n / loads[1]];
        for (axle, given) in given.into_iter().enumerate() {
            let promised = mean(0, n, &|s| s.promised_mps2[axle]);
            let alone = mean(0, n, &|s| s.assumed_mps2[axle]);
            if assumed && STIFFNESS_SHOWS.contains(&(alone.abs() / most)) {
                let (both, square) = self.stiffness;
                self.stiffness = (FORGETS * both + given * alone, FORGETS * square + alone * alone);
            }
            sums = [sums[0] + loads[axle] * given, sums[1] + loads[axle] * promised];
            looks.push((given, promised, along[axle], GIVEN_AXLE));
        }
        looks.push((sums[0] / weight_n, sums[1] / weight_n, a_x, GIVEN));
        for (given, promised, along, enough) in looks {
            // Tires that also drive or brake push less to the side.
            let left = (1.0 - (along / most).powi(2)).max(0.1).sqrt();
            let promised = left * promised;
            let share = given / promised;
            if promised.abs() > ASKED * most * left && share < enough {
                let grip = (share.max(0.2) * promised).hypot(along) / GRAVITY_MPS2;
                road = Some(road.map_or(grip, |other| other.min(grip)));
            }
        }
        self.low = if road.is_some() { self.low + 1 } else { 0 };
        Some(Looked { turned: sideways.abs() / GRAVITY_MPS2, given: road.filter(|_| self.low >= LOOKS) })
    }
}

/// The same tires with another stiffness: peak and shape stay.
fn stiffened(tires: &PacejkaParameters, by: f64) -> PacejkaParameters {
    let axle = |t: &MagicFormula| MagicFormula::from_stiffness(by * t.normalized_stiffness(), t.c, t.d, t.e);
    PacejkaParameters { front: axle(&tires.front), rear: axle(&tires.rear) }
}
