//! The fastest speed along a line within the grip.
//!
//! ```text
//! v       <= sqrt(a_y,max/|curvature|)      a_y,max: of a steady turn at that curvature
//! v_{i+1}^2 = v_i^2 + 2 a_x ds,   (a_x/a_x,max)^2 + (a_y/a_y,max)^2 <= 1
//! ```
//!
//! forward with what drives the car, backward with what brakes it.

use gripsight_vehicle::{GRAVITY_MPS2, PacejkaParameters, VehicleParameters};

use crate::tires::SteeringTable;
use crate::{Longitudinal, Track};

/// Share of the tires' longitudinal limit to plan with: rolling loads and the speed controller need the rest.
const LONGITUDINAL_SHARE: f64 = 0.9;

/// Turns, in wheelbases over radius: the last one is tighter than cars turn.
const TURNS: usize = 17;
const TURN_STEP: f64 = 0.05;

/// A car that its drag would stop is still driven.
const SLOWEST_MPS: f64 = 0.2;

/// What motor and brakes can do: as stated, and what identification tells beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct Drivetrain {
    /// Largest acceleration.
    pub drive_mps2: f64,
    /// Largest deceleration, positive.
    pub brake_mps2: f64,
    /// Power over mass, W/kg; infinite where not known.
    pub power_w_per_kg: f64,
    /// Highest speed to drive.
    pub top_speed_mps: f64,
    /// What identification tells.
    pub told: Longitudinal,
}

/// Accelerations that the car may use.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    /// Sideways, straight on: the grip.
    pub lateral_mps2: f64,
    /// Sideways in turns that are ever tighter, over that: at curvatures [`TURN_STEP`]/wheelbase apart.
    turns: [f64; TURNS],
    wheelbase_m: f64,
    /// Forward, on the tires.
    pub drive_mps2: f64,
    /// Backward, positive.
    pub brake_mps2: f64,
    /// Power over mass.
    pub power_w_per_kg: f64,
    /// Highest speed.
    pub top_speed_mps: f64,
    /// Gain, resistances and limits that were reached.
    pub told: Longitudinal,
}

impl Limits {
    /// At a grip (force over the load that the weaker axle may use) on tires.
    #[must_use]
    pub fn new(
        vehicle: &VehicleParameters,
        tires: &PacejkaParameters,
        grip: f64,
        drivetrain: &Drivetrain,
    ) -> Self {
        let wheelbase = vehicle.wheelbase_m();
        let table = SteeringTable::new(vehicle, tires);
        let turn = |k: usize| table.turns(TURN_STEP * k as f64 / wheelbase, grip) / grip;
        let loads = [vehicle.l_r_m / wheelbase, vehicle.l_f_m / wheelbase];
        // Load that moves to the front per g of deceleration.
        let shift = vehicle.h_cg_m / wheelbase;
        // Each axle: share * a <= grip * (load +- shift * a).
        let most = |front_share: f64, to_front: f64| {
            let axle = |load: f64, share: f64, gain: f64| {
                let left = share - grip * gain;
                if left > 1e-6 { grip * load / left } else { f64::INFINITY }
            };
            let all = axle(loads[0], front_share, to_front).min(axle(loads[1], 1.0 - front_share, -to_front));
            LONGITUDINAL_SHARE * GRAVITY_MPS2 * all.min(grip)
        };
        Self {
            lateral_mps2: grip * GRAVITY_MPS2,
            turns: std::array::from_fn(turn),
            wheelbase_m: wheelbase,
            drive_mps2: most(vehicle.front_drive_share(), -shift).min(drivetrain.drive_mps2),
            brake_mps2: most(vehicle.front_brake_share(), shift).min(drivetrain.brake_mps2),
            power_w_per_kg: drivetrain.power_w_per_kg,
            top_speed_mps: drivetrain.top_speed_mps,
            told: drivetrain.told.clone(),
        }
    }

    /// Largest lateral acceleration of a turn.
    #[must_use]
    pub fn lateral_at_mps2(&self, curvature_1pm: f64) -> f64 {
        let place = (curvature_1pm.abs() * self.wheelbase_m / TURN_STEP).min((TURNS - 1) as f64);
        let k = (place as usize).min(TURNS - 2);
        self.lateral_mps2 * (self.turns[k] + (place - k as f64) * (self.turns[k + 1] - self.turns[k]))
    }

    /// Share of the longitudinal limit left beside a lateral acceleration in a turn.
    #[must_use]
    pub fn left_beside(&self, lateral_mps2: f64, curvature_1pm: f64) -> f64 {
        let used = (lateral_mps2 / self.lateral_at_mps2(curvature_1pm)).abs().min(1.0);
        (1.0 - used * used).sqrt()
    }

    /// Largest driving acceleration at a speed, of tires and motor: what holds the car back is not off it.
    #[must_use]
    pub fn drive_at_mps2(&self, speed_mps: f64) -> f64 {
        self.drive_mps2.min(self.power_w_per_kg / speed_mps.max(0.1))
    }

    /// Speed gained a second at most in a turn: what holds the car back is made up for by the driver.
    #[must_use]
    pub fn gains_mps2(&self, speed_mps: f64, curvature_1pm: f64) -> f64 {
        let left = self.left_beside(speed_mps * speed_mps * curvature_1pm, curvature_1pm);
        let pushed = self.drive_at_mps2(speed_mps) * left;
        pushed.min(self.told.reached_mps2(speed_mps)[0])
    }

    /// Speed lost a second at most in a turn: what holds the car back helps, and is kept as room.
    #[must_use]
    pub fn loses_mps2(&self, speed_mps: f64, curvature_1pm: f64) -> f64 {
        let left = self.left_beside(speed_mps * speed_mps * curvature_1pm, curvature_1pm);
        let braked = self.brake_mps2 * left;
        braked.min(self.told.reached_mps2(speed_mps)[1])
    }
}

/// Speed along a track.
#[derive(Debug, Clone, PartialEq)]
pub struct SpeedProfile {
    speeds_mps: Vec<f64>,
    step_m: f64,
}

impl SpeedProfile {
    /// The fastest within limits.
    #[must_use]
    pub fn new(track: &Track, limits: &Limits) -> Self {
        let curvature: Vec<f64> = track.points().iter().map(|p| p.curvature_1pm).collect();
        let step_m = track.step_m();
        let fastest =
            |k: &f64| (limits.lateral_at_mps2(*k) / k.abs().max(1e-9)).sqrt().min(limits.top_speed_mps);
        let mut speeds_mps: Vec<f64> = curvature.iter().map(fastest).collect();
        let count = speeds_mps.len();
        // Two laps each way: the second sees the end of the first.
        for i in 0..2 * count {
            let (here, next) = (i % count, (i + 1) % count);
            let v = speeds_mps[here];
            let a = limits.gains_mps2(v, curvature[here]);
            speeds_mps[next] =
                speeds_mps[next].min((v * v + 2.0 * a * step_m).max(SLOWEST_MPS.powi(2)).sqrt());
        }
        for i in (0..2 * count).rev() {
            let (here, next) = (i % count, (i + 1) % count);
            let v = speeds_mps[next];
            let a = limits.loses_mps2(v, curvature[next]);
            speeds_mps[here] = speeds_mps[here].min((v * v + 2.0 * a * step_m).sqrt());
        }
        Self { speeds_mps, step_m }
    }

    /// Speed, and the acceleration that keeps to the profile, at a distance.
    #[must_use]
    pub fn at(&self, station_m: f64) -> (f64, f64) {
        let count = self.speeds_mps.len();
        let place = station_m / self.step_m;
        let floor = place.floor();
        let index = (floor as i64).rem_euclid(count as i64) as usize;
        let (a, b) = (self.speeds_mps[index], self.speeds_mps[(index + 1) % count]);
        (a + (place - floor) * (b - a), (b * b - a * a) / (2.0 * self.step_m))
    }

    /// Time of a lap that keeps to the profile.
    #[must_use]
    pub fn lap_time_s(&self) -> f64 {
        let count = self.speeds_mps.len();
        let step = |i: usize| 2.0 * self.step_m / (self.speeds_mps[i] + self.speeds_mps[(i + 1) % count]);
        (0..count).map(step).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ReachedAt, TireSet};

    fn limits() -> Limits {
        Limits {
            lateral_mps2: 8.0,
            turns: [1.0; TURNS],
            wheelbase_m: 1.0,
            drive_mps2: 4.0,
            brake_mps2: 6.0,
            power_w_per_kg: 60.0,
            top_speed_mps: 12.0,
            told: Longitudinal::UNKNOWN,
        }
    }

    /// Two half circles of 4 m joined by straights of 40 m.
    fn stadium() -> Track {
        let mut rows = Vec::new();
        for side in [0.0, 1.0] {
            let turn = std::f64::consts::PI * side;
            let (sin, cos) = turn.sin_cos();
            let mut put = |x: f64, y: f64| rows.push([cos * x - sin * y, sin * x + cos * y, 1.0, 1.0]);
            (0..40).for_each(|k| put(-20.0 + f64::from(k), -4.0));
            (0..24).for_each(|k| {
                let p = std::f64::consts::PI * (f64::from(k) / 24.0 - 0.5);
                put(20.0 + 4.0 * p.cos(), 4.0 * p.sin());
            });
        }
        Track::from_points(&rows).unwrap()
    }

    #[test]
    fn the_profile_keeps_within_the_ellipse_and_uses_it() {
        let (track, limits) = (stadium(), limits());
        let profile = SpeedProfile::new(&track, &limits);
        let mut fullest: f64 = 0.0;
        let mut used = Vec::new();
        for (k, point) in track.points().iter().enumerate() {
            let (v, a_x) = profile.at(k as f64 * track.step_m());
            let most = if a_x > 0.0 { limits.drive_at_mps2(v) } else { limits.brake_mps2 };
            let share = (a_x / most).hypot(v * v * point.curvature_1pm / limits.lateral_mps2);
            assert!(v <= limits.top_speed_mps + 1e-9);
            fullest = fullest.max(share);
            if v < limits.top_speed_mps - 1e-6 {
                used.push(share);
            }
        }
        // The slope between two points is theirs together: a few percent at the corner's ends.
        assert!(fullest < 1.1, "{fullest}");
        let mean = used.iter().sum::<f64>() / used.len() as f64;
        assert!(mean > 0.95, "only {mean:.3} of the ellipse is used");
    }

    #[test]
    fn more_grip_is_faster_by_its_root_where_nothing_else_limits() {
        let track = stadium();
        let strong = |lateral_mps2: f64| Limits {
            lateral_mps2,
            turns: [1.0; TURNS],
            wheelbase_m: 1.0,
            drive_mps2: lateral_mps2,
            brake_mps2: lateral_mps2,
            power_w_per_kg: f64::INFINITY,
            top_speed_mps: 100.0,
            told: Longitudinal::UNKNOWN,
        };
        let time = |a: f64| SpeedProfile::new(&track, &strong(a)).lap_time_s();
        approx::assert_relative_eq!(time(4.0) / time(8.0), 2.0_f64.sqrt(), max_relative = 1e-3);
    }

    #[test]
    fn a_rear_driven_car_gains_and_a_front_driven_car_loses_by_the_load_that_moves() {
        let drivetrain = Drivetrain {
            drive_mps2: 100.0,
            brake_mps2: 100.0,
            power_w_per_kg: f64::INFINITY,
            top_speed_mps: 50.0,
            told: Longitudinal::UNKNOWN,
        };
        let limit = |drive_front_share: f64| {
            let vehicle = VehicleParameters {
                drive_front_share: Some(drive_front_share),
                ..VehicleParameters::f1tenth()
            };
            Limits::new(&vehicle, &TireSet::start_at(0.8).tires, 0.8, &drivetrain).drive_mps2
        };
        let car = VehicleParameters::f1tenth();
        // Front drive, by hand: a = mu g l_r/(L + mu h).
        let by_hand =
            LONGITUDINAL_SHARE * 0.8 * GRAVITY_MPS2 * car.l_r_m / (car.wheelbase_m() + 0.8 * car.h_cg_m);
        approx::assert_relative_eq!(limit(1.0), by_hand, max_relative = 1e-9);
        assert!(limit(0.0) > limit(1.0));
    }

    #[test]
    fn what_identification_tells_is_planned_with() {
        let track = stadium();
        let told = |told: Longitudinal| SpeedProfile::new(&track, &Limits { told, ..limits() });
        let stated = told(Longitudinal::UNKNOWN);
        // A motor that gives less than is stated at some speeds.
        let weak = ReachedAt { v_x_mps: [6.0, 20.0], forward_mps2: Some(1.5), backward_mps2: Some(2.0) };
        let weak = told(Longitudinal { reached: vec![weak], ..Longitudinal::UNKNOWN });
        let steepest = |p: &SpeedProfile| {
            let places = (0..track.points().len()).map(|k| p.at(k as f64 * track.step_m()));
            let fast = places.filter(|(v, _)| *v > 6.3).map(|(_, a)| a);
            fast.fold((0.0_f64, 0.0_f64), |(up, down), a| (up.max(a), down.min(a)))
        };
        let ((up, down), (weak_up, weak_down)) = (steepest(&stated), steepest(&weak));
        assert!(up > 3.0 && down < -5.0, "{up} {down}");
        assert!(weak_up < 1.55 && weak_down > -2.05, "{weak_up} {weak_down}");
    }
}
