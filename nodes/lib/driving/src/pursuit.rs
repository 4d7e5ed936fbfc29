//! Model- and acceleration-based pursuit: the lateral acceleration that leads to a point ahead, and the steering that gives it.
//!
//! ```text
//! a = 2 v^2/l sin(eta)         eta: angle from the direction of travel to a point of the line, l away (Park, Deyst, How 2004, L1 guidance)
//! d = table(a, v) + k L/v (a/v - w) + trim,   d(trim)/dt = (L/v (a/v - w) - trim/5)/T
//! ```
//!
//! The second term damps: a steady-state table knows nothing of the yaw that is still to come. The third takes up what the tires do otherwise than the
//! table says; it holds still near the limit, where more steering gives nothing, if the limit is known.

use crate::state::CarState;
use crate::{Place, SteeringTable, Track};

/// Gain k of the yaw rate, over what the geometry of a rolling car gives.
const YAW_GAIN: f64 = 1.5;
/// Time T of the trim.
const TRIM_S: f64 = 0.1;
/// Share of the largest planned acceleration from which the trim does not grow.
const TRIM_UP_TO: f64 = 0.9;
/// Front slip over that of the largest planned force from which more only scrubs.
const MOST_SLIP: f64 = 1.15;

/// How far pursuit looks ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pursuit {
    /// Time ahead.
    pub ahead_s: f64,
    /// Distance ahead at least, in wheelbases.
    pub at_least_wheelbases: f64,
}

impl Default for Pursuit {
    /// Keeps the line best at the limit on the development tracks (club, esses, clover; 1:10 and passenger car) of 0.20 to 0.35 s.
    fn default() -> Self {
        Self { ahead_s: 0.32, at_least_wheelbases: 1.5 }
    }
}

/// A moment of a drive, for whoever steers.
#[derive(Debug, Clone, Copy)]
pub struct Moment<'a> {
    /// The car when the command will act.
    pub car: &'a CarState,
    /// Where it then is.
    pub place: Place,
    /// The line.
    pub track: &'a Track,
    /// The planned tires' steering table.
    pub table: &'a SteeringTable,
    /// Since the command before.
    pub dt_s: f64,
    /// Wheelbase.
    pub wheelbase_m: f64,
    /// Centre of gravity to front axle.
    pub l_f_m: f64,
    /// Nobody measured the tires: the table's limit is not the car's.
    pub assumed: bool,
}

impl Pursuit {
    /// The road-wheel angle; `trim_rad` goes on from command to command.
    #[must_use]
    pub fn steering_rad(&self, at: &Moment<'_>, trim_rad: &mut f64) -> f64 {
        let car = at.car;
        let speed = car.v_x_mps.hypot(car.v_y_mps).max(0.1);
        let ahead_m = (self.ahead_s * speed).max(self.at_least_wheelbases * at.wheelbase_m);
        let aim = at.track.at(at.place.station_m + ahead_m);
        let (sin, cos) = car.course_rad().sin_cos();
        let (dx, dy) = (aim.x_m - car.x_m, aim.y_m - car.y_m);
        let away_sq = (dx * dx + dy * dy).max(1e-9);
        let wanted = 2.0 * speed * speed * (cos * dy - sin * dx) / away_sq;
        let most = at.table.most_mps2();
        let a = wanted.clamp(-most, most);
        let late_radps = a / speed - car.yaw_rate_radps;
        let late_rad = at.wheelbase_m / speed.max(1.0) * late_radps;
        let grows = late_rad * *trim_rad > 0.0 && late_rad * a > 0.0;
        if at.assumed || wanted.abs() < TRIM_UP_TO * most || !grows {
            *trim_rad += at.dt_s.clamp(0.0, 0.05) / TRIM_S * (late_rad - 0.2 * *trim_rad);
        }
        let angle = at.table.steering_rad(a, speed) + YAW_GAIN * late_rad + *trim_rad;
        // More slip than that of the largest force only scrubs.
        let front = (car.v_y_mps + at.l_f_m * car.yaw_rate_radps).atan2(car.v_x_mps.max(0.1));
        let slip = MOST_SLIP * at.table.slips_rad(most).0;
        angle.clamp(front - slip, front + slip)
    }
}
