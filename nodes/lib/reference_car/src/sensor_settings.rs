//! What each sensor does: rate, jitter, losses, noise.

use serde::{Deserialize, Serialize};

use crate::car::CarParameters;
use crate::error::ReferenceCarError;

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
    /// Pictures of the road a second; zero switches the camera off.
    pub camera_rate_hz: f64,
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

impl Noise {
    /// White noise alone.
    pub fn white(standard_deviation: f64) -> Self {
        Self { white: standard_deviation, ..Self::default() }
    }
}

impl SensorSettings {
    /// Everything at 100 Hz, exact; no camera.
    pub fn exact() -> Self {
        let sampling = Sampling { rate_hz: 100.0, jitter_s: 0.0, dropped: 0.0 };
        let none = Noise::default();
        Self {
            odometry: sampling,
            drive_dropped: 0.0,
            imu: sampling,
            wheels: sampling,
            camera_rate_hz: 0.0,
            position: none,
            heading: none,
            v_x: none,
            v_y: none,
            yaw_rate: none,
            acceleration: none,
            wheel_speed: none,
        }
    }

    /// What a well-kept car of this size reports: 100 Hz, no jitter, nothing dropped, plain noise, no camera.
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
        let camera = self.camera_rate_hz;
        check("camera_rate_hz", camera, (0.0..=60.0).contains(&camera), "in 0..60 Hz")?;
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
