//! Puts several streams on the stamps of the odometry.
//!
//! The rule, on stamps alone (arrival time never counts, so live and offline agree): the drive command is held from its stamp
//! until the next (that is what an actuator does); inertial unit and wheels are interpolated linearly between neighbours. A
//! sample is given out once every stream seen has reached its stamp, or any stream is `patience_s` ahead of it.

use std::collections::VecDeque;

use crate::{
    DriveSample, ImuSample, Measurement, NS_PER_S, OdometrySample, SignalError, TelemetrySample, WheelsSample,
};

/// Settings of the [`Aligner`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlignConfig {
    /// How far the newest stamp may run ahead before a missing neighbour is no longer waited for.
    pub patience_s: f64,
    /// A drive command older than this is not held any longer: the samples are left out, and counted.
    pub max_hold_s: f64,
}

impl Default for AlignConfig {
    fn default() -> Self {
        Self { patience_s: 0.2, max_hold_s: 0.5 }
    }
}

/// Joins the streams. See the module's text for the rule.
#[derive(Debug, Clone)]
pub struct Aligner {
    config: AlignConfig,
    odometry: VecDeque<OdometrySample>,
    drive: VecDeque<DriveSample>,
    imu: VecDeque<ImuSample>,
    wheels: VecDeque<WheelsSample>,
    newest_ns: [Option<i64>; 4],
    count: [usize; 4],
    without_drive: usize,
    duplicates: usize,
}

impl Aligner {
    /// An empty aligner.
    #[must_use]
    pub fn new(config: AlignConfig) -> Self {
        Self {
            config,
            odometry: VecDeque::new(),
            drive: VecDeque::new(),
            imu: VecDeque::new(),
            wheels: VecDeque::new(),
            newest_ns: [None; 4],
            count: [0; 4],
            without_drive: 0,
            duplicates: 0,
        }
    }

    /// Takes one message. Messages of one stream come in the order of their stamps; streams may interleave in any way. A second
    /// message with the stamp of the one before is left out and counted.
    ///
    /// # Errors
    /// [`SignalError::NotFinite`] and [`SignalError::StampWentBack`]; the message is not taken then.
    pub fn push(&mut self, message: Measurement) -> Result<(), SignalError> {
        let stream = message.stream_index();
        let index = self.count[stream];
        let stamp_ns = message.stamp_ns();
        message.check_finite(index)?;
        if let Some(newest_ns) = self.newest_ns[stream] {
            if stamp_ns < newest_ns {
                return Err(SignalError::StampWentBack {
                    topic: message.stream(),
                    index,
                    stamp_s: stamp_ns as f64 / NS_PER_S,
                    back_s: (newest_ns - stamp_ns) as f64 / NS_PER_S,
                });
            }
            if stamp_ns == newest_ns {
                self.count[stream] += 1;
                self.duplicates += 1;
                return Ok(());
            }
        }
        self.count[stream] += 1;
        self.newest_ns[stream] = Some(stamp_ns);
        match message {
            Measurement::Odometry(m) => self.odometry.push_back(m),
            Measurement::Drive(m) => self.drive.push_back(m),
            Measurement::Imu(m) => self.imu.push_back(m),
            Measurement::Wheels(m) => self.wheels.push_back(m),
        }
        Ok(())
    }

    /// The next aligned sample that no later message can change.
    pub fn poll(&mut self) -> Option<TelemetrySample> {
        self.next(false)
    }

    /// The next aligned sample at the end of the data: nothing is waited for.
    pub fn drain(&mut self) -> Option<TelemetrySample> {
        self.next(true)
    }

    /// Messages taken so far, by stream: odometry, drive, inertial unit, wheels.
    #[must_use]
    pub fn counts(&self) -> [usize; 4] {
        self.count
    }

    /// Odometry left out because no drive command was in force.
    #[must_use]
    pub fn without_drive(&self) -> usize {
        self.without_drive
    }

    /// Messages left out because their stamp stood there already.
    #[must_use]
    pub fn duplicates(&self) -> usize {
        self.duplicates
    }

    fn next(&mut self, at_end: bool) -> Option<TelemetrySample> {
        loop {
            let odometry = *self.odometry.front()?;
            let t_ns = odometry.stamp_ns;
            let newest_ns = self.newest_ns.iter().flatten().copied().max()?;
            let impatient = (newest_ns - t_ns) as f64 / NS_PER_S > self.config.patience_s;
            // The drive stream is waited for even before its first message; the optional ones only once seen.
            let waiting = self.newest_ns[1].is_none_or(|n| n < t_ns)
                || self.newest_ns[2..].iter().flatten().any(|&n| n < t_ns);
            if waiting && !impatient && !at_end {
                return None;
            }
            self.odometry.pop_front();
            drop_before(&mut self.drive, t_ns, |m| m.stamp_ns);
            drop_before(&mut self.imu, t_ns, |m| m.stamp_ns);
            drop_before(&mut self.wheels, t_ns, |m| m.stamp_ns);
            let held = self.drive.front().filter(|d| {
                d.stamp_ns <= t_ns && (t_ns - d.stamp_ns) as f64 / NS_PER_S <= self.config.max_hold_s
            });
            let Some(&drive) = held else {
                self.without_drive += 1;
                continue;
            };
            let imu = neighbours(&self.imu, t_ns, |m| m.stamp_ns).map(|(a, b, w)| ImuSample {
                stamp_ns: t_ns,
                a_x_mps2: mix(a.a_x_mps2, b.a_x_mps2, w),
                a_y_mps2: mix(a.a_y_mps2, b.a_y_mps2, w),
                yaw_rate_radps: mix(a.yaw_rate_radps, b.yaw_rate_radps, w),
            });
            let wheels = neighbours(&self.wheels, t_ns, |m| m.stamp_ns).map(|(a, b, w)| WheelsSample {
                stamp_ns: t_ns,
                speed: std::array::from_fn(|i| mix(a.speed[i], b.speed[i], w)),
                effort_nm: a
                    .effort_nm
                    .zip(b.effort_nm)
                    .map(|(a, b)| std::array::from_fn(|i| mix(a[i], b[i], w))),
            });
            return Some(TelemetrySample { odometry, drive, imu, wheels });
        }
    }
}

/// Forgets all but the last message at or before `t_ns`, and everything after stays.
fn drop_before<T>(queue: &mut VecDeque<T>, t_ns: i64, stamp: impl Fn(&T) -> i64) {
    while queue.len() > 1 && stamp(&queue[1]) <= t_ns {
        queue.pop_front();
    }
}

/// The messages around `t_ns` and the weight of the later one; a lone neighbour stands for both.
fn neighbours<T: Copy>(queue: &VecDeque<T>, t_ns: i64, stamp: impl Fn(&T) -> i64) -> Option<(T, T, f64)> {
    let first = *queue.front()?;
    match queue.get(1) {
        Some(&second) if stamp(&first) <= t_ns => {
            let span_ns = (stamp(&second) - stamp(&first)) as f64;
            Some((first, second, (t_ns - stamp(&first)) as f64 / span_ns))
        }
        _ => Some((first, first, 0.0)),
    }
}

fn mix(a: f64, b: f64, weight: f64) -> f64 {
    a + (b - a) * weight
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn odometry(t_ms: i64) -> Measurement {
        Measurement::Odometry(OdometrySample {
            stamp_ns: t_ms * 1_000_000,
            v_x_mps: 1.0,
            ..Default::default()
        })
    }

    fn drive(t_ms: i64, steering_angle_rad: f64) -> Measurement {
        Measurement::Drive(DriveSample {
            stamp_ns: t_ms * 1_000_000,
            steering_angle_rad,
            ..Default::default()
        })
    }

    fn imu(t_ms: i64, a_y_mps2: f64) -> Measurement {
        Measurement::Imu(ImuSample { stamp_ns: t_ms * 1_000_000, a_y_mps2, ..Default::default() })
    }

    fn all(messages: &[Measurement]) -> Vec<TelemetrySample> {
        let mut aligner = Aligner::new(AlignConfig::default());
        let mut out = Vec::new();
        for &m in messages {
            aligner.push(m).unwrap();
            out.extend(std::iter::from_fn(|| aligner.poll()));
        }
        out.extend(std::iter::from_fn(|| aligner.drain()));
        out
    }

    #[test]
    fn holds_the_command_and_interpolates_the_sensor() {
        let out = all(&[
            drive(0, 0.1),
            imu(0, 0.0),
            odometry(5),
            odometry(15),
            imu(10, 1.0),
            drive(10, 0.2),
            imu(20, 3.0),
            drive(20, 0.3),
        ]);
        assert_eq!(out.len(), 2);
        assert_eq!(out[0].drive.steering_angle_rad, 0.1);
        assert_eq!(out[1].drive.steering_angle_rad, 0.2);
        approx::assert_relative_eq!(out[0].imu.unwrap().a_y_mps2, 0.5);
        approx::assert_relative_eq!(out[1].imu.unwrap().a_y_mps2, 2.0);
    }

    #[test]
    fn a_stale_command_is_not_held() {
        let out = all(&[drive(0, 0.1), odometry(100), odometry(700), drive(800, 0.2), odometry(810)]);
        assert_eq!(out.iter().map(|s| s.odometry.stamp_ns / 1_000_000).collect::<Vec<_>>(), [100, 810]);
    }

    #[test]
    fn bad_messages_are_named() {
        let mut aligner = Aligner::new(AlignConfig::default());
        aligner.push(odometry(20)).unwrap();
        let back = aligner.push(odometry(10)).unwrap_err();
        assert!(matches!(back, SignalError::StampWentBack { topic: "odom", index: 1, .. }), "{back}");
        let nan = aligner.push(drive(20, f64::NAN)).unwrap_err();
        assert!(
            matches!(nan, SignalError::NotFinite { topic: "drive", field: "steering_angle_rad", .. }),
            "{nan}"
        );
    }

    proptest! {
        /// Arrival order does not matter as long as nothing is late by more than the patience.
        #[test]
        fn interleaving_does_not_matter(swaps in prop::collection::vec(0usize..90, 0..60)) {
            let mut messages: Vec<_> =
                (0..30).flat_map(|k| [odometry(10 * k), drive(10 * k - 3, k as f64), imu(10 * k + 4, k as f64)]).collect();
            messages.insert(0, drive(-10, 0.0));
            let expected = all(&messages);
            for i in swaps {
                if i + 1 < messages.len() && messages[i].stream() != messages[i + 1].stream() && i > 3 {
                    messages.swap(i, i + 1);
                }
            }
            prop_assert_eq!(all(&messages), expected);
        }
    }
}
