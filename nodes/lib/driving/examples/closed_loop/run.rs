//! One run: a car on a road that it does not know, some laps.

use anyhow::{Context, Result};
use gripsight_driving::{CarState, Driver, Limits, Settings, SpeedProfile, TireSet, Track, Trust};
use gripsight_identification::FrictionPrior;
use gripsight_reference_car::{CarParameters, Command, Course, SensorSample, Simulation, TruthSample};
use gripsight_vehicle::PacejkaParameters;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::learner::Learner;
use crate::plant;

/// What the driver may know.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Variant {
    /// The start's tires for ever.
    None,
    /// What is identified while driving.
    NoPrior,
    /// The same with a friction prior as good as the camera's model card says: error 0.10.
    Prior,
    /// With a prior 0.3 too high.
    LieHigh,
    /// With a prior 0.3 too low.
    LieLow,
    /// The plant's tires, projected on Phi_p.
    True,
}

impl Variant {
    pub(crate) const ALL: [Self; 6] =
        [Self::None, Self::NoPrior, Self::Prior, Self::LieHigh, Self::LieLow, Self::True];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::NoPrior => "identified",
            Self::Prior => "with_prior",
            Self::LieHigh => "prior_too_high",
            Self::LieLow => "prior_too_low",
            Self::True => "true_tires",
        }
    }

    /// The prior, where there is one.
    fn prior(self, mu: f64, seed: u64) -> Option<FrictionPrior> {
        /// Root mean square error of the camera on held-out roads (its model card).
        const CAMERA_ERROR: f64 = 0.10;
        const LIE: f64 = 0.3;
        let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x0ca3_e4a5);
        let off = CAMERA_ERROR * 3.0_f64.sqrt() * random.random_range(-1.0..1.0);
        let prior = |mu: f64| Some(FrictionPrior { mu: mu.max(0.1), sigma: CAMERA_ERROR });
        match self {
            Self::None | Self::NoPrior | Self::True => None,
            Self::Prior => prior(mu + off),
            Self::LieHigh => prior(mu + LIE),
            Self::LieLow => prior(mu - LIE),
        }
    }
}

/// What is driven.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    pub(crate) car: CarParameters,
    pub(crate) track: String,
    pub(crate) mu: f64,
    pub(crate) seed: u64,
    pub(crate) laps: usize,
    /// The plant's tires.
    pub(crate) tires: PacejkaParameters,
}

/// What a lap gave.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Lap {
    pub(crate) time_s: f64,
    /// Distance to the line: mean and largest.
    pub(crate) error_m: f64,
    pub(crate) worst_m: f64,
    /// Mean of the acceleration used over the grip in corners.
    pub(crate) used: f64,
    /// Times off the track.
    pub(crate) exits: u32,
    /// Grip planned at its end.
    pub(crate) planned: f64,
    /// What the driver drove on at its end.
    pub(crate) trust: Option<Trust>,
}

/// What a run gave.
#[derive(Debug, Clone)]
pub(crate) struct Run {
    pub(crate) laps: Vec<Lap>,
    /// Why it ended early.
    pub(crate) wreck: Option<&'static str>,
}

/// Looks at the truth a second.
const LOOKS_HZ: u64 = 100;
/// Share of the grip from which the fastest drive on the true tires is in a corner.
const CORNER: f64 = 0.9;

/// Drives it.
pub(crate) fn drive(case: &Case, variant: Variant, verbose: bool) -> Result<Run> {
    let reversed = case.seed % 2 == 1;
    let vehicle = plant::vehicle(&case.car)?;
    let drivetrain = plant::drivetrain(&case.car);
    let track = plant::track(&case.car, &case.track, reversed)?;
    let truth = TireSet { trust: Trust::Accepted, ..TireSet::assumed(case.tires) };
    let start = if variant == Variant::True { truth } else { TireSet::start() };
    let mut driver = Driver::new(vehicle.clone(), drivetrain, track.clone(), start, Settings::default())?;
    let mut scenario =
        plant::scenario(&case.car, Course::Track { name: case.track.clone(), reversed }, case.mu, case.seed);
    // The run begins rolling, at a speed that any of these roads allows.
    scenario.driver.pace = (0.25 / case.mu).min(1.0);
    let mut sim = Simulation::new(scenario)?;
    let limits = Limits::new(&vehicle, truth.grip(), &drivetrain);
    if verbose {
        eprintln!("profile lap {:.2} s", driver.profile().lap_time_s());
    }
    let mut referee = Referee::new(&track, &limits, sim.track().context("no track")?.half_width_m());
    let mut learner = (!matches!(variant, Variant::None | Variant::True))
        .then(|| Learner::new(vehicle, variant.prior(case.mu, case.seed)));
    let longest_s = 4.0 * case.laps as f64 * SpeedProfile::new(&track, &limits).lap_time_s();
    let (mut steps, mut halves) = (0_u64, 0_usize);
    let mut wreck = None;
    while referee.laps.len() < case.laps {
        if sim.step().is_err() {
            wreck = Some("rollover");
            break;
        }
        steps += 1;
        for sample in sim.drain().0 {
            if let Some(learner) = &mut learner {
                learner.push(&sample, &mut driver)?;
            }
            if let SensorSample::Odometry(s) = sample {
                let command = driver.command(
                    &CarState {
                        stamp_s: s.stamp_s,
                        x_m: s.x_m,
                        y_m: s.y_m,
                        heading_rad: s.heading_rad,
                        v_x_mps: s.v_x_mps,
                        v_y_mps: s.v_y_mps,
                        yaw_rate_radps: s.yaw_rate_radps,
                    },
                    s.stamp_s,
                );
                sim.command(Command {
                    steering_rad: command.steering_rad,
                    speed_mps: command.speed_mps,
                    acceleration_mps2: Some(command.acceleration_mps2),
                });
            }
        }
        if !steps.is_multiple_of(1000 / LOOKS_HZ) {
            continue;
        }
        let Some(now) = sim.now() else { continue };
        if let Some(reason) = referee.look(now, &driver) {
            wreck = Some(reason);
            break;
        }
        if sim.time_s() > longest_s {
            wreck = Some("too slow");
            break;
        }
        if driver.halves() > halves {
            halves = driver.halves();
            if let Some(learner) = &mut learner {
                learner.identify(&mut driver, verbose)?;
            }
            if verbose {
                eprintln!(
                    "  {:.1} s, half lap {halves}: planned {:.3} of {:.3}, {}{}",
                    sim.time_s(),
                    driver.grip(),
                    truth.grip(),
                    if driver.held_back() { "held back " } else { "" },
                    referee.laps.last().map_or(String::new(), |l| format!("last lap {:.2} s", l.time_s)),
                );
            }
        }
    }
    Ok(Run { laps: referee.laps, wreck })
}

/// Watches the truth.
struct Referee<'a> {
    track: &'a Track,
    fastest: SpeedProfile,
    grip_mps2: f64,
    half_width_m: f64,
    laps: Vec<Lap>,
    lap: Lap,
    looks: (f64, f64),
    began_s: f64,
    station_m: f64,
    outside: bool,
    slow: u32,
}

impl<'a> Referee<'a> {
    fn new(track: &'a Track, limits: &Limits, half_width_m: f64) -> Self {
        Self {
            track,
            fastest: SpeedProfile::new(track, limits),
            grip_mps2: limits.lateral_mps2,
            half_width_m,
            laps: Vec::new(),
            lap: Lap::default(),
            looks: (0.0, 0.0),
            began_s: 0.0,
            station_m: 0.0,
            outside: false,
            slow: 0,
        }
    }

    /// The reason for which the run cannot go on.
    fn look(&mut self, now: &TruthSample, driver: &Driver) -> Option<&'static str> {
        let (m, offset_m) = (&now.motion, now.offset_m.abs());
        if now.station_m < 0.25 * self.track.length_m() && self.station_m > 0.75 * self.track.length_m() {
            let lap = Lap {
                time_s: m.time_s - self.began_s,
                error_m: self.lap.error_m / self.looks.0,
                used: self.lap.used / self.looks.1.max(1.0),
                planned: driver.grip(),
                trust: Some(driver.trust()),
                ..self.lap
            };
            self.laps.push(lap);
            (self.lap, self.looks, self.began_s) = (Lap::default(), (0.0, 0.0), m.time_s);
        }
        self.station_m = now.station_m;
        self.lap.error_m += offset_m;
        self.lap.worst_m = self.lap.worst_m.max(offset_m);
        self.looks.0 += 1.0;
        let fastest = self.fastest.at(now.station_m).0;
        let point = self.track.at(now.station_m);
        if fastest * fastest * point.curvature_1pm.abs() > CORNER * self.grip_mps2 {
            self.lap.used += m.specific_x_mps2.hypot(m.specific_y_mps2) / self.grip_mps2;
            self.looks.1 += 1.0;
        }
        let outside = offset_m > self.half_width_m;
        self.lap.exits += u32::from(outside && !self.outside);
        self.outside = outside;
        let speed = m.v_x_mps.hypot(m.v_y_mps);
        self.slow =
            if speed < 0.05 * (self.grip_mps2 * self.track.length_m()).sqrt() { self.slow + 1 } else { 0 };
        if speed > 1.0 && m.v_y_mps.atan2(m.v_x_mps).abs() > 1.0 {
            Some("spin")
        } else if offset_m > 3.0 * self.half_width_m {
            Some("left the track")
        } else if self.slow > 300 {
            Some("standstill")
        } else {
            None
        }
    }
}
