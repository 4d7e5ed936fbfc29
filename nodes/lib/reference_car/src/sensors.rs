//! What the car reports: odometry, drive command, IMU and wheel speeds, with everything that spoils them.
//!
//! Each sensor samples at `k / rate` plus jitter; stamps are the true instants of sampling. Noise per channel is
//! `bias + white + coloured`, the coloured part a first-order Gauss-Markov process.

use std::collections::VecDeque;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::car::GRAVITY_MPS2;
use crate::mechanisms::SensorMechanisms;
use crate::motion::Motion;
use crate::samples::{DriveSample, ImuSample, OdometrySample, SensorSample, WheelSample};
use crate::sensor_settings::{Noise, Sampling, SensorSettings};
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
