//! One message each, freed of ROS: stamp in nanoseconds, SI units, REP-103 frames.

use crate::{NS_PER_S, Signal, SignalError, Values};

/// Largest size of a value: nothing on a car is, in any unit.
const LARGEST: f64 = 1e18;

/// Pose in a fixed frame and velocity in the car's frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OdometrySample {
    /// Time of the measurement.
    pub stamp_ns: i64,
    /// Position in the map.
    pub x_m: f64,
    /// Position in the map.
    pub y_m: f64,
    /// Heading in the map, in (-pi, pi].
    pub yaw_rad: f64,
    /// Forward velocity.
    pub v_x_mps: f64,
    /// Velocity to the left, at whatever point the estimator takes.
    pub v_y_mps: f64,
    /// Yaw rate.
    pub yaw_rate_radps: f64,
}

/// What the driver asked for.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DriveSample {
    /// Time of the command.
    pub stamp_ns: i64,
    /// Road-wheel angle, or its command.
    pub steering_angle_rad: f64,
    /// Commanded speed.
    pub speed_mps: f64,
    /// Commanded acceleration; zero throughout where the stack does not use it.
    pub acceleration_mps2: f64,
}

/// Inertial measurement.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ImuSample {
    /// Time of the measurement.
    pub stamp_ns: i64,
    /// Specific force forward.
    pub a_x_mps2: f64,
    /// Specific force to the left.
    pub a_y_mps2: f64,
    /// Yaw rate of the gyroscope.
    pub yaw_rate_radps: f64,
}

/// Wheel speeds, and torques where recorded; order of [`crate::WHEELS`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WheelsSample {
    /// Time of the measurement.
    pub stamp_ns: i64,
    /// As reported: rad/s of a ROS JointState, or m/s where a stack writes that.
    pub speed: [f64; 4],
    /// Wheel torque in N m, where recorded.
    pub effort_nm: Option<[f64; 4]>,
}

/// Pose of a localisation that has a topic of its own.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PoseSample {
    /// Time of the measurement.
    pub stamp_ns: i64,
    /// Position in the map.
    pub x_m: f64,
    /// Position in the map.
    pub y_m: f64,
    /// Heading in the map.
    pub yaw_rad: f64,
}

/// What a topics file takes from one message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MappedSample {
    /// Which of the mapped topics, counted from 0.
    pub topic: u8,
    /// Time of the measurement.
    pub stamp_ns: i64,
    /// The signals taken; infinite where the message held a value that is none.
    pub values: Values,
}

/// A message of one of the streams.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Measurement {
    /// Odometry: the clock of the sequence.
    Odometry(OdometrySample),
    /// Drive command.
    Drive(DriveSample),
    /// Inertial unit, optional.
    Imu(ImuSample),
    /// Wheels, optional.
    Wheels(WheelsSample),
    /// Whatever a topics file maps field by field.
    Mapped(MappedSample),
}

/// Streams that have a type of their own; those of a topics file come after them.
pub(crate) const TYPED_STREAMS: usize = 4;

impl Measurement {
    /// Time of the measurement.
    #[must_use]
    pub fn stamp_ns(&self) -> i64 {
        match self {
            Self::Odometry(m) => m.stamp_ns,
            Self::Drive(m) => m.stamp_ns,
            Self::Imu(m) => m.stamp_ns,
            Self::Wheels(m) => m.stamp_ns,
            Self::Mapped(m) => m.stamp_ns,
        }
    }

    /// As [`Self::stamp_ns`], to be moved.
    pub fn stamp_ns_mut(&mut self) -> &mut i64 {
        match self {
            Self::Odometry(m) => &mut m.stamp_ns,
            Self::Drive(m) => &mut m.stamp_ns,
            Self::Imu(m) => &mut m.stamp_ns,
            Self::Wheels(m) => &mut m.stamp_ns,
            Self::Mapped(m) => &mut m.stamp_ns,
        }
    }

    /// The stream's role, as topics name it.
    #[must_use]
    pub fn stream(&self) -> &'static str {
        ["odom", "drive", "imu", "wheels", "mapped"][self.stream_index().min(TYPED_STREAMS)]
    }

    /// Which stream: odometry 0, drive 1, inertial unit 2, wheels 3, then the topics of a topics file in its order.
    #[must_use]
    pub fn stream_index(&self) -> usize {
        match self {
            Self::Odometry(_) => 0,
            Self::Drive(_) => 1,
            Self::Imu(_) => 2,
            Self::Wheels(_) => 3,
            Self::Mapped(m) => TYPED_STREAMS + usize::from(m.topic),
        }
    }

    /// What the message says, signal by signal.
    #[must_use]
    pub fn values(&self) -> Values {
        let mut values = Values::default();
        let mut set = |signals: &[Signal], of: &[f64]| {
            signals.iter().zip(of).for_each(|(&signal, &value)| values.set(signal, value));
        };
        match self {
            Self::Odometry(m) => {
                set(&Signal::POSE, &[m.x_m, m.y_m, m.yaw_rad]);
                let motion = [Signal::ForwardSpeed, Signal::LateralSpeed, Signal::YawRate];
                set(&motion, &[m.v_x_mps, m.v_y_mps, m.yaw_rate_radps]);
            }
            Self::Drive(m) => {
                let command = [Signal::Steering, Signal::SpeedCommand, Signal::AccelerationCommand];
                set(&command, &[m.steering_angle_rad, m.speed_mps, m.acceleration_mps2]);
            }
            Self::Imu(m) => {
                let inertial = [Signal::ForwardAcceleration, Signal::LateralAcceleration, Signal::Gyro];
                set(&inertial, &[m.a_x_mps2, m.a_y_mps2, m.yaw_rate_radps]);
            }
            Self::Wheels(m) => {
                set(&Signal::WHEEL_SPEEDS, &m.speed);
                set(&Signal::WHEEL_EFFORTS, &m.effort_nm.unwrap_or([f64::NAN; 4]));
            }
            Self::Mapped(m) => values = m.values,
        }
        values
    }

    /// # Errors
    /// [`SignalError::NotFinite`] names the first field that is NaN, infinite or beyond what a sequence's float32 holds with its square: one such
    /// value would cost every window that it is in. `index` is the message's place in its stream.
    pub fn check_finite(&self, index: usize) -> Result<(), SignalError> {
        let topic = self.stream();
        let stamp_s = self.stamp_ns() as f64 / NS_PER_S;
        let check = |fields: &[(&'static str, f64)]| match fields
            .iter()
            .find(|(_, v)| v.is_nan() || v.abs() > LARGEST)
        {
            Some(&(field, value)) => Err(SignalError::NotFinite { topic, field, value, stamp_s, index }),
            None => Ok(()),
        };
        match self {
            Self::Odometry(m) => check(&[
                ("x_m", m.x_m),
                ("y_m", m.y_m),
                ("yaw_rad", m.yaw_rad),
                ("v_x_mps", m.v_x_mps),
                ("v_y_mps", m.v_y_mps),
                ("yaw_rate_radps", m.yaw_rate_radps),
            ]),
            Self::Drive(m) => check(&[
                ("steering_angle_rad", m.steering_angle_rad),
                ("speed_mps", m.speed_mps),
                ("acceleration_mps2", m.acceleration_mps2),
            ]),
            Self::Imu(m) => check(&[
                ("a_x_mps2", m.a_x_mps2),
                ("a_y_mps2", m.a_y_mps2),
                ("yaw_rate_radps", m.yaw_rate_radps),
            ]),
            Self::Wheels(m) => {
                check(&m.speed.map(|v| ("wheel speed", v)))?;
                m.effort_nm.map_or(Ok(()), |e| check(&e.map(|v| ("wheel effort", v))))
            }
            Self::Mapped(m) => {
                let present: Vec<_> = m.values.present().map(|(signal, v)| (signal.name(), v)).collect();
                check(&present)
            }
        }
    }
}

/// Everything known at one odometry stamp.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TelemetrySample {
    /// The odometry message of this instant.
    pub odometry: OdometrySample,
    /// The drive command in force; where only a measured angle is recorded, that at this instant.
    pub drive: DriveSample,
    /// The drive command in force as received; `None` where none is recorded.
    pub command: Option<DriveSample>,
    /// Measured steering, interpolated to this instant.
    pub measured_steering_rad: Option<f64>,
    /// Inertial unit, interpolated to this instant; `None` without one.
    pub imu: Option<ImuSample>,
    /// Wheels, interpolated to this instant; `None` without them.
    pub wheels: Option<WheelsSample>,
}
