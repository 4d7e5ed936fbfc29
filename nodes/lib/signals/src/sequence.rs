//! The unit of work of the suite: a stretch of aligned telemetry in float32.

use crate::{NS_PER_S, SignalError, TelemetrySample};

/// A window of telemetry at the stamps of the odometry. Channels are as long as `time_s`, or empty where not recorded.
///
/// float32 on purpose: it is what travels over the topic, and the offline command works on the same numbers, so both give the
/// same Phi_p bit for bit. Times and positions are relative to the first sample, so that float32 is enough.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StateSequence {
    /// Names the sequence: the first stamp in nanoseconds.
    pub sequence_id: u64,
    /// Stamp of the first sample.
    pub start_stamp_ns: i64,
    /// Time since the first sample; strictly increasing, gaps and jitter kept as they were.
    pub time_s: Vec<f32>,
    /// Forward velocity.
    pub v_x_mps: Vec<f32>,
    /// Lateral velocity as measured.
    pub v_y_mps: Vec<f32>,
    /// Yaw rate as measured.
    pub yaw_rate_radps: Vec<f32>,
    /// Steering angle or command as recorded.
    pub steering_rad: Vec<f32>,
    /// Position relative to the first sample; empty without a pose.
    pub x_m: Vec<f32>,
    /// Position relative to the first sample; empty without a pose.
    pub y_m: Vec<f32>,
    /// Heading, unwrapped; empty without a pose.
    pub yaw_rad: Vec<f32>,
    /// Specific force forward; empty without an inertial unit.
    pub a_x_mps2: Vec<f32>,
    /// Specific force to the left; empty without an inertial unit.
    pub a_y_mps2: Vec<f32>,
    /// Gyroscope's yaw rate; empty without an inertial unit.
    pub gyro_yaw_rate_radps: Vec<f32>,
    /// Commanded speed.
    pub command_speed_mps: Vec<f32>,
    /// Commanded acceleration; empty where the stack never used it.
    pub command_acceleration_mps2: Vec<f32>,
    /// Wheel speeds as reported, order of [`crate::WHEELS`]; empty without them.
    pub wheel_speed: [Vec<f32>; 4],
    /// Torque on both wheels of the front and of the rear axle together; empty without them.
    pub wheel_effort_nm: [Vec<f32>; 2],
}

impl StateSequence {
    /// Makes a sequence of aligned samples. An optional channel is kept where nearly every sample has it (a topic may start a
    /// moment late; the value next to it then stands in); a commanded acceleration where
    /// it is not zero throughout; a pose where it is not zero throughout.
    ///
    /// # Errors
    /// [`SignalError::TooShort`] with fewer than two samples.
    pub fn from_samples(samples: &[TelemetrySample]) -> Result<Self, SignalError> {
        let [first, _, ..] = samples else {
            return Err(SignalError::TooShort { what: "state sequence", got: samples.len(), needed: 2 });
        };
        let origin = first.odometry;
        let channel =
            |f: &dyn Fn(&TelemetrySample) -> f64| samples.iter().map(|s| f(s) as f32).collect::<Vec<_>>();
        let optional = |f: &dyn Fn(&TelemetrySample) -> Option<f64>| {
            filled(samples.iter().map(|s| f(s).map(|v| v as f32)).collect())
        };
        let unless_zero = |v: Vec<f32>| if v.iter().all(|&x| x == 0.0) { Vec::new() } else { v };
        let posed = samples.iter().any(|s| {
            (s.odometry.x_m, s.odometry.y_m, s.odometry.yaw_rad) != (origin.x_m, origin.y_m, origin.yaw_rad)
        });
        let pose = |f: &dyn Fn(&TelemetrySample) -> f64| if posed { channel(f) } else { Vec::new() };
        Ok(Self {
            sequence_id: origin.stamp_ns as u64,
            start_stamp_ns: origin.stamp_ns,
            time_s: channel(&|s| (s.odometry.stamp_ns - origin.stamp_ns) as f64 / NS_PER_S),
            v_x_mps: channel(&|s| s.odometry.v_x_mps),
            v_y_mps: channel(&|s| s.odometry.v_y_mps),
            yaw_rate_radps: channel(&|s| s.odometry.yaw_rate_radps),
            steering_rad: channel(&|s| s.drive.steering_angle_rad),
            x_m: pose(&|s| s.odometry.x_m - origin.x_m),
            y_m: pose(&|s| s.odometry.y_m - origin.y_m),
            yaw_rad: unwrapped(pose(&|s| s.odometry.yaw_rad)),
            a_x_mps2: optional(&|s| s.imu.map(|i| i.a_x_mps2)),
            a_y_mps2: optional(&|s| s.imu.map(|i| i.a_y_mps2)),
            gyro_yaw_rate_radps: optional(&|s| s.imu.map(|i| i.yaw_rate_radps)),
            command_speed_mps: unless_zero(channel(&|s| s.drive.speed_mps)),
            command_acceleration_mps2: unless_zero(channel(&|s| s.drive.acceleration_mps2)),
            wheel_speed: std::array::from_fn(|w| optional(&|s| s.wheels.map(|x| x.speed[w]))),
            wheel_effort_nm: [0, 2]
                .map(|left| optional(&|s| s.wheels.and_then(|x| x.effort_nm).map(|e| e[left] + e[left + 1]))),
        })
    }

    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Time from the first to the last sample.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.time_s.last().map_or(0.0, |&t| f64::from(t))
    }

    /// Every channel with its name, `time_s` first: what checks and files go through.
    #[must_use]
    pub fn channels(&self) -> Vec<(&'static str, &[f32])> {
        const SPEED: [&str; 4] = ["wheel_speed_fl", "wheel_speed_fr", "wheel_speed_rl", "wheel_speed_rr"];
        const EFFORT: [&str; 2] = ["wheel_effort_front_nm", "wheel_effort_rear_nm"];
        let mut all: Vec<(&'static str, &[f32])> = vec![
            ("time_s", &self.time_s),
            ("v_x_mps", &self.v_x_mps),
            ("v_y_mps", &self.v_y_mps),
            ("yaw_rate_radps", &self.yaw_rate_radps),
            ("steering_rad", &self.steering_rad),
            ("x_m", &self.x_m),
            ("y_m", &self.y_m),
            ("yaw_rad", &self.yaw_rad),
            ("a_x_mps2", &self.a_x_mps2),
            ("a_y_mps2", &self.a_y_mps2),
            ("gyro_yaw_rate_radps", &self.gyro_yaw_rate_radps),
            ("command_speed_mps", &self.command_speed_mps),
            ("command_acceleration_mps2", &self.command_acceleration_mps2),
        ];
        all.extend(SPEED.iter().zip(&self.wheel_speed).map(|(&n, c)| (n, c.as_slice())));
        all.extend(EFFORT.iter().zip(&self.wheel_effort_nm).map(|(&n, c)| (n, c.as_slice())));
        all
    }

    /// Checks what came from outside: lengths, order of time, finite values.
    ///
    /// # Errors
    /// The first thing wrong, with its channel and place.
    pub fn check(&self) -> Result<(), SignalError> {
        let expected = self.len();
        if expected < 2 {
            return Err(SignalError::TooShort { what: "state sequence", got: expected, needed: 2 });
        }
        for (place, (channel, values)) in self.channels().into_iter().enumerate() {
            let required = place < 5;
            if values.len() != expected && (required || !values.is_empty()) {
                return Err(SignalError::ChannelLength { channel, got: values.len(), expected });
            }
            if let Some(index) = values.iter().position(|v| !v.is_finite()) {
                return Err(SignalError::NotFinite {
                    topic: "sequence",
                    field: channel,
                    value: f64::from(values[index]),
                    stamp_s: f64::from(self.time_s[index]),
                    index,
                });
            }
        }
        match self.time_s.windows(2).position(|w| w[1] <= w[0]) {
            Some(k) => Err(SignalError::StampWentBack {
                topic: "sequence",
                index: k + 1,
                stamp_s: f64::from(self.time_s[k + 1]),
                back_s: f64::from(self.time_s[k] - self.time_s[k + 1]),
            }),
            None => Ok(()),
        }
    }
}

/// Share of the samples that must hold an optional channel for it to be kept.
const MIN_RECORDED_SHARE: f64 = 0.95;

/// A channel with its few missing values taken from their neighbours; empty where too many are missing.
fn filled(values: Vec<Option<f32>>) -> Vec<f32> {
    let recorded = values.iter().flatten().count();
    let Some(mut last) = values.iter().copied().flatten().next() else { return Vec::new() };
    if (recorded as f64) < MIN_RECORDED_SHARE * values.len() as f64 {
        return Vec::new();
    }
    values
        .into_iter()
        .map(|v| {
            last = v.unwrap_or(last);
            last
        })
        .collect()
}

/// Angles without the jumps of a full turn.
fn unwrapped(mut angles_rad: Vec<f32>) -> Vec<f32> {
    for k in 1..angles_rad.len() {
        let turns = ((angles_rad[k] - angles_rad[k - 1]) / std::f32::consts::TAU).round();
        angles_rad[k] -= turns * std::f32::consts::TAU;
    }
    angles_rad
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ImuSample, OdometrySample, WheelsSample};

    fn samples() -> Vec<TelemetrySample> {
        (0..200)
            .map(|k| {
                let yaw_rad = 0.1 * f64::from(k);
                TelemetrySample {
                    odometry: OdometrySample {
                        stamp_ns: 5_000_000_000 + i64::from(k) * 10_000_000,
                        x_m: 7.0 + f64::from(k),
                        yaw_rad: yaw_rad.sin().atan2(yaw_rad.cos()),
                        v_x_mps: 3.0,
                        ..Default::default()
                    },
                    wheels: Some(WheelsSample {
                        effort_nm: Some([1.0, 2.0, 3.0, 4.0]),
                        ..Default::default()
                    }),
                    ..Default::default()
                }
            })
            .collect()
    }

    #[test]
    fn times_and_positions_are_relative_and_the_heading_has_no_jumps() {
        let sequence = StateSequence::from_samples(&samples()).unwrap();
        sequence.check().unwrap();
        assert_eq!(sequence.sequence_id, 5_000_000_000);
        assert_eq!((sequence.time_s[100], sequence.x_m[100]), (1.0, 100.0));
        approx::assert_abs_diff_eq!(sequence.yaw_rad[199], 19.9, epsilon = 1e-4);
        assert_eq!((sequence.wheel_effort_nm[0][0], sequence.wheel_effort_nm[1][0]), (3.0, 7.0));
    }

    #[test]
    fn a_channel_is_kept_where_nearly_every_sample_has_it() {
        let mut late = samples();
        for (k, sample) in late.iter_mut().enumerate().skip(4) {
            sample.imu = Some(ImuSample { a_y_mps2: k as f64, ..Default::default() });
        }
        let a_y_mps2 = StateSequence::from_samples(&late).unwrap().a_y_mps2;
        assert_eq!((a_y_mps2.len(), a_y_mps2[0], a_y_mps2[5]), (200, 4.0, 5.0));

        let mut partly = samples();
        partly[3].imu = Some(ImuSample::default());
        let sequence = StateSequence::from_samples(&partly).unwrap();
        assert!(sequence.a_y_mps2.is_empty() && sequence.command_acceleration_mps2.is_empty());
    }
}
