//! Model- and acceleration-based pursuit: the lateral acceleration that leads to a point ahead, and the steering that gives it.
//!
//! ```text
//! a = 2 v^2/l sin(eta)         eta: angle from the direction of travel to a point of the line, l away (Park, Deyst, How 2004, L1 guidance)
//! d = table(a, v) + k L/v (a/v - w) + trim,   d(trim)/dt = (L/v (a/v - w) - trim/5)/T
//! ```
//!
//! The second term damps: a steady-state table knows nothing of the yaw that is still to come. The third takes up what the tires do otherwise than the
//! table says; it holds still near the limit, where more steering gives nothing, if the limit is known.

use gripsight_vehicle::GRAVITY_MPS2;

use crate::steering::{Moment, NoAngle, PROMPT_S, Steering};

/// Gain k of the yaw rate, over what the geometry of a rolling car gives.
const YAW_GAIN: f64 = 1.5;
/// Speed up to which both terms fade out, over sqrt(g L): a car that hardly rolls goes where its wheels point, and swings where its yaw is corrected
/// late. From rest the 1:10 car swung up to 2 m/s without it and the passenger car up to 4.5 m/s.
const ROLLS: f64 = 1.4;
/// Time T of the trim.
const TRIM_S: f64 = 0.1;
/// Share of the largest planned acceleration from which the trim does not grow.
const TRIM_UP_TO: f64 = 0.9;
/// Time in which wheels that lag are brought where they are wanted. Told of a lag of 120 ms (the example `closed_loop`, effects, four development tracks, mu = 0.5
/// and 0.9) both cars are as fast as with 60 ms and nearer to the line (13 and 41 mm, 18 and 49); with 20 ms and less the noise steers and laps are longer (by
/// up to 12 %), with 100 ms the wheels swing.
const LEAD_S: f64 = 0.03;

/// How far pursuit looks ahead: the farther, the more corners are cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pursuit {
    /// Distance in wheelbases: a longer car turns in more slowly.
    pub ahead_wheelbases: f64,
    /// Time ahead beside that: of a slow car noise would turn the aim.
    pub ahead_s: f64,
    /// The least of that distance in ways that the car goes while its side slip settles, v^2/(g k), k: rear stiffness over load. Aiming nearer than that,
    /// a fast car weaves.
    pub ahead_lags: f64,
}

impl Default for Pursuit {
    /// Uses most of the grip on the development tracks (club, esses, clover; 1:10 and passenger car; mu = 0.4, 0.65, 0.9; true tires) of 0.16 to 0.36 s and 0
    /// to 1.5 wheelbases, without leaving them, and is nearest to the line of 0 to 3 lags.
    fn default() -> Self {
        Self { ahead_wheelbases: 1.0, ahead_s: 0.17, ahead_lags: 2.5 }
    }
}

/// Pursuit on a drive.
#[derive(Debug, Clone)]
pub(crate) struct Pursuing {
    pursuit: Pursuit,
    trim_rad: f64,
}

impl Pursuing {
    pub(crate) fn new(pursuit: Pursuit) -> Self {
        Self { pursuit, trim_rad: 0.0 }
    }

    /// Where the wheels are to be, `lead_s` after the command begins to act.
    fn wanted_rad(&mut self, at: &Moment<'_>, lead_s: f64) -> f64 {
        let (car, place) = at.car(lead_s, [0.0; 2]);
        let table = &at.plan.table;
        let wheelbase_m = at.vehicle.wheelbase_m();
        let speed = car.v_x_mps.hypot(car.v_y_mps).max(0.1);
        let lag_m = speed * speed / (GRAVITY_MPS2 * at.plan.tires.rear.normalized_stiffness());
        let Pursuit { ahead_wheelbases, ahead_s, ahead_lags } = self.pursuit;
        let ahead_m = ahead_wheelbases * wheelbase_m + (ahead_s * speed).max(ahead_lags * lag_m);
        let aim = at.track.at(place.station_m + ahead_m);
        let (sin, cos) = car.course_rad().sin_cos();
        let (dx, dy) = (aim.x_m - car.x_m, aim.y_m - car.y_m);
        let away_sq = (dx * dx + dy * dy).max(1e-9);
        let wanted = 2.0 * speed * speed * (cos * dy - sin * dx) / away_sq + at.weave_mps2;
        let most = table.most_mps2();
        let a = wanted.clamp(-most, most);
        let late_radps = a / speed - car.yaw_rate_radps;
        let rolls_mps = ROLLS * (GRAVITY_MPS2 * wheelbase_m).sqrt();
        let late_rad = (speed / rolls_mps).min(1.0) * wheelbase_m / speed.max(1.0) * late_radps;
        let grows = late_rad * self.trim_rad > 0.0 && late_rad * a > 0.0;
        if at.assumed || wanted.abs() < TRIM_UP_TO * most || !grows {
            self.trim_rad += at.dt_s().clamp(0.0, 0.05) / TRIM_S * (late_rad - 0.2 * self.trim_rad);
        }
        let angle_rad = table.steering_rad(a, speed) + YAW_GAIN * late_rad + self.trim_rad;
        at.within_slip(&car, angle_rad)
    }
}

impl Steering for Pursuing {
    fn angle_rad(&mut self, at: &Moment<'_>) -> Result<f64, NoAngle> {
        let lead_s = at.lag_s.min(LEAD_S);
        let most = at.vehicle.max_steering_rad;
        let wanted_rad = self.wanted_rad(at, lead_s).clamp(-most, most);
        if at.lag_s <= PROMPT_S {
            return Ok(wanted_rad);
        }
        // Wheels that lag are asked for more, so that they are there in time.
        let reached = 1.0 - (-lead_s / at.lag_s).exp();
        let wheels = at.wheels_rad().unwrap_or(wanted_rad);
        Ok((wheels + (wanted_rad - wheels) / reached).clamp(-most, most))
    }
}
