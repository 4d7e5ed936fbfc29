//! What the car reports: odometry, drive command, IMU and wheel speeds, with everything that spoils them.
//!
//! Each sensor samples at `k / rate` plus jitter; stamps are the true instants of sampling. Noise per channel is
//! `bias + white + coloured`, the coloured part a first-order Gauss-Markov process.

use std::collections::VecDeque;

use gripsight_signals::Measurement;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::car::{CarParameters, GRAVITY_MPS2};
use crate::effects::SensorMechanisms;
use crate::error::ReferenceCarError;
use crate::motion::Motion;
use crate::track::wrap_angle;

/// Noise of one channel, in the channel's unit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// Standard deviation of the white part.
    pub white: f64,
    /// Standard deviation of the coloured part.
    pub coloured: f64,
    /// Correlation time of the coloured part.
    pub correlation_s: f64,
    /// Constant offset.
    pub bias: f64,
}

/// When a sensor reports.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sampling {
    /// Samples per second; zero switches the sensor off.
    pub rate_hz: f64,
    /// Standard deviation of the sampling instants.
    pub jitter_s: f64,
    /// Share of the samples that are lost.
    pub dropped: f64,
}

/// All sensors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SensorSettings {
    /// Odometry.
    pub odometry: Sampling,
    /// The record of the drive command; its rate is the driver's.
    pub drive_dropped: f64,
    /// Inertial measurement unit.
    pub imu: Sampling,
    /// Wheel speeds.
    pub wheels: Sampling,
    /// Odometry position, m.
    pub position: Noise,
    /// Odometry heading, rad.
    pub heading: Noise,
    /// Odometry longitudinal speed, m/s.
    pub v_x: Noise,
    /// Odometry lateral speed, m/s.
    pub v_y: Noise,
    /// Yaw rate of odometry and of the IMU, rad/s.
    pub yaw_rate: Noise,
    /// IMU accelerations, m/s2.
    pub acceleration: Noise,
    /// Wheel speeds, rad/s.
    pub wheel_speed: Noise,
}

/// A stamped report of one sensor. SI units, REP-103.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "sensor", rename_all = "snake_case")]
pub enum SensorSample {
    /// Pose and twist of the nominal centre of gravity.
    Odometry(OdometrySample),
    /// What the driver asked for; it holds until the next.
    Drive(DriveSample),
    /// Accelerations and yaw rate.
    Imu(ImuSample),
    /// Wheel speeds.
    Wheels(WheelSample),
}

/// Pose in the map frame, twist in the car's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OdometrySample {
    /// Time since the start of the run.
    pub stamp_s: f64,
    /// Position.
    pub x_m: f64,
    /// Position.
    pub y_m: f64,
    /// Heading, not wrapped.
    pub heading_rad: f64,
    /// Longitudinal speed.
    pub v_x_mps: f64,
    /// Lateral speed.
    pub v_y_mps: f64,
    /// Yaw rate.
    pub yaw_rate_radps: f64,
}

/// A drive command.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DriveSample {
    /// Time since the start of the run.
    pub stamp_s: f64,
    /// Road-wheel angle.
    pub steering_rad: f64,
    /// Speed aimed at.
    pub speed_mps: f64,
    /// Longitudinal force asked of the tires over the nominal mass.
    pub acceleration_mps2: f64,
}

/// Specific force and yaw rate; at rest on level ground the vertical acceleration is g.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ImuSample {
    /// Time since the start of the run.
    pub stamp_s: f64,
    /// Forward.
    pub a_x_mps2: f64,
    /// Left.
    pub a_y_mps2: f64,
    /// Up.
    pub a_z_mps2: f64,
    /// Yaw rate.
    pub yaw_rate_radps: f64,
}

/// Speeds of the wheels: front left, front right, rear left, rear right.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WheelSample {
    /// Time since the start of the run.
    pub stamp_s: f64,
    /// Wheel speeds.
    pub wheel_radps: [f64; 4],
}

impl SensorSample {
    /// Time since the start of the run.
    pub fn stamp_s(&self) -> f64 {
        match self {
            Self::Odometry(s) => s.stamp_s,
            Self::Drive(s) => s.stamp_s,
            Self::Imu(s) => s.stamp_s,
            Self::Wheels(s) => s.stamp_s,
        }
    }
}

impl SensorSample {
    /// The report as telemetry, its stamp counted from `start_ns`.
    pub fn measurement(&self, start_ns: i64) -> Measurement {
        let stamp_ns = start_ns + (self.stamp_s() * 1e9).round() as i64;
        match self {
            Self::Odometry(s) => Measurement::Odometry(gripsight_signals::OdometrySample {
                stamp_ns,
                x_m: s.x_m,
                y_m: s.y_m,
                yaw_rad: wrap_angle(s.heading_rad),
                v_x_mps: s.v_x_mps,
                v_y_mps: s.v_y_mps,
                yaw_rate_radps: s.yaw_rate_radps,
            }),
            Self::Drive(s) => Measurement::Drive(gripsight_signals::DriveSample {
                stamp_ns,
                steering_angle_rad: s.steering_rad,
                speed_mps: s.speed_mps,
                acceleration_mps2: s.acceleration_mps2,
            }),
            Self::Imu(s) => Measurement::Imu(gripsight_signals::ImuSample {
                stamp_ns,
                a_x_mps2: s.a_x_mps2,
                a_y_mps2: s.a_y_mps2,
                yaw_rate_radps: s.yaw_rate_radps,
            }),
            Self::Wheels(s) => Measurement::Wheels(gripsight_signals::WheelsSample {
                stamp_ns,
                speed: s.wheel_radps,
                effort_nm: None,
            }),
        }
    }
}

impl Noise {
    /// White noise alone.
    pub fn white(standard_deviation: f64) -> Self {
        Self { white: standard_deviation, ..Self::default() }
    }
}

impl SensorSettings {
    /// Everything at 100 Hz, exact.
    pub fn exact() -> Self {
        let sampling = Sampling { rate_hz: 100.0, jitter_s: 0.0, dropped: 0.0 };
        let none = Noise::default();
        Self {
            odometry: sampling,
            drive_dropped: 0.0,
            imu: sampling,
            wheels: sampling,
            position: none,
            heading: none,
            v_x: none,
            v_y: none,
            yaw_rate: none,
            acceleration: none,
            wheel_speed: none,
        }
    }

    /// What a well-kept car of this size reports: 100 Hz, no jitter, nothing dropped, plain noise.
    pub fn for_car(car: &CarParameters) -> Self {
        let speed = car.top_speed_mps;
        let coloured = |white: f64, coloured: f64| Noise { white, coloured, correlation_s: 0.5, bias: 0.0 };
        Self {
            position: coloured(0.003 * car.wheelbase_m(), 0.006 * car.wheelbase_m()),
            heading: coloured(0.001, 0.002),
            v_x: coloured(0.0004 * speed + 0.006, 0.0002 * speed + 0.003),
            v_y: coloured(0.0003 * speed + 0.006, 0.00015 * speed + 0.003),
            yaw_rate: coloured(0.004, 0.001),
            acceleration: coloured(0.08, 0.02),
            wheel_speed: Noise::white(0.002 * speed / car.drive.wheel_radius_m),
            ..Self::exact()
        }
    }

    /// The same with all noise, white, coloured and bias, multiplied.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        for noise in self.noises_mut() {
            noise.white *= factor;
            noise.coloured *= factor;
            noise.bias *= factor;
        }
        self
    }

    fn noises_mut(&mut self) -> [&mut Noise; 7] {
        [
            &mut self.position,
            &mut self.heading,
            &mut self.v_x,
            &mut self.v_y,
            &mut self.yaw_rate,
            &mut self.acceleration,
            &mut self.wheel_speed,
        ]
    }

    pub(crate) fn validate(&self) -> Result<(), ReferenceCarError> {
        let check = |name: &str, value: f64, holds: bool, expected| {
            if value.is_finite() && holds {
                Ok(())
            } else {
                Err(ReferenceCarError::InvalidParameter { name: format!("sensors.{name}"), value, expected })
            }
        };
        for (name, sampling) in [("odometry", self.odometry), ("imu", self.imu), ("wheels", self.wheels)] {
            let rate = sampling.rate_hz;
            check(&format!("{name}.rate_hz"), rate, (0.0..=500.0).contains(&rate), "in 0..500 Hz")?;
            check(&format!("{name}.jitter_s"), sampling.jitter_s, sampling.jitter_s >= 0.0, "not negative")?;
            check(
                &format!("{name}.dropped"),
                sampling.dropped,
                (0.0..1.0).contains(&sampling.dropped),
                "in 0..1",
            )?;
        }
        check("drive_dropped", self.drive_dropped, (0.0..1.0).contains(&self.drive_dropped), "in 0..1")?;
        let mut copy = *self;
        for noise in copy.noises_mut() {
            check("noise.white", noise.white, noise.white >= 0.0, "not negative")?;
            check("noise.coloured", noise.coloured, noise.coloured >= 0.0, "not negative")?;
            check("noise.correlation_s", noise.correlation_s, noise.correlation_s >= 0.0, "not negative")?;
            check("noise.bias", noise.bias, true, "finite")?;
        }
        Ok(())
    }
}

/// A channel's noise as it runs.
#[derive(Debug, Clone)]
struct NoiseSource {
    noise: Noise,
    memory: f64,
    last_s: Option<f64>,
}

impl NoiseSource {
    fn new(noise: Noise) -> Self {
        Self { noise, memory: 0.0, last_s: None }
    }

    fn at(&mut self, time_s: f64, random: &mut ChaCha8Rng) -> f64 {
        let white: f64 = StandardNormal.sample(random);
        let driving: f64 = StandardNormal.sample(random);
        let kept = match self.last_s {
            Some(last_s) if self.noise.correlation_s > 0.0 => {
                (-(time_s - last_s) / self.noise.correlation_s).exp()
            }
            _ => 0.0,
        };
        self.last_s = Some(time_s);
        self.memory = kept * self.memory + (1.0 - kept * kept).sqrt() * driving;
        self.noise.bias + self.noise.white * white + self.noise.coloured * self.memory
    }
}

/// Sampling instants of one sensor.
#[derive(Debug, Clone)]
struct Clock {
    sampling: Sampling,
    count: u64,
    next_s: f64,
}

impl Clock {
    fn new(sampling: Sampling) -> Self {
        let next_s = if sampling.rate_hz > 0.0 { 0.0 } else { f64::INFINITY };
        Self { sampling, count: 0, next_s }
    }

    /// The next instant not after `now_s`, and whether its sample survives.
    fn due(&mut self, now_s: f64, random: &mut ChaCha8Rng) -> Option<(f64, bool)> {
        if self.next_s > now_s + 1e-9 {
            return None;
        }
        let instant_s = self.next_s;
        self.count += 1;
        let period_s = 1.0 / self.sampling.rate_hz;
        let normal: f64 = StandardNormal.sample(random);
        let jitter_s = (normal * self.sampling.jitter_s).clamp(-0.45 * period_s, 0.45 * period_s);
        self.next_s = self.count as f64 / self.sampling.rate_hz + jitter_s;
        Some((instant_s, random.random::<f64>() >= self.sampling.dropped))
    }
}

/// The sensors of one car as they run.
#[derive(Debug, Clone)]
pub(crate) struct Sensors {
    mechanisms: SensorMechanisms,
    /// Where the sensors sit: the nominal centre of gravity, ahead of the true one.
    seat_x_m: f64,
    random: ChaCha8Rng,
    odometry: Clock,
    imu: Clock,
    wheels: Clock,
    drive_dropped: f64,
    sources: [NoiseSource; 14],
    late_v_y: VecDeque<f64>,
    filtered_v_y: Option<f64>,
}

impl Sensors {
    pub(crate) fn new(
        settings: &SensorSettings,
        mechanisms: SensorMechanisms,
        seat_x_m: f64,
        step_s: f64,
        seed: u64,
    ) -> Self {
        let s = settings;
        let noises = [
            s.position,
            s.position,
            s.heading,
            s.v_x,
            s.v_y,
            s.yaw_rate,
            s.acceleration,
            s.acceleration,
            s.acceleration,
            s.yaw_rate,
            s.wheel_speed,
            s.wheel_speed,
            s.wheel_speed,
            s.wheel_speed,
        ];
        let late = (mechanisms.v_y_delay_s / step_s).round() as usize;
        Self {
            mechanisms,
            seat_x_m,
            random: ChaCha8Rng::seed_from_u64(seed),
            odometry: Clock::new(s.odometry),
            imu: Clock::new(s.imu),
            wheels: Clock::new(s.wheels),
            drive_dropped: s.drive_dropped,
            sources: noises.map(NoiseSource::new),
            late_v_y: std::iter::repeat_n(0.0, late).collect(),
            filtered_v_y: None,
        }
    }

    /// Lateral speed at the odometry's reference point, through its filter and delay. Called once a step.
    pub(crate) fn lateral_speed(&mut self, v_y_mps: f64, yaw_rate_radps: f64, dt_s: f64) -> f64 {
        let here = v_y_mps + (self.seat_x_m + self.mechanisms.v_y_lever_arm_m) * yaw_rate_radps;
        let tau_s = self.mechanisms.v_y_low_pass_s;
        let before = self.filtered_v_y.unwrap_or(here);
        let smooth = if tau_s > 0.0 { before - (here - before) * (-dt_s / tau_s).exp_m1() } else { here };
        self.filtered_v_y = Some(smooth);
        self.late_v_y.push_back(smooth);
        self.late_v_y.pop_front().unwrap_or(smooth)
    }

    /// The record of a drive command, unless it is lost.
    pub(crate) fn drive(&mut self, sample: DriveSample) -> Option<SensorSample> {
        (self.random.random::<f64>() >= self.drive_dropped).then_some(SensorSample::Drive(sample))
    }

    /// Everything due up to the later of two neighbouring motions; the instants of surviving odometry go to `truth`.
    pub(crate) fn sample(
        &mut self,
        from: &Motion,
        to: &Motion,
        out: &mut Vec<SensorSample>,
        truth: &mut Vec<f64>,
    ) {
        while let Some((time_s, kept)) = self.odometry.due(to.time_s, &mut self.random) {
            let sample = self.odometry_at(&Motion::between(from, to, time_s));
            if kept {
                out.push(SensorSample::Odometry(sample));
                truth.push(time_s);
            }
        }
        while let Some((time_s, kept)) = self.imu.due(to.time_s, &mut self.random) {
            let sample = self.imu_at(&Motion::between(from, to, time_s));
            if kept {
                out.push(SensorSample::Imu(sample));
            }
        }
        while let Some((time_s, kept)) = self.wheels.due(to.time_s, &mut self.random) {
            let motion = Motion::between(from, to, time_s);
            let mut wheel_radps = motion.wheel_radps;
            for (i, wheel) in wheel_radps.iter_mut().enumerate() {
                *wheel += self.noise(10 + i, time_s);
            }
            if kept {
                out.push(SensorSample::Wheels(WheelSample { stamp_s: time_s, wheel_radps }));
            }
        }
    }

    fn noise(&mut self, source: usize, time_s: f64) -> f64 {
        self.sources[source].at(time_s, &mut self.random)
    }

    fn gyro(&self, yaw_rate_radps: f64) -> f64 {
        (1.0 + self.mechanisms.gyro_scale) * yaw_rate_radps + self.mechanisms.gyro_bias_radps
    }

    fn odometry_at(&mut self, m: &Motion) -> OdometrySample {
        let arm_m = self.seat_x_m + self.mechanisms.v_y_lever_arm_m;
        let (sin, cos) = m.heading_rad.sin_cos();
        OdometrySample {
            stamp_s: m.time_s,
            x_m: m.x_m + arm_m * cos + self.noise(0, m.time_s),
            y_m: m.y_m + arm_m * sin + self.noise(1, m.time_s),
            heading_rad: m.heading_rad + self.noise(2, m.time_s),
            v_x_mps: (1.0 + self.mechanisms.v_x_scale) * m.v_x_mps + self.noise(3, m.time_s),
            v_y_mps: m.reported_v_y_mps + self.mechanisms.v_y_bias_mps + self.noise(4, m.time_s),
            yaw_rate_radps: self.gyro(m.yaw_rate_radps) + self.noise(5, m.time_s),
        }
    }

    fn imu_at(&mut self, m: &Motion) -> ImuSample {
        let (x_m, y_m) = (self.seat_x_m + self.mechanisms.imu_x_m, self.mechanisms.imu_y_m);
        let (rate, acceleration) = (m.yaw_rate_radps, m.yaw_acceleration_radps2);
        let a_x = m.specific_x_mps2 - y_m * acceleration - x_m * rate * rate;
        let a_y = m.specific_y_mps2 + x_m * acceleration - y_m * rate * rate;
        let (sin, cos) = self.mechanisms.imu_roll_rad.sin_cos();
        ImuSample {
            stamp_s: m.time_s,
            a_x_mps2: a_x + self.noise(6, m.time_s),
            a_y_mps2: a_y * cos + GRAVITY_MPS2 * sin + self.noise(7, m.time_s),
            a_z_mps2: GRAVITY_MPS2 * cos - a_y * sin + self.noise(8, m.time_s),
            yaw_rate_radps: self.gyro(rate) + self.noise(9, m.time_s),
        }
    }
}
