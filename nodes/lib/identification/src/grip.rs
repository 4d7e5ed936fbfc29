//! Whether the car still grips as the set in use promises, sample by sample: a fall of grip is told within a second of the first corner that shows it.
//!
//! ```text
//! promised   P = mean over the last 0.5 s of (e_f F_yf cos d + e_r F_yr)/m at the slips driven, by the set in use; e: what the friction ellipse leaves
//!            beside the drive and the brakes of that time
//! given      G = mean of v_x w, and what v_y has changed by over that time
//! fallen     where P asks for half of what the set promises at most, and G/P stays below 1 - FALL
//! ```
//!
//! The set promises no more than was shown, so that G/P lies about or above one. Slip that lags is why a smaller fall is left to the
//! [`Monitor`](crate::Monitor), which looks at whole windows.

use std::collections::VecDeque;

use gripsight_signals::{NS_PER_S, TelemetrySample};
use gripsight_vehicle::{GRAVITY_MPS2, SingleTrack, VehicleParameters};

use crate::data::SLOW_MPS;
use crate::live::Corrected;
use crate::{AcceptedSet, IdentificationError, vehicle_hash};

/// What is looked at.
const LOOK_S: f64 = 0.5;
/// From one look to the next.
const EVERY_S: f64 = 0.1;
/// Looks in a row that have to agree.
const LOOKS: usize = 2;
/// Share of the largest force promised that has to be asked for.
const ASKED: f64 = 0.5;
/// Share of the promised force that has to be missing. Watched before any fall, 76 drives of the reference car missed 0.24 at most, in single looks of one
/// drive, and 0.10 in all others (`examples/envelope grip`, seeds 33000-33039 and 33100-33139).
const FALL: f64 = 0.2;
/// v_y at either end is a mean over this share of the look.
const ENDS: f64 = 0.2;

/// What a look gave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GripLook {
    /// The last sample looked at, in nanoseconds.
    pub stamp_ns: i64,
    /// Share of the promised lateral force that the car gave; NaN while too little of it is asked for.
    pub share: f64,
    /// Lateral acceleration that the set promises at the slips driven, m/s2.
    pub promised_mps2: f64,
    /// Whether grip has fallen below what the set promises.
    pub fallen: bool,
}

/// Watches one set while driving.
#[derive(Debug, Clone)]
pub struct GripWatch {
    vehicle: VehicleParameters,
    set: AcceptedSet,
    corrected: Corrected,
    recent: VecDeque<Seen>,
    next_ns: i64,
    low: usize,
}

/// A sample as it is needed.
#[derive(Debug, Clone, Copy)]
struct Seen {
    stamp_ns: i64,
    v_x_mps: f64,
    v_y_mps: f64,
    turned_mps2: f64,
    /// What the car's turning and the steered wheels add to the change of v_x, beside drive and brakes.
    carried_mps2: f64,
    /// Front, rear.
    promised_mps2: [f64; 2],
}

impl GripWatch {
    /// Watches a set.
    ///
    /// # Errors
    /// [`IdentificationError::OtherCar`] for a set of a car with other parameters.
    pub fn new(vehicle: &VehicleParameters, set: &AcceptedSet) -> Result<Self, IdentificationError> {
        let expected = vehicle_hash(vehicle);
        if set.vehicle_hash != expected {
            return Err(IdentificationError::OtherCar { expected, got: set.vehicle_hash.clone() });
        }
        Ok(Self {
            vehicle: vehicle.clone(),
            set: set.clone(),
            corrected: Corrected::new(set.corrections),
            recent: VecDeque::new(),
            next_ns: i64::MIN,
            low: 0,
        })
    }

    /// The set watched.
    #[must_use]
    pub fn set(&self) -> &AcceptedSet {
        &self.set
    }

    /// Forgets every sample: after a jump of the clock.
    pub fn reset(&mut self) {
        self.corrected.clear();
        self.recent.clear();
        (self.next_ns, self.low) = (i64::MIN, 0);
    }

    /// Takes the next sample, in the order of stamps; gives a look every 0.1 s.
    pub fn push(&mut self, sample: &TelemetrySample) -> Option<GripLook> {
        let stamp_ns = sample.odometry.stamp_ns;
        if self.recent.back().is_some_and(|last| {
            stamp_ns <= last.stamp_ns || (stamp_ns - last.stamp_ns) as f64 > LOOK_S * NS_PER_S
        }) {
            self.reset();
        }
        let (state, input) = self.corrected.push(sample);
        if input.v_x_mps < SLOW_MPS {
            self.recent.clear();
            return None;
        }
        let car = SingleTrack::new(&self.vehicle, &self.set.promised);
        let (front, rear) = car.slip_angles_rad(&state, &input);
        let [front_n, rear_n] = [
            self.set.promised.front.normalized_force(front) * self.vehicle.static_load_front_n(),
            self.set.promised.rear.normalized_force(rear) * self.vehicle.static_load_rear_n(),
        ];
        self.recent.push_back(Seen {
            stamp_ns,
            v_x_mps: input.v_x_mps,
            v_y_mps: state.v_y_mps,
            turned_mps2: input.v_x_mps * state.yaw_rate_radps,
            carried_mps2: state.v_y_mps * state.yaw_rate_radps
                - front_n * input.steering_rad.sin() / self.vehicle.mass_kg,
            promised_mps2: [front_n * input.steering_rad.cos(), rear_n].map(|n| n / self.vehicle.mass_kg),
        });
        let from_ns = stamp_ns - (LOOK_S * NS_PER_S) as i64;
        if self.recent.front().is_none_or(|first| first.stamp_ns > from_ns) {
            return None;
        }
        while self.recent.get(1).is_some_and(|second| second.stamp_ns <= from_ns) {
            self.recent.pop_front();
        }
        if stamp_ns < self.next_ns {
            return None;
        }
        self.next_ns = stamp_ns + (EVERY_S * NS_PER_S) as i64;
        Some(self.look(stamp_ns))
    }

    fn look(&mut self, stamp_ns: i64) -> GripLook {
        let n = self.recent.len();
        let mean = |from: usize, to: usize, of: fn(&Seen) -> f64| {
            self.recent.range(from..to).map(of).sum::<f64>() / (to - from).max(1) as f64
        };
        let end = ((ENDS * n as f64) as usize).clamp(1, n);
        let stamp_s = |seen: &Seen| (seen.stamp_ns - stamp_ns) as f64 / NS_PER_S;
        let late_s = self.recent.range(n - end..).map(stamp_s).sum::<f64>() / end as f64;
        let early_s = self.recent.range(..end).map(stamp_s).sum::<f64>() / end as f64;
        let apart_s = late_s - early_s;
        let slope = |of: fn(&Seen) -> f64| (mean(n - end, n, of) - mean(0, end, of)) / apart_s.max(1e-3);
        let given = mean(0, n, |s| s.turned_mps2) + slope(|s| s.v_y_mps);
        let along = slope(|s| s.v_x_mps) - mean(0, n, |s| s.carried_mps2);
        let most = GRAVITY_MPS2 * self.set.promised.front.d.min(self.set.promised.rear.d);
        // The ellipse is that of the tires found: a promise is a lower bound, and takes nothing from what brakes.
        let found = GRAVITY_MPS2 * self.set.phi_p.front.d.min(self.set.phi_p.rear.d);
        let [front, rear] = self.vehicle.friction_ellipse(along, found).map(|axle| axle.lateral);
        let promised_mps2 =
            front * mean(0, n, |s| s.promised_mps2[0]) + rear * mean(0, n, |s| s.promised_mps2[1]);
        let asked = promised_mps2.abs() > ASKED * most;
        let share = if asked { given / promised_mps2 } else { f64::NAN };
        self.low = if share < 1.0 - FALL { self.low + 1 } else { 0 };
        GripLook { stamp_ns, share, promised_mps2, fallen: self.low >= LOOKS }
    }
}

#[cfg(test)]
mod tests {
    use gripsight_signals::{DriveSample, OdometrySample};
    use gripsight_vehicle::{MagicFormula, PacejkaParameters};

    use super::*;
    use crate::rollout::Nuisance;
    use crate::{PerAxle, SignalCorrections, Status, ValidWithin};

    const SPEED_MPS: f64 = 12.0;

    fn both<T: Copy>(value: T) -> PerAxle<T> {
        PerAxle { front: value, rear: value }
    }

    /// Seconds until a fall is told, where the road gives a share of the force that the set has at its peak, from a time on.
    fn told_s(share: impl Fn(f64) -> f64, a_x_mps2: f64) -> Option<f64> {
        let vehicle = VehicleParameters::f1tenth();
        let axle = MagicFormula::from_stiffness(9.0, 1.5, 0.8, 0.0);
        let tires = PacejkaParameters { front: axle, rear: axle };
        let slip_rad = axle.peak_slip_rad()?;
        let set = AcceptedSet {
            vehicle_hash: vehicle_hash(&vehicle),
            sequence_id: 1,
            phi_p: tires,
            promised: tires,
            status: Status::Accepted,
            valid_within: ValidWithin { slip_rad: both(slip_rad), force_n: both(10.0) },
            corrections: SignalCorrections::NONE,
            fitted: tires,
            nuisance: Nuisance { relaxation_m: 0.0, combined_slip: 0.0, load_transfer: 0.0 },
            rollout_rmse: [0.01; 2],
            peak_reached: both(true),
        };
        let mut watch = GripWatch::new(&vehicle, &set).ok()?;
        (0..200).find_map(|k| {
            let now_s = 0.01 * f64::from(k);
            let stamp_ns = (now_s * NS_PER_S) as i64;
            let v_x_mps = SPEED_MPS + a_x_mps2 * now_s;
            // At a constant slip v_y changes with v_x.
            let turned_mps2 = share(now_s) * 0.8 * GRAVITY_MPS2 + a_x_mps2 * slip_rad.tan();
            let yaw_rate_radps = turned_mps2 / v_x_mps;
            let v_y_mps = vehicle.l_r_m * yaw_rate_radps - v_x_mps * slip_rad.tan();
            let ahead_rad = (v_y_mps + vehicle.l_f_m * yaw_rate_radps).atan2(v_x_mps);
            let sample = TelemetrySample {
                odometry: OdometrySample { stamp_ns, v_x_mps, v_y_mps, yaw_rate_radps, ..Default::default() },
                drive: DriveSample {
                    stamp_ns,
                    steering_angle_rad: ahead_rad + slip_rad,
                    ..Default::default()
                },
                ..TelemetrySample::default()
            };
            watch.push(&sample).filter(|look| look.fallen).map(|_| now_s)
        })
    }

    #[test]
    fn a_fall_is_told_within_a_second_and_a_road_that_gives_what_is_promised_is_not() {
        assert_eq!(told_s(|_| 0.9, 0.0), None);
        let fallen_s = told_s(|t| if t < 1.0 { 0.95 } else { 0.65 }, 0.0).unwrap();
        assert!((1.0..2.0).contains(&fallen_s), "{fallen_s}");
    }

    #[test]
    fn what_brakes_or_drives_pushes_less_to_the_side() {
        assert!(told_s(|_| 0.7, 0.0).is_some());
        assert_eq!(told_s(|_| 0.7, -6.0), None);
        assert_eq!(told_s(|_| 0.7, 6.0), None);
        // The brakes excuse what they take and no more.
        assert!(told_s(|_| 0.3, -4.0).is_some());
    }
}
