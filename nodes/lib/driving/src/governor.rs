//! Notices, while the car drives, that the road gives less than the plan asks for.
//!
//! ```text
//! given_f     (l_r (mean(v_x w) + slope(v_y)) + I_z/m slope(w))/(l_r cos d)    over the last 0.2 s, front axle; the rear one with l_f and -I_z
//! promised_f  mean(g n_f(alpha_f)) lateral_f                                  at the slips of the same time, on the planned tires
//! ```
//!
//! lateral_f: what the friction ellipse leaves beside drive and brakes.
//!
//! Each axle is judged alone, and the car as a whole, more strictly: a car that pushes over its front wheels has most of its rear grip left.
//! Where the plan's tires are far into their slip and an axle pushes much less than they say, the grip is what was given. It is the rule by which
//! the identifier warns of fallen grip, applied to a plan that may go beyond what was shown.
//!
//! Tires that nobody measured may be half as stiff as the car's: such a curve promises a force only at slips where the road has long given all. Their
//! stiffness is therefore taken from the car, where little of the grip is used.

use std::collections::VecDeque;

use gripsight_vehicle::{
    AxleEllipse, GRAVITY_MPS2, Input, MagicFormula, PacejkaParameters, SingleTrack, State, VehicleParameters,
};

use crate::CarState;

/// What is averaged over: a look.
const LOOK_S: f64 = 0.2;
/// Share of the planned grip from which a look says anything.
const ASKED: f64 = 0.8;
/// Share of what was promised below which the grip is less than planned.
const GIVEN: f64 = 0.88;
/// The same for one axle, which is known less well.
const GIVEN_AXLE: f64 = 0.7;
/// What must be missing beyond that, share times seconds: looks overlap, and their noise lasts as long as they do. A fifth less shows after 40 ms, a few
/// hundredths less after a fifth of a second (Page's cumulative sum).
const MISSING_S: f64 = 0.008;
/// The same on tires that nobody measured, which promise too much far more often: a hundredth less over 40 ms.
const MISSING_ASSUMED_S: f64 = 0.0004;
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
    sin: f64,
    /// Of each axle, over the mass that it carries.
    promised_mps2: [f64; 2],
    /// The same on the tires as they were assumed.
    assumed_mps2: [f64; 2],
}

/// An axle, or the car as a whole, over a look: accelerations over the mass that it carries.
#[derive(Debug, Clone, Copy, Default)]
struct Look {
    given: f64,
    promised: f64,
    /// Share of the largest promise that is left beside what drives and brakes it, with the load that it carries then.
    left: f64,
    along: f64,
    /// Load over that of the car at rest.
    load: f64,
    /// Share of the promise that is enough.
    enough: f64,
}

/// Watches a plan.
#[derive(Debug, Clone)]
pub(crate) struct Governor {
    recent: VecDeque<Seen>,
    /// Share of the promise that was missing lately, times seconds.
    missing_s: f64,
    /// Sums of given times promised and of promised squared, where little is asked: the stiffness of the car's tires over those assumed.
    stiffness: (f64, f64),
}

impl Default for Governor {
    fn default() -> Self {
        Self { recent: VecDeque::new(), missing_s: 0.0, stiffness: (0.0, 0.0) }
    }
}

impl Governor {
    /// Lateral acceleration that the tires push with, by their slips on the planned set; `None`: not known.
    pub(crate) fn pushes_mps2(&self, vehicle: &VehicleParameters) -> Option<f64> {
        let [front, rear] = self.recent.back()?.promised_mps2;
        Some((vehicle.l_r_m * front + vehicle.l_f_m * rear) / vehicle.wheelbase_m())
    }

    /// Forgets what it has seen: after a new plan.
    pub(crate) fn reset(&mut self) {
        self.recent.clear();
        self.missing_s = 0.0;
    }

    /// How much stiffer the car's tires are than those assumed.
    pub(crate) fn stiffer(&self) -> f64 {
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
            sin: steering_rad.sin(),
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
        // Drive and brakes: beside them the car's turning and the steered wheels change v_x.
        let scrubs = vehicle.l_r_m / vehicle.wheelbase_m() * given[0] * mean(0, n, &|s| s.sin);
        let a_x = slope(&|s| s.v_x_mps) - mean(0, n, &|s| s.v_y_mps * s.yaw_rate_radps) + scrubs;
        let ellipse = vehicle.friction_ellipse(a_x, most);
        let weight_n = loads[0] + loads[1];
        let left = (1.0 - (a_x / most).powi(2)).max(0.1).sqrt();
        let mut looks = Vec::with_capacity(3);
        let mut both = Look { left, along: a_x, load: 1.0, enough: GIVEN, ..Look::default() };
        for (axle, given) in given.into_iter().enumerate() {
            let alone = mean(0, n, &|s| s.assumed_mps2[axle]);
            if assumed && STIFFNESS_SHOWS.contains(&(alone.abs() / most)) {
                let (both, square) = self.stiffness;
                self.stiffness = (FORGETS * both + given * alone, FORGETS * square + alone * alone);
            }
            let AxleEllipse { along_mps2: along, load, lateral: left } = ellipse[axle];
            let promised = left * mean(0, n, &|s| s.promised_mps2[axle]);
            both.given += loads[axle] / weight_n * given;
            both.promised += loads[axle] / weight_n * promised;
            looks.push(Look { given, promised, left, along, load, enough: GIVEN_AXLE });
        }
        looks.push(both);
        let mut road: Option<f64> = None;
        // Share of what is enough that is missing most; negative where all is there.
        let mut missing = f64::NEG_INFINITY;
        for Look { given, promised, left, along, load, enough } in looks {
            let share = given / promised;
            if promised.abs() > ASKED * most * left {
                missing = missing.max(enough - share);
                if share < enough {
                    let grip = (share.max(0.2) * promised).hypot(along) / (load * GRAVITY_MPS2);
                    road = Some(road.map_or(grip, |other| other.min(grip)));
                }
            }
        }
        let since_s = self.recent.get(n.wrapping_sub(2)).map_or(0.0, |last| state.stamp_s - last.stamp_s);
        self.missing_s =
            if missing.is_finite() { (self.missing_s + missing * since_s).max(0.0) } else { 0.0 };
        let enough_s = if assumed { MISSING_ASSUMED_S } else { MISSING_S };
        Some(Looked {
            turned: sideways.abs() / GRAVITY_MPS2,
            given: road.filter(|_| self.missing_s > enough_s),
        })
    }
}

/// The same tires with another stiffness: peak and shape stay.
fn stiffened(tires: &PacejkaParameters, by: f64) -> PacejkaParameters {
    let axle = |t: &MagicFormula| MagicFormula::from_stiffness(by * t.normalized_stiffness(), t.c, t.d, t.e);
    PacejkaParameters { front: axle(&tires.front), rear: axle(&tires.rear) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPEED_MPS: f64 = 6.0;

    /// Seconds until the grip is found to be less, on a road that gives a share of what the tires promise at their peak, and what it is found to be.
    fn notices(share: impl Fn(f64) -> f64, a_x_mps2: f64, assumed: bool) -> Option<(f64, f64)> {
        let vehicle = VehicleParameters::f1tenth();
        let axle = MagicFormula::from_stiffness(9.0, 1.5, 0.8, 0.0);
        let tires = PacejkaParameters { front: axle, rear: axle };
        let slip_rad = axle.peak_slip_rad()?;
        let mut governor = Governor::default();
        (0..100).find_map(|k| {
            let stamp_s = 0.01 * f64::from(k);
            let v_x_mps = SPEED_MPS + a_x_mps2 * stamp_s;
            let yaw_rate_radps = share(stamp_s) * 0.8 * GRAVITY_MPS2 / v_x_mps;
            let v_y_mps = vehicle.l_r_m * yaw_rate_radps - v_x_mps * slip_rad.tan();
            let ahead_rad = (v_y_mps + vehicle.l_f_m * yaw_rate_radps).atan2(v_x_mps);
            let state =
                CarState { stamp_s, v_x_mps, v_y_mps, yaw_rate_radps, x_m: 0.0, y_m: 0.0, heading_rad: 0.0 };
            let look = governor.look(&state, ahead_rad + slip_rad, &vehicle, &tires, assumed)?;
            look.given.map(|given| (stamp_s, given))
        })
    }

    #[test]
    fn the_more_is_missing_the_sooner_it_is_noticed_and_noise_is_not() {
        assert_eq!(notices(|_| 0.95, 0.0, false), None);
        let (soon_s, much) = notices(|_| 0.6, 0.0, false).unwrap();
        let (later_s, little) = notices(|_| 0.84, 0.0, false).unwrap();
        assert!(soon_s < 0.25 && later_s > soon_s + 0.1, "{soon_s} {later_s}");
        assert!((0.47..0.53).contains(&much) && (0.66..0.72).contains(&little), "{much} {little}");
        // A tenth of a second that reads less is no slide; on tires that nobody measured it is one.
        let dip = |t: f64| if (0.5..0.7).contains(&t) { 0.82 } else { 0.95 };
        assert_eq!(notices(dip, 0.0, false), None);
        assert!(notices(dip, 0.0, true).is_some());
    }

    #[test]
    fn what_brakes_pushes_less_to_the_side() {
        assert!(notices(|_| 0.84, 0.0, false).is_some());
        assert_eq!(notices(|_| 0.84, -3.0, false), None);
    }

    #[test]
    fn a_car_that_turns_in_pushes_less_than_its_yaw_rate_says() {
        let vehicle = VehicleParameters::f1tenth();
        let axle = MagicFormula::from_stiffness(9.0, 1.5, 0.8, 0.0);
        let tires = PacejkaParameters { front: axle, rear: axle };
        let pushes = |front_rad: f64, rear_rad: f64| {
            let yaw_rate_radps = 0.7 * GRAVITY_MPS2 / SPEED_MPS;
            let v_y_mps = vehicle.l_r_m * yaw_rate_radps - SPEED_MPS * rear_rad.tan();
            let ahead_rad = (v_y_mps + vehicle.l_f_m * yaw_rate_radps).atan2(SPEED_MPS);
            let state = CarState {
                stamp_s: 0.0,
                v_x_mps: SPEED_MPS,
                v_y_mps,
                yaw_rate_radps,
                x_m: 0.0,
                y_m: 0.0,
                heading_rad: 0.0,
            };
            let mut governor = Governor::default();
            assert_eq!(governor.pushes_mps2(&vehicle), None);
            governor.look(&state, ahead_rad + front_rad, &vehicle, &tires, false);
            governor.pushes_mps2(&vehicle).unwrap() / GRAVITY_MPS2
        };
        approx::assert_relative_eq!(pushes(0.0, 0.0), 0.0, epsilon = 1e-9);
        let share = vehicle.l_r_m / vehicle.wheelbase_m();
        let by_hand = share * axle.normalized_force(0.06) + (1.0 - share) * axle.normalized_force(0.02);
        approx::assert_relative_eq!(pushes(0.06, 0.02), by_hand, max_relative = 1e-6);
        approx::assert_relative_eq!(pushes(-0.06, -0.02), -by_hand, max_relative = 1e-6);
    }
}
