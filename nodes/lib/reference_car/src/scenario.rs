//! What to simulate: car, course, driver, road, effects, sensors.

use serde::{Deserialize, Serialize};

use crate::car::CarParameters;
use crate::effects::EffectSetting;
use crate::error::ReferenceCarError;
use crate::mechanisms::{Mechanisms, Patch};
use crate::sensor_settings::SensorSettings;
use crate::track::TRACK_NAMES;

/// Where and how the car is driven.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Course {
    /// A closed track, driven by the [`DriverKind`].
    Track {
        /// One of the built-in tracks.
        name: String,
        /// Clockwise instead of anticlockwise.
        reversed: bool,
    },
    /// A circle, driven by the [`DriverKind`] with slowly growing speed.
    SteadyCircle {
        /// Radius.
        radius_m: f64,
        /// Clockwise instead of anticlockwise.
        reversed: bool,
    },
    /// Steering that grows linearly at constant speed.
    RampSteer {
        /// Speed.
        speed_mps: f64,
        /// Rate of the steering angle.
        rate_radps: f64,
    },
    /// A step of the steering angle at constant speed, one second after the start.
    StepSteer {
        /// Speed.
        speed_mps: f64,
        /// Steering angle after the step.
        angle_rad: f64,
        /// Time in which it rises.
        rise_s: f64,
    },
    /// Sinusoidal steering of growing frequency at constant speed.
    SineSweep {
        /// Speed.
        speed_mps: f64,
        /// Amplitude.
        amplitude_rad: f64,
        /// First frequency.
        from_hz: f64,
        /// Last frequency, reached at the end of the run.
        to_hz: f64,
    },
}

/// Names of the courses on an open plane or a circle.
pub const MANOEUVRE_NAMES: [&str; 4] = ["steady_circle", "ramp_steer", "step_steer", "sine_sweep"];

impl Course {
    /// A track by name, or a manoeuvre by name at speeds and angles that suit the car.
    ///
    /// # Errors
    /// `UnknownName` with the names that exist.
    pub fn by_name(name: &str, car: &CarParameters, reversed: bool) -> Result<Self, ReferenceCarError> {
        let speed_mps = 0.45 * car.top_speed_mps;
        let sign = if reversed { -1.0 } else { 1.0 };
        // Steering angle at a third of a g, from the wheelbase alone.
        let angle_rad = sign * 0.33 * 9.81 * car.wheelbase_m() / (speed_mps * speed_mps) * 1.5;
        match name {
            "steady_circle" => Ok(Self::SteadyCircle { radius_m: 40.0 * car.wheelbase_m() / 3.0, reversed }),
            "ramp_steer" => Ok(Self::RampSteer { speed_mps, rate_radps: angle_rad / 3.0 }),
            "step_steer" => Ok(Self::StepSteer { speed_mps, angle_rad, rise_s: 0.05 }),
            "sine_sweep" => {
                Ok(Self::SineSweep { speed_mps, amplitude_rad: angle_rad, from_hz: 0.2, to_hz: 4.0 })
            }
            _ if TRACK_NAMES.contains(&name) => Ok(Self::Track { name: name.to_owned(), reversed }),
            _ => Err(ReferenceCarError::UnknownName {
                kind: "track",
                name: name.to_owned(),
                known: TRACK_NAMES.iter().chain(&MANOEUVRE_NAMES).copied().collect::<Vec<_>>().join(", "),
            }),
        }
    }
}

/// Who steers on a track.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DriverKind {
    /// Pure pursuit; brakes before the corner and accelerates after it.
    PurePursuit,
    /// Follows the fastest speed profile within its share of the grip, braking into the corner.
    Profile,
}

/// How the car is driven.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DriverSettings {
    /// Who steers.
    pub kind: DriverKind,
    /// Share of the grip that the driver plans to use.
    pub pace: f64,
    /// Commands per second; each holds until the next.
    pub rate_hz: f64,
    /// Amplitude of a small broad-band steering movement on top, which excites the car.
    pub dither_rad: f64,
}

impl Default for DriverSettings {
    fn default() -> Self {
        Self { kind: DriverKind::PurePursuit, pace: 0.8, rate_hz: 100.0, dither_rad: 0.0 }
    }
}

/// Friction of the road.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Friction {
    /// The same everywhere.
    Uniform {
        /// Friction.
        mu: f64,
    },
    /// Another friction in places.
    Patched {
        /// Friction outside the patches.
        mu: f64,
        /// The patches.
        patches: Vec<Patch>,
    },
    /// Another friction from a time on, as when rain sets in.
    Changing {
        /// Friction at first.
        mu: f64,
        /// Friction later.
        mu_after: f64,
        /// When it changes.
        at_s: f64,
        /// How long the change takes.
        over_s: f64,
    },
}

impl Friction {
    /// The friction that the driver counts on.
    pub fn nominal(&self) -> f64 {
        match self {
            Self::Uniform { mu } | Self::Patched { mu, .. } | Self::Changing { mu, .. } => *mu,
        }
    }

    pub(crate) fn validate(&self) -> Result<(), ReferenceCarError> {
        positive("friction.mu", self.nominal())?;
        match self {
            Self::Uniform { .. } => Ok(()),
            Self::Patched { patches, .. } => patches.iter().try_for_each(|p| {
                within("friction.patch.depth", p.depth, p.depth < 1.0, "below 1")?;
                within("friction.patch.length_m", p.length_m, p.length_m >= 0.0, "not negative")
            }),
            Self::Changing { mu_after, at_s, over_s, .. } => {
                positive("friction.mu_after", *mu_after)?;
                within("friction.at_s", *at_s, true, "finite")?;
                within("friction.over_s", *over_s, *over_s >= 0.0, "not negative")
            }
        }
    }
}

/// A whole run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scenario {
    /// The car.
    pub car: CarParameters,
    /// Where it drives.
    pub course: Course,
    /// Who drives it.
    pub driver: DriverSettings,
    /// The road.
    pub friction: Friction,
    /// The effects at work.
    pub effects: Vec<EffectSetting>,
    /// The recorded signals.
    pub sensors: SensorSettings,
    /// Length of the run.
    pub duration_s: f64,
    /// Step of the integration.
    pub step_s: f64,
    /// Seed of noise, gusts and dither.
    pub seed: u64,
}

impl Scenario {
    /// A car on the club track: pure pursuit at 80 % of the grip, friction 0.9, 30 s, no effects.
    pub fn new(car: CarParameters) -> Self {
        let sensors = SensorSettings::for_car(&car);
        Self {
            car,
            course: Course::Track { name: "club".to_owned(), reversed: false },
            driver: DriverSettings::default(),
            friction: Friction::Uniform { mu: 0.9 },
            effects: Vec::new(),
            sensors,
            duration_s: 30.0,
            step_s: 0.001,
            seed: 1,
        }
    }

    /// The same on another course.
    #[must_use]
    pub fn course(mut self, course: Course) -> Self {
        self.course = course;
        self
    }

    /// The same with another driver and pace.
    #[must_use]
    pub fn driver(mut self, kind: DriverKind, pace: f64) -> Self {
        self.driver.kind = kind;
        self.driver.pace = pace;
        self
    }

    /// The same with steering dither.
    #[must_use]
    pub fn dither(mut self, amplitude_rad: f64) -> Self {
        self.driver.dither_rad = amplitude_rad;
        self
    }

    /// The same on another road.
    #[must_use]
    pub fn friction(mut self, friction: Friction) -> Self {
        self.friction = friction;
        self
    }

    /// The same with one more effect.
    #[must_use]
    pub fn effect(mut self, effect: EffectSetting) -> Self {
        self.effects.push(effect);
        self
    }

    /// The same with other sensors.
    #[must_use]
    pub fn sensors(mut self, sensors: SensorSettings) -> Self {
        self.sensors = sensors;
        self
    }

    /// The same with another length.
    #[must_use]
    pub fn duration(mut self, duration_s: f64) -> Self {
        self.duration_s = duration_s;
        self
    }

    /// The same with another seed.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// The mechanisms that the effects switch on.
    ///
    /// # Errors
    /// As [`Mechanisms::from_settings`].
    pub fn mechanisms(&self) -> Result<Mechanisms, ReferenceCarError> {
        Mechanisms::from_settings(&self.effects, self.car.wheelbase_m() < 1.0)
    }

    /// Checks everything that can be checked before the run.
    ///
    /// # Errors
    /// The first parameter that makes no sense.
    pub fn validate(&self) -> Result<(), ReferenceCarError> {
        self.car.validate()?;
        let mechanisms = self.mechanisms()?;
        let shift = mechanisms.cog_shift_m;
        within(
            "effect cog_shift.dl_m",
            shift,
            shift < self.car.l_f_m && -shift < self.car.l_r_m,
            "inside the wheelbase",
        )?;
        self.friction.validate()?;
        self.sensors.validate()?;
        within(
            "duration_s",
            self.duration_s,
            self.duration_s > 0.0 && self.duration_s <= 36_000.0,
            "in 0..36000 s",
        )?;
        within("step_s", self.step_s, self.step_s > 0.0 && self.step_s <= 0.002, "in 0..0.002 s")?;
        let pace = self.driver.pace;
        within("driver.pace", pace, pace > 0.0 && pace <= 2.0, "in 0..2")?;
        let rate = self.driver.rate_hz;
        within(
            "driver.rate_hz",
            rate,
            rate > 0.0 && rate * self.step_s <= 1.0,
            "above 0, at most one a step",
        )?;
        within("driver.dither_rad", self.driver.dither_rad, self.driver.dither_rad >= 0.0, "not negative")?;
        match &self.course {
            Course::Track { .. } => Ok(()),
            Course::SteadyCircle { radius_m, .. } => within(
                "course.radius_m",
                *radius_m,
                *radius_m > self.car.wheelbase_m(),
                "above the wheelbase",
            ),
            Course::RampSteer { speed_mps, rate_radps } => {
                positive("course.speed_mps", *speed_mps)?;
                within("course.rate_radps", *rate_radps, true, "finite")
            }
            Course::StepSteer { speed_mps, angle_rad, rise_s } => {
                positive("course.speed_mps", *speed_mps)?;
                within("course.angle_rad", *angle_rad, true, "finite")?;
                within("course.rise_s", *rise_s, *rise_s >= 0.0, "not negative")
            }
            Course::SineSweep { speed_mps, amplitude_rad, from_hz, to_hz } => {
                positive("course.speed_mps", *speed_mps)?;
                within("course.amplitude_rad", *amplitude_rad, true, "finite")?;
                positive("course.from_hz", *from_hz)?;
                positive("course.to_hz", *to_hz)
            }
        }
    }
}

fn positive(name: &str, value: f64) -> Result<(), ReferenceCarError> {
    within(name, value, value > 0.0, "above zero")
}

fn within(name: &str, value: f64, holds: bool, expected: &'static str) -> Result<(), ReferenceCarError> {
    if value.is_finite() && holds {
        Ok(())
    } else {
        Err(ReferenceCarError::InvalidParameter { name: name.to_owned(), value, expected })
    }
}
