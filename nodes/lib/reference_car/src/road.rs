//! The road and the air around the car: friction under each wheel, bank, slope, wind.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::car::CarParameters;
use crate::error::ReferenceCarError;
use crate::mechanisms::{Mechanisms, Patch};
use crate::plant_state::Surroundings;
use crate::scenario::{Friction, Scenario};

/// Correlation time of gusts.
const GUST_TIME_S: f64 = 0.8;

/// The road of one run.
#[derive(Debug, Clone)]
pub(crate) struct Road {
    friction: Friction,
    patches: Vec<Patch>,
    lap_m: Option<f64>,
    grip: f64,
    wear_per_min: f64,
    bank_rad: f64,
    slope_rad: f64,
    wind_mps: f64,
    gust_mps: f64,
    gusts: [f64; 2],
    random: ChaCha8Rng,
}

impl Road {
    pub(crate) fn new(scenario: &Scenario, mechanisms: &Mechanisms, lap_m: Option<f64>) -> Self {
        let mut patches: Vec<Patch> = mechanisms.patch.into_iter().collect();
        if let Friction::Patched { patches: given, .. } = &scenario.friction {
            patches.extend(given);
        }
        Self {
            friction: scenario.friction.clone(),
            patches,
            lap_m,
            grip: 1.0 + mechanisms.grip_scale,
            wear_per_min: mechanisms.wear_per_min,
            bank_rad: mechanisms.bank_rad,
            slope_rad: mechanisms.slope_rad,
            wind_mps: mechanisms.wind_mps,
            gust_mps: mechanisms.gust_mps,
            gusts: [0.0; 2],
            random: ChaCha8Rng::seed_from_u64(scenario.seed ^ 0x6057_0a12),
        }
    }

    /// Another friction of the road from now on.
    pub(crate) fn set_friction(&mut self, mu: f64) -> Result<(), ReferenceCarError> {
        let friction = Friction::Uniform { mu };
        friction.validate()?;
        self.friction = friction;
        Ok(())
    }

    /// What acts on a car at a station, turned by `turn_rad` against the track.
    pub(crate) fn at(
        &mut self,
        time_s: f64,
        station_m: f64,
        turn_rad: f64,
        car: &CarParameters,
        dt_s: f64,
    ) -> Surroundings {
        let here = self.friction_now(time_s);
        let worn = (1.0 - self.wear_per_min * time_s / 60.0).max(0.1);
        let (sin, cos) = turn_rad.sin_cos();
        let half = car.track_width_m / 2.0;
        let friction = if self.patches.is_empty() {
            [here * worn * self.grip; 4]
        } else {
            [(car.l_f_m, half), (car.l_f_m, -half), (-car.l_r_m, half), (-car.l_r_m, -half)].map(
                |(x_m, y_m)| here * worn * self.grip * self.patch_factor(station_m + x_m * cos - y_m * sin),
            )
        };
        let (bank_rad, slope_rad) = self.inclination(station_m);
        let (wind_x_mps, wind_y_mps) = self.wind(dt_s);
        Surroundings { friction, bank_rad, slope_rad, wind_x_mps, wind_y_mps }
    }

    /// Friction of the road itself at a station: what a camera could see.
    pub(crate) fn seen(&self, time_s: f64, station_m: f64) -> f64 {
        self.friction_now(time_s) * self.patch_factor(station_m)
    }

    fn friction_now(&self, time_s: f64) -> f64 {
        match &self.friction {
            Friction::Uniform { mu } | Friction::Patched { mu, .. } => *mu,
            Friction::Changing { mu, mu_after, at_s, over_s } => {
                let share = if *over_s > 0.0 { (time_s - at_s) / over_s } else { f64::from(time_s >= *at_s) };
                mu + share.clamp(0.0, 1.0) * (mu_after - mu)
            }
        }
    }

    /// Friction over its usual value: a patch with edges a tenth of its length wide.
    fn patch_factor(&self, station_m: f64) -> f64 {
        self.patches
            .iter()
            .map(|patch| {
                let into = station_m - patch.start_m;
                let into_m = self.lap_m.map_or(into, |lap| into.rem_euclid(lap));
                let edge_m = (0.1 * patch.length_m).max(1e-6);
                let inside = (into_m / edge_m).min((patch.length_m - into_m) / edge_m).clamp(0.0, 1.0);
                1.0 - patch.depth * inside
            })
            .product()
    }

    /// Bank and slope: on a lap, a banked stretch of half its length, and as much uphill as downhill; on a plane, the same
    /// everywhere.
    fn inclination(&self, station_m: f64) -> (f64, f64) {
        match self.lap_m {
            Some(lap_m) => {
                let share = station_m / lap_m;
                let climb = stretch(share, 0.05, 0.45) - stretch(share, 0.55, 0.95);
                (self.bank_rad * stretch(share, 0.2, 0.7), self.slope_rad * climb)
            }
            None => (self.bank_rad, self.slope_rad),
        }
    }

    fn wind(&mut self, dt_s: f64) -> (f64, f64) {
        if self.gust_mps > 0.0 {
            let kept = (-dt_s / GUST_TIME_S).exp();
            for gust in &mut self.gusts {
                let driving: f64 = StandardNormal.sample(&mut self.random);
                *gust = kept * *gust + (1.0 - kept * kept).sqrt() * self.gust_mps * driving;
            }
        }
        (self.gusts[0], self.wind_mps + self.gusts[1])
    }
}

/// One between two shares of a lap, zero outside, with smooth edges a tenth of a lap wide inside.
fn stretch(share: f64, from: f64, to: f64) -> f64 {
    let inside = ((share - from).min(to - share) / 0.1).clamp(0.0, 1.0);
    inside * inside * (3.0 - 2.0 * inside)
}
