//! The unit of work of the suite: a stretch of aligned telemetry in float32.

use crate::channels::{CHANNELS, Channel, Clock};
use crate::{DriveSample, NS_PER_S, PoseSample, SignalError, TelemetrySample};

macro_rules! sequence {
    ($($name:ident, $clock:ident, $required:literal, $kind:ident, $unit:literal, $meaning:literal;)*) => {
        /// A window of telemetry. Channels stand on the stamps of the odometry (`time_s`), of the commands (`command_time_s`) or of
        /// a localisation of its own (`pose_time_s`), see [`Clock`]; each is as long as its stamps, or empty where not recorded.
        ///
        /// float32 on purpose: it is what travels over the topic, and the offline command works on the same numbers, so both give the
        /// same Phi_p bit for bit. Times and positions are relative to the first sample, so that float32 is enough.
        #[derive(Debug, Clone, PartialEq, Default)]
        pub struct StateSequence {
            /// Names the sequence: the first stamp in nanoseconds; while its window grows, so many of it as were given out, too.
            pub sequence_id: u64,
            /// Stamp of the first sample.
            pub start_stamp_ns: i64,
            $(#[doc = concat!("`", $unit, "`: ", $meaning)] pub $name: Vec<f32>,)*
        }

        impl StateSequence {
            /// Every channel with its row of the table, in the table's order.
            #[must_use]
            pub fn table(&self) -> Vec<(&'static Channel, &[f32])> {
                CHANNELS.iter().zip([$(self.$name.as_slice()),*]).collect()
            }

            /// As [`Self::table`], to be changed.
            #[must_use]
            pub fn table_mut(&mut self) -> Vec<(&'static Channel, &mut Vec<f32>)> {
                CHANNELS.iter().zip([$(&mut self.$name),*]).collect()
            }
        }
    };
}

crate::for_each_channel!(sequence);

/// Commands before the first sample that a sequence carries: longer than any delay of a steering.
pub(crate) const HISTORY_S: f64 = 2.0;

/// Commands as they were received, in float64; each is in force from its stamp until the next.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Commands {
    /// Stamps since the first sample, negative before it.
    pub time_s: Vec<f64>,
    /// Steering angle, left positive.
    pub steering_rad: Vec<f64>,
    /// Speed; empty where the stack never used it.
    pub speed_mps: Vec<f64>,
    /// Acceleration; empty where the stack never used it.
    pub acceleration_mps2: Vec<f64>,
}

impl Commands {
    /// Place of the command in force at a time; `None` before the first.
    #[must_use]
    pub fn in_force(&self, time_s: f64) -> Option<usize> {
        self.time_s.partition_point(|&t| t <= time_s).checked_sub(1)
    }
}

/// Poses with stamps of their own, in float64.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Poses {
    /// Stamps since the first sample.
    pub time_s: Vec<f64>,
    /// Position.
    pub x_m: Vec<f64>,
    /// Position.
    pub y_m: Vec<f64>,
    /// Heading, unwrapped.
    pub yaw_rad: Vec<f64>,
}

fn wide(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&v| f64::from(v)).collect()
}

impl StateSequence {
    /// Makes a sequence of aligned samples; the commands are those that were in force at one of them.
    ///
    /// # Errors
    /// As [`Self::from_parts`].
    pub fn from_samples(samples: &[TelemetrySample]) -> Result<Self, SignalError> {
        let mut commands: Vec<DriveSample> = samples.iter().filter_map(|s| s.command).collect();
        commands.dedup_by_key(|c| c.stamp_ns);
        Self::from_parts(samples, &commands, &[])
    }

    /// Makes a sequence of aligned samples, the commands as received (in the order of their stamps; those from two seconds before the
    /// first sample to the last are taken) and the poses of a localisation of its own. An optional channel is kept where nearly every
    /// sample has it (a topic may start a moment late; the value next to it then stands in); commanded speed and acceleration where they
    /// are not zero throughout; a pose where it is not the same throughout. v_x, v_y and yaw rate that no topic carries are zero.
    ///
    /// # Errors
    /// [`SignalError::TooShort`] with fewer than two samples.
    pub fn from_parts(
        samples: &[TelemetrySample],
        commands: &[DriveSample],
        poses: &[PoseSample],
    ) -> Result<Self, SignalError> {
        let [first, _, ..] = samples else {
            return Err(SignalError::TooShort { what: "state sequence", got: samples.len(), needed: 2 });
        };
        let origin = first.odometry;
        let last_ns = samples[samples.len() - 1].odometry.stamp_ns;
        let channel =
            |f: &dyn Fn(&TelemetrySample) -> f64| samples.iter().map(|s| f(s) as f32).collect::<Vec<_>>();
        let known = |v: f64| if v.is_finite() { v } else { 0.0 };
        let optional = |f: &dyn Fn(&TelemetrySample) -> Option<f64>| {
            filled(samples.iter().map(|s| f(s).filter(|v| v.is_finite()).map(|v| v as f32)).collect())
        };
        let at = |stamp_ns: i64| ((stamp_ns - origin.stamp_ns) as f64 / NS_PER_S) as f32;
        let has_pose = |s: &&TelemetrySample| s.odometry.x_m.is_finite() && s.odometry.yaw_rad.is_finite();
        let start = samples.iter().find(has_pose).map_or(origin, |s| s.odometry);
        let posed = samples.iter().filter(has_pose).any(|s| {
            (s.odometry.x_m, s.odometry.y_m, s.odometry.yaw_rad) != (start.x_m, start.y_m, start.yaw_rad)
        });
        let pose = |f: &dyn Fn(&TelemetrySample) -> f64| {
            if posed { optional(&|s| Some(f(s))) } else { Vec::new() }
        };
        let from_ns = origin.stamp_ns.saturating_sub((HISTORY_S * NS_PER_S) as i64);
        let commands: Vec<&DriveSample> =
            commands.iter().filter(|c| (from_ns..=last_ns).contains(&c.stamp_ns)).collect();
        let in_force = commands.partition_point(|c| c.stamp_ns <= origin.stamp_ns).saturating_sub(1);
        // What comes by a topic of its own is taken from the sample that the command is first in force at.
        let first_at = |c: &DriveSample| {
            let place = samples.partition_point(|s| s.odometry.stamp_ns < c.stamp_ns);
            &samples[place.min(samples.len() - 1)].drive
        };
        let command = |f: &dyn Fn(&DriveSample) -> f64| {
            let value =
                |c: &DriveSample| Some(f(c)).filter(|v| v.is_finite()).unwrap_or_else(|| f(first_at(c)));
            let values: Vec<f32> = commands.iter().map(|c| value(c) as f32).collect();
            let is_used = values.iter().skip(in_force).any(|&v| v != 0.0);
            if is_used { values } else { Vec::new() }
        };
        let poses: Vec<&PoseSample> =
            poses.iter().filter(|p| (from_ns..=last_ns).contains(&p.stamp_ns)).collect();
        let place = |f: &dyn Fn(&PoseSample) -> f64| poses.iter().map(|p| f(p) as f32).collect::<Vec<_>>();
        let (map_x_m, map_y_m) = poses.first().map_or((0.0, 0.0), |p| (p.x_m, p.y_m));
        let wheel = |w: usize| optional(&|s| s.wheels.map(|x| x.speed[w]));
        let axle = |left: usize| optional(&|s| s.wheels?.effort_nm.map(|e| e[left] + e[left + 1]));
        Ok(Self {
            sequence_id: origin.stamp_ns as u64,
            start_stamp_ns: origin.stamp_ns,
            time_s: channel(&|s| (s.odometry.stamp_ns - origin.stamp_ns) as f64 / NS_PER_S),
            v_x_mps: channel(&|s| known(s.odometry.v_x_mps)),
            v_y_mps: channel(&|s| known(s.odometry.v_y_mps)),
            yaw_rate_radps: channel(&|s| known(s.odometry.yaw_rate_radps)),
            steering_rad: channel(&|s| s.drive.steering_angle_rad),
            measured_steering_rad: optional(&|s| s.measured_steering_rad),
            x_m: pose(&|s| s.odometry.x_m - start.x_m),
            y_m: pose(&|s| s.odometry.y_m - start.y_m),
            yaw_rad: unwrapped(pose(&|s| s.odometry.yaw_rad)),
            a_x_mps2: optional(&|s| s.imu.map(|i| i.a_x_mps2)),
            a_y_mps2: optional(&|s| s.imu.map(|i| i.a_y_mps2)),
            gyro_yaw_rate_radps: optional(&|s| s.imu.map(|i| i.yaw_rate_radps)),
            wheel_speed_fl_radps: wheel(0),
            wheel_speed_fr_radps: wheel(1),
            wheel_speed_rl_radps: wheel(2),
            wheel_speed_rr_radps: wheel(3),
            wheel_effort_front_nm: axle(0),
            wheel_effort_rear_nm: axle(2),
            command_time_s: commands.iter().map(|c| at(c.stamp_ns)).collect(),
            command_steering_rad: commands.iter().map(|c| c.steering_angle_rad as f32).collect(),
            command_speed_mps: command(&|c| c.speed_mps),
            command_acceleration_mps2: command(&|c| c.acceleration_mps2),
            pose_time_s: poses.iter().map(|p| at(p.stamp_ns)).collect(),
            pose_x_m: place(&|p| p.x_m - map_x_m),
            pose_y_m: place(&|p| p.y_m - map_y_m),
            pose_yaw_rad: unwrapped(place(&|p| p.yaw_rad)),
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

    /// Every channel with its name, `time_s` first.
    #[must_use]
    pub fn channels(&self) -> Vec<(&'static str, &[f32])> {
        self.table().into_iter().map(|(channel, values)| (channel.name, values)).collect()
    }

    /// The stamps of a clock.
    #[must_use]
    pub fn stamps_s(&self, clock: Clock) -> &[f32] {
        match clock {
            Clock::Samples => &self.time_s,
            Clock::Commands => &self.command_time_s,
            Clock::Poses => &self.pose_time_s,
        }
    }

    /// The commands as received; empty where only a measured angle is recorded.
    #[must_use]
    pub fn commands(&self) -> Commands {
        Commands {
            time_s: wide(&self.command_time_s),
            steering_rad: wide(&self.command_steering_rad),
            speed_mps: wide(&self.command_speed_mps),
            acceleration_mps2: wide(&self.command_acceleration_mps2),
        }
    }

    /// The poses with their own stamps: a localisation's where it has a topic of its own, else those that came with the odometry.
    #[must_use]
    pub fn poses(&self) -> Poses {
        let own = !self.pose_time_s.is_empty();
        let pick = |a: &[f32], b: &[f32]| wide(if own { a } else { b });
        let time_s = if self.yaw_rad.is_empty() { &[][..] } else { &self.time_s };
        Poses {
            time_s: pick(&self.pose_time_s, time_s),
            x_m: pick(&self.pose_x_m, &self.x_m),
            y_m: pick(&self.pose_y_m, &self.y_m),
            yaw_rad: pick(&self.pose_yaw_rad, &self.yaw_rad),
        }
    }

    /// Whether it is the beginning of a window that is not full yet.
    #[must_use]
    pub fn grows(&self) -> bool {
        const MOST: u64 = 1000;
        (1..=MOST).contains(&self.sequence_id.wrapping_sub(self.start_stamp_ns as u64))
    }

    /// Whether something measures v_y: it is not zero throughout.
    #[must_use]
    pub fn has_v_y(&self) -> bool {
        self.v_y_mps.iter().any(|&v| v != 0.0)
    }

    /// Leaves out the samples (not the commands and poses) for which `keep` says no; stamps stay.
    pub fn retain(&mut self, keep: impl Fn(usize) -> bool) {
        for (channel, values) in self.table_mut() {
            if channel.clock == Clock::Samples {
                let mut place = 0..;
                values.retain(|_| place.next().is_some_and(&keep));
            }
        }
    }

    /// Checks what came from outside: lengths, order of time, finite values.
    ///
    /// # Errors
    /// The first thing wrong, with its channel and place.
    pub fn check(&self) -> Result<(), SignalError> {
        if self.len() < 2 {
            return Err(SignalError::TooShort { what: "state sequence", got: self.len(), needed: 2 });
        }
        for (&Channel { name, required, clock, .. }, values) in self.table() {
            let stamps_s = self.stamps_s(clock);
            if values.len() != stamps_s.len() && (required || !values.is_empty()) {
                return Err(SignalError::ChannelLength {
                    channel: name,
                    got: values.len(),
                    expected: stamps_s.len(),
                });
            }
            if let Some(index) = values.iter().position(|v| !v.is_finite()) {
                return Err(SignalError::NotFinite {
                    topic: "sequence",
                    field: name,
                    value: f64::from(values[index]),
                    stamp_s: f64::from(stamps_s[index]),
                    index,
                });
            }
        }
        for clock in Clock::ALL {
            let stamps_s = self.stamps_s(clock);
            // Two commands may be closer than float32 tells apart; the later one is in force then.
            let in_order = |a: f32, b: f32| if clock == Clock::Samples { a < b } else { a <= b };
            if let Some(k) = stamps_s.windows(2).position(|w| !in_order(w[0], w[1])) {
                return Err(SignalError::StampWentBack {
                    topic: "sequence",
                    index: k + 1,
                    stamp_s: f64::from(stamps_s[k + 1]),
                    back_s: f64::from(stamps_s[k] - stamps_s[k + 1]),
                });
            }
        }
        Ok(())
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
        assert_eq!((sequence.wheel_effort_front_nm[0], sequence.wheel_effort_rear_nm[0]), (3.0, 7.0));
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
