//! The fastest speed along a closed track within a share of the grip.
//!
//! Forward and backward passes over the centre line: `(a_x/a_x,max)^p + (a_y/a_y,max)^p <= 1`, with p = 2 (the whole
//! friction circle, hence braking into the corner) or 1 (brake first, then turn).

use crate::car::{CarParameters, GRAVITY_MPS2};
use crate::track::Track;

/// Share of the longitudinal limit that a driver plans with.
const CAUTION: f64 = 0.85;

/// What the driver believes of the car and takes from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Limits {
    pub(crate) lateral_mps2: f64,
    pub(crate) drive_mps2: f64,
    pub(crate) brake_mps2: f64,
    pub(crate) power_w_per_kg: f64,
    pub(crate) top_speed_mps: f64,
    pub(crate) exponent: f64,
}

impl Limits {
    /// Limits at a share `pace` of the grip on a road of friction `mu`.
    pub(crate) fn new(car: &CarParameters, mu: f64, pace: f64, trail_braking: bool) -> Self {
        let grip = mu * pace * car.tire_front.grip.min(car.tire_rear.grip);
        let (front, rear) = (car.l_r_m / car.wheelbase_m(), car.l_f_m / car.wheelbase_m());
        // The axle that is asked for more than its load carries gives the limit; `shift` is the load that moves to the
        // front per g of acceleration.
        let usable = |front_share: f64, shift: f64| {
            let limit = |load: f64, share: f64, gain: f64| {
                let left = share - grip * gain;
                if left > 1e-6 { grip * load / left } else { f64::INFINITY }
            };
            let most = limit(front, front_share, shift).min(limit(rear, 1.0 - front_share, -shift));
            most.min(grip) * CAUTION
        };
        let shift = car.h_cg_m / car.wheelbase_m();
        Self {
            lateral_mps2: grip * GRAVITY_MPS2,
            drive_mps2: GRAVITY_MPS2 * usable(car.drive.drive_front_share, -shift).min(car.drive.drive_limit),
            brake_mps2: GRAVITY_MPS2 * usable(car.drive.brake_front_share, shift).min(car.drive.brake_limit),
            power_w_per_kg: car.drive.power_w / car.mass_kg,
            top_speed_mps: car.top_speed_mps,
            exponent: if trail_braking { 2.0 } else { 1.0 },
        }
    }

    /// Share of the longitudinal limit left beside a lateral acceleration.
    pub(crate) fn left_beside(&self, a_y_mps2: f64) -> f64 {
        let used = (a_y_mps2.abs() / self.lateral_mps2).min(1.0);
        (1.0 - used.powf(self.exponent)).max(0.0).powf(1.0 / self.exponent)
    }
}

/// Speed and acceleration along a track.
#[derive(Debug, Clone)]
pub(crate) struct SpeedProfile {
    speeds_mps: Vec<f64>,
    step_m: f64,
}

impl SpeedProfile {
    pub(crate) fn new(track: &Track, limits: &Limits) -> Self {
        let curvature: Vec<f64> = track.points().iter().map(|p| p.curvature_1pm).collect();
        let step_m = track.step_m();
        let mut speeds_mps: Vec<f64> = curvature
            .iter()
            .map(|k| (limits.lateral_mps2 / k.abs().max(1e-9)).sqrt().min(limits.top_speed_mps))
            .collect();
        let count = speeds_mps.len();
        // Two laps each way: the second sees the first one's end.
        for i in 0..2 * count {
            let (here, next) = (i % count, (i + 1) % count);
            let v = speeds_mps[here];
            let most = limits.drive_mps2.min(limits.power_w_per_kg / v.max(0.1));
            let a = most * limits.left_beside(v * v * curvature[here]);
            speeds_mps[next] = speeds_mps[next].min((v * v + 2.0 * a * step_m).sqrt());
        }
        for i in (0..2 * count).rev() {
            let (here, next) = (i % count, (i + 1) % count);
            let v = speeds_mps[next];
            let a = limits.brake_mps2 * limits.left_beside(v * v * curvature[next]);
            speeds_mps[here] = speeds_mps[here].min((v * v + 2.0 * a * step_m).sqrt());
        }
        Self { speeds_mps, step_m }
    }

    /// Speed, and the acceleration that keeps to the profile, at a distance.
    pub(crate) fn at(&self, station_m: f64) -> (f64, f64) {
        let count = self.speeds_mps.len();
        let place = station_m / self.step_m;
        let floor = place.floor();
        let index = (floor as i64).rem_euclid(count as i64) as usize;
        let (a, b) = (self.speeds_mps[index], self.speeds_mps[(index + 1) % count]);
        (a + (place - floor) * (b - a), (b * b - a * a) / (2.0 * self.step_m))
    }
}
