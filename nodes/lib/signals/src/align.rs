//! Puts several streams on the stamps of one of them, the clock: the stream that carries the forward speed.
//!
//! The rule, on stamps alone (arrival time never counts, so live and offline agree): a command is held from its stamp until the
//! next (that is what an actuator does); what is measured is interpolated linearly between neighbours. A sample is given out
//! once every stream seen has reached its stamp, or any stream is `patience_s` ahead of it.
//!
//! A bad message costs itself: not finite, a stamp before the one before it or far after it. Only where two messages of a stream in a
//! row lie back by more than a second, in order, the clock itself was set back, and everything starts over; and a stamp far ahead counts once a second message
//! confirms it: what is believed of one wrong stamp costs all messages up to it.

use std::collections::VecDeque;

use crate::layout::Layout;
use crate::measurement::TYPED_STREAMS;
use crate::signal::Join;
use crate::{
    DriveSample, ImuSample, Measurement, NS_PER_S, OdometrySample, PoseSample, Signal, SignalError,
    TelemetrySample, Values, WheelsSample,
};

/// Settings of the [`Aligner`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlignConfig {
    /// How far the newest stamp may run ahead before a missing neighbour is no longer waited for.
    pub patience_s: f64,
    /// A drive command older than this is not held any longer: the samples are left out, and counted. The same for a speed or a measured
    /// steering whose neighbours are further away.
    pub max_hold_s: f64,
}

impl Default for AlignConfig {
    fn default() -> Self {
        Self { patience_s: 0.2, max_hold_s: 0.5 }
    }
}

/// Two messages in a row that lie back further than this mean that the clock was set back.
const CLOCK_JUMP_S: f64 = 1.0;
/// A stamp further ahead than this, and than so many steps of its stream, is believed once another message confirms it.
const AHEAD_S: f64 = 0.5;
const AHEAD_STEPS: f64 = 3.0;

/// What became of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pushed {
    /// It was taken, or waits for a message that confirms its stamp.
    Taken,
    /// Its stamp stood there already: left out, and counted.
    Duplicate,
    /// The clock was set back: everything from before is forgotten.
    ClockJumped,
}

#[derive(Debug, Clone, Copy)]
struct Row {
    stamp_ns: i64,
    values: Values,
}

#[derive(Debug, Clone, Default)]
struct Stream {
    rows: VecDeque<Row>,
    newest_ns: Option<i64>,
    /// From the message before the newest to it.
    step_s: f64,
    count: usize,
    /// A message whose stamp lies far ahead, or far back: to be confirmed by the next.
    ahead: Option<Row>,
    behind: Option<Row>,
}

/// Joins the streams. See the module's text for the rule.
#[derive(Debug, Clone)]
pub struct Aligner {
    config: AlignConfig,
    layout: Layout,
    streams: Vec<Stream>,
    without_drive: usize,
    duplicates: usize,
    stray: usize,
    kept: Option<Kept>,
}

/// Commands and poses as they were taken, for whoever wants them on their own stamps.
#[derive(Debug, Clone, Default)]
pub(crate) struct Kept {
    pub(crate) commands: Vec<DriveSample>,
    pub(crate) poses: Vec<PoseSample>,
}

impl Aligner {
    /// An empty aligner of odometry, drive commands, inertial unit and wheels.
    #[must_use]
    pub fn new(config: AlignConfig) -> Self {
        Self::with_layout(config, Layout::default())
    }

    /// An empty aligner of whatever a topics file maps.
    #[must_use]
    pub fn with_layout(config: AlignConfig, layout: Layout) -> Self {
        Self {
            config,
            layout,
            streams: vec![Stream::default(); TYPED_STREAMS],
            without_drive: 0,
            duplicates: 0,
            stray: 0,
            kept: None,
        }
    }

    /// Keeps commands and poses for [`Self::take_kept`].
    pub(crate) fn keeping(mut self) -> Self {
        self.kept = Some(Kept::default());
        self
    }

    /// Commands and poses taken since the last time.
    pub(crate) fn take_kept(&mut self) -> Kept {
        self.kept.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Takes one message. Messages of one stream come in the order of their stamps; streams may interleave in any way. A second
    /// message with the stamp of the one before is left out and counted.
    ///
    /// # Errors
    /// [`SignalError::NotFinite`] and [`SignalError::StampWentBack`]; the message is not taken then, and all goes on.
    pub fn push(&mut self, message: Measurement) -> Result<Pushed, SignalError> {
        let place = message.stream_index();
        if place >= self.streams.len() {
            self.streams.resize_with(place + 1, Stream::default);
        }
        message.check_finite(self.streams[place].count)?;
        let row = Row { stamp_ns: message.stamp_ns(), values: message.values() };
        let stream = &mut self.streams[place];
        let Some(newest_ns) = stream.newest_ns else {
            self.take(place, row);
            return Ok(Pushed::Taken);
        };
        let since_s = row.stamp_ns.saturating_sub(newest_ns) as f64 / NS_PER_S;
        if since_s == 0.0 {
            stream.count += 1;
            self.duplicates += 1;
            return Ok(Pushed::Duplicate);
        }
        if since_s < 0.0 {
            return self.went_back(place, row, -since_s, message.stream());
        }
        stream.behind = None;
        let ahead = stream.ahead.take();
        if since_s > AHEAD_S.max(AHEAD_STEPS * stream.step_s) {
            match ahead {
                Some(first) if first.stamp_ns < row.stamp_ns => self.take(place, first),
                unconfirmed => {
                    self.stray += usize::from(unconfirmed.is_some());
                    stream.ahead = Some(row);
                    return Ok(Pushed::Taken);
                }
            }
        } else {
            self.stray += usize::from(ahead.is_some());
        }
        self.take(place, row);
        Ok(Pushed::Taken)
    }

    /// The next aligned sample that no later message can change.
    pub fn poll(&mut self) -> Option<TelemetrySample> {
        self.next(false)
    }

    /// The next aligned sample at the end of the data: nothing is waited for.
    pub fn drain(&mut self) -> Option<TelemetrySample> {
        self.next(true)
    }

    /// Messages taken so far of odometry, drive, inertial unit and wheels.
    #[must_use]
    pub fn counts(&self) -> [usize; TYPED_STREAMS] {
        std::array::from_fn(|place| self.count(place))
    }

    /// Messages taken so far of a stream, by [`Measurement::stream_index`].
    #[must_use]
    pub fn count(&self, stream: usize) -> usize {
        self.streams.get(stream).map_or(0, |s| s.count)
    }

    /// Samples left out because no drive command (or speed, or measured steering) was in force.
    #[must_use]
    pub fn without_drive(&self) -> usize {
        self.without_drive
    }

    /// Messages left out because their stamp stood there already.
    #[must_use]
    pub fn duplicates(&self) -> usize {
        self.duplicates
    }

    /// Messages left out because their stamp lay far ahead and the next one's did not.
    #[must_use]
    pub fn stray(&self) -> usize {
        self.stray
    }

    fn take(&mut self, place: usize, row: Row) {
        let stream = &mut self.streams[place];
        stream.count += 1;
        let since_ns = |newest_ns| row.stamp_ns.saturating_sub(newest_ns);
        stream.step_s = stream.newest_ns.map_or(0.0, |newest_ns| since_ns(newest_ns) as f64 / NS_PER_S);
        stream.newest_ns = Some(row.stamp_ns);
        stream.rows.push_back(row);
        let Some(kept) = &mut self.kept else { return };
        if self.layout.source(Signal::Steering) == Some(place) {
            kept.commands.push(command(&row));
        }
        if self.layout.own_pose() == Some(place) {
            let [x_m, y_m, yaw_rad] = Signal::POSE.map(|signal| row.values.get(signal));
            if [x_m, y_m, yaw_rad].iter().all(|v| v.is_finite()) {
                kept.poses.push(PoseSample { stamp_ns: row.stamp_ns, x_m, y_m, yaw_rad });
            }
        }
    }

    fn went_back(
        &mut self,
        place: usize,
        row: Row,
        back_s: f64,
        topic: &'static str,
    ) -> Result<Pushed, SignalError> {
        let stream = &mut self.streams[place];
        if back_s > CLOCK_JUMP_S {
            match stream.behind.replace(row) {
                Some(first) if first.stamp_ns < row.stamp_ns => {
                    stream.behind = Some(first);
                    self.start_over();
                    self.take(place, row);
                    return Ok(Pushed::ClockJumped);
                }
                _ => {}
            }
        }
        let stamp_s = row.stamp_ns as f64 / NS_PER_S;
        Err(SignalError::StampWentBack { topic, index: self.streams[place].count, stamp_s, back_s })
    }

    /// Forgets all but the messages that lie back already: they belong to what begins.
    fn start_over(&mut self) {
        self.kept.iter_mut().for_each(|kept| *kept = Kept::default());
        for place in 0..self.streams.len() {
            let stream = &mut self.streams[place];
            let first = stream.behind.take();
            *stream = Stream { count: stream.count, ..Stream::default() };
            if let Some(row) = first {
                self.take(place, row);
            }
        }
    }

    fn next(&mut self, at_end: bool) -> Option<TelemetrySample> {
        let clock = self.layout.clock();
        loop {
            let &Row { stamp_ns: t_ns, values: at_clock } = self.streams.get(clock)?.rows.front()?;
            let newest_ns = self.streams.iter().filter_map(|s| s.newest_ns).max()?;
            let impatient = (newest_ns - t_ns) as f64 / NS_PER_S > self.config.patience_s;
            let behind = |place: usize| self.streams.get(place).and_then(|s| s.newest_ns).map(|n| n < t_ns);
            // What is needed is waited for even before its first message; the optional streams only once seen.
            let waiting = self.layout.needed().any(|place| behind(place).unwrap_or(true))
                || (0..self.streams.len()).any(|place| place != clock && behind(place) == Some(true));
            if waiting && !impatient && !at_end {
                return None;
            }
            for (place, stream) in self.streams.iter_mut().enumerate() {
                if place != clock {
                    drop_before(&mut stream.rows, t_ns);
                }
            }
            self.streams[clock].rows.pop_front();
            match self.joined(t_ns, &at_clock, clock) {
                Some(sample) => return Some(sample),
                None => self.without_drive += 1,
            }
        }
    }

    /// The sample at one stamp of the clock; `None` where something that is needed is too far away.
    fn joined(&self, t_ns: i64, at_clock: &Values, clock: usize) -> Option<TelemetrySample> {
        let near = |stamp_ns: i64| ((t_ns - stamp_ns) as f64 / NS_PER_S).abs() <= self.config.max_hold_s;
        let around = |signal: Signal| {
            let place = self.layout.source(signal)?;
            neighbours(&self.streams.get(place)?.rows, t_ns)
        };
        let interpolated = |signal: Signal| -> f64 {
            if self.layout.source(signal) == Some(clock) {
                return at_clock.get(signal);
            }
            let Some((a, b, weight)) = around(signal) else { return f64::NAN };
            match (a.values.get(signal), b.values.get(signal)) {
                (a, b) if a.is_nan() => b,
                (a, b) if b.is_nan() => a,
                (a, b) if signal.join() == Join::Angle => a + turned_rad(b - a) * weight,
                (a, b) => mix(a, b, weight),
            }
        };
        // Of a signal without which there is no sample: near, or not mapped at all (then it is not a number).
        let needed = |signal: Signal| {
            let Some(place) = self.layout.source(signal) else { return Some(f64::NAN) };
            let is_near = place == clock
                || around(signal).is_some_and(|(a, b, _)| near(a.stamp_ns) || near(b.stamp_ns));
            Some(interpolated(signal)).filter(|v| is_near && v.is_finite())
        };
        let this = Row { stamp_ns: t_ns, values: *at_clock };
        let held = |signal: Signal| {
            let place = self.layout.source(signal)?;
            let row = if place == clock { &this } else { self.streams.get(place)?.rows.front()? };
            Some(*row).filter(|row| row.stamp_ns <= t_ns && near(row.stamp_ns))
        };
        let commanded = self.layout.source(Signal::Steering).is_some();
        let command = if commanded { Some(command(&held(Signal::Steering)?)) } else { None };
        let measured =
            self.layout.source(Signal::MeasuredSteering).map(|_| interpolated(Signal::MeasuredSteering));
        let mut drive = match command {
            Some(command) => command,
            None => DriveSample {
                stamp_ns: t_ns,
                steering_angle_rad: needed(Signal::MeasuredSteering).filter(|v| v.is_finite())?,
                speed_mps: f64::NAN,
                acceleration_mps2: f64::NAN,
            },
        };
        // Either may come by a topic of its own, or not at all.
        for (signal, field) in [
            (Signal::SpeedCommand, &mut drive.speed_mps),
            (Signal::AccelerationCommand, &mut drive.acceleration_mps2),
        ] {
            if !field.is_finite() {
                let value = held(signal).map_or(f64::NAN, |row| row.values.get(signal));
                *field = if value.is_finite() { value } else { 0.0 };
            }
        }
        let odometry = OdometrySample {
            stamp_ns: t_ns,
            x_m: interpolated(Signal::X),
            y_m: interpolated(Signal::Y),
            yaw_rad: interpolated(Signal::Heading),
            v_x_mps: needed(Signal::ForwardSpeed)?,
            v_y_mps: needed(Signal::LateralSpeed)?,
            yaw_rate_radps: needed(Signal::YawRate)?,
        };
        let imu = ImuSample {
            stamp_ns: t_ns,
            a_x_mps2: interpolated(Signal::ForwardAcceleration),
            a_y_mps2: interpolated(Signal::LateralAcceleration),
            yaw_rate_radps: interpolated(Signal::Gyro),
        };
        let speed = Signal::WHEEL_SPEEDS.map(interpolated);
        let effort_nm = Signal::WHEEL_EFFORTS.map(interpolated);
        let any = |values: &[f64]| values.iter().any(|v| v.is_finite());
        Some(TelemetrySample {
            odometry,
            drive,
            command: command.map(|command| DriveSample { stamp_ns: command.stamp_ns, ..drive }),
            measured_steering_rad: measured.filter(|v| v.is_finite()),
            imu: Some(imu).filter(|i| any(&[i.a_x_mps2, i.a_y_mps2, i.yaw_rate_radps])),
            wheels: Some(WheelsSample {
                stamp_ns: t_ns,
                speed,
                effort_nm: Some(effort_nm).filter(|e| e.iter().all(|v| v.is_finite())),
            })
            .filter(|_| any(&speed)),
        })
    }
}

/// A row of the stream that carries the steering command; what it does not carry is NaN.
fn command(row: &Row) -> DriveSample {
    DriveSample {
        stamp_ns: row.stamp_ns,
        steering_angle_rad: row.values.get(Signal::Steering),
        speed_mps: row.values.get(Signal::SpeedCommand),
        acceleration_mps2: row.values.get(Signal::AccelerationCommand),
    }
}

/// Forgets all but the last message at or before `t_ns`, and everything after stays.
fn drop_before(rows: &mut VecDeque<Row>, t_ns: i64) {
    while rows.len() > 1 && rows[1].stamp_ns <= t_ns {
        rows.pop_front();
    }
}

/// The messages around `t_ns` and the weight of the later one; a lone neighbour stands for both.
fn neighbours(rows: &VecDeque<Row>, t_ns: i64) -> Option<(Row, Row, f64)> {
    let first = *rows.front()?;
    match rows.get(1) {
        Some(&second) if first.stamp_ns <= t_ns => {
            let span_ns = (second.stamp_ns - first.stamp_ns) as f64;
            Some((first, second, (t_ns - first.stamp_ns) as f64 / span_ns))
        }
        _ => Some((first, first, 0.0)),
    }
}

fn mix(a: f64, b: f64, weight: f64) -> f64 {
    a + (b - a) * weight
}

/// An angle in [-pi, pi].
fn turned_rad(angle_rad: f64) -> f64 {
    angle_rad - std::f64::consts::TAU * (angle_rad / std::f64::consts::TAU).round()
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
        let commands = [drive(0, 0.1), drive(800, 0.2), drive(805, 0.2)];
        let [first, second, third] = commands;
        let out = all(&[first, odometry(100), odometry(400), odometry(700), second, third, odometry(810)]);
        assert_eq!(out.iter().map(|s| s.odometry.stamp_ns / 1_000_000).collect::<Vec<_>>(), [100, 400, 810]);
    }

    #[test]
    fn one_stamp_seconds_ahead_does_not_cost_the_messages_up_to_it_and_a_slow_stream_costs_nothing() {
        let mut messages: Vec<_> = (0..100).flat_map(|k| [drive(10 * k, 0.1), odometry(10 * k)]).collect();
        messages.insert(40, drive(3_000, 0.3));
        let out = all(&messages);
        assert_eq!(out.len(), 100);
        assert!(out.iter().all(|s| s.drive.steering_angle_rad == 0.1));
        let slow: Vec<_> = (0..6).flat_map(|k| [drive(1000 * k - 100, 0.1), odometry(1000 * k)]).collect();
        assert_eq!(all(&slow).len(), 6);
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
        // A bit of an exponent: no float32 holds it, and the window would be lost.
        let Measurement::Odometry(far) = odometry(30) else { panic!() };
        let far = aligner.push(Measurement::Odometry(OdometrySample { x_m: -1e200, ..far })).unwrap_err();
        assert!(matches!(far, SignalError::NotFinite { topic: "odom", field: "x_m", .. }), "{far}");
    }

    #[test]
    fn a_single_stamp_far_off_costs_itself_and_two_in_order_are_a_new_clock() {
        let mut aligner = Aligner::new(AlignConfig::default());
        let mut push = |m| aligner.push(m);
        for t_ms in [10_000, 10_010] {
            push(odometry(t_ms)).unwrap();
            push(drive(t_ms, 0.1)).unwrap();
        }
        assert_eq!(push(odometry(90_000)), Ok(Pushed::Taken));
        assert!(push(odometry(0)).is_err(), "a stamp that was never set");
        assert_eq!(push(odometry(10_020)), Ok(Pushed::Taken));
        assert!(push(odometry(5_000)).is_err());
        assert!(push(odometry(4_000)).is_err(), "further back: no clock that runs");
        assert!(push(drive(4_005, 0.2)).is_err());
        assert_eq!(push(odometry(4_010)), Ok(Pushed::ClockJumped));
        assert_eq!(push(drive(4_015, 0.3)), Ok(Pushed::Taken));
        let given: Vec<_> = std::iter::from_fn(|| aligner.drain()).collect();
        let stamps: Vec<_> = given.iter().map(|s| s.odometry.stamp_ns / 1_000_000).collect();
        assert_eq!((stamps, aligner.stray(), aligner.without_drive()), (vec![4_010], 1, 1));
        assert_eq!(given[0].drive.steering_angle_rad, 0.2);
    }

    #[test]
    fn a_pause_of_the_recording_is_believed_at_its_second_message() {
        let mut messages: Vec<_> =
            [0, 10, 20_000, 20_010].into_iter().flat_map(|t| [drive(t, 0.1), odometry(t)]).collect();
        assert_eq!(all(&messages).len(), 4);
        messages.truncate(6);
        assert_eq!(all(&messages).len(), 2);
    }

    #[test]
    fn signals_of_other_topics_are_joined_by_their_own_rule() {
        use crate::MappedSample;
        let mapped = |topic: u8, t_ms: i64, values: &[(Signal, f64)]| {
            Measurement::Mapped(MappedSample {
                topic,
                stamp_ns: t_ms * 1_000_000,
                values: values.iter().copied().collect(),
            })
        };
        let layout = Layout::mapped(&[
            vec![Signal::ForwardSpeed],
            vec![Signal::Gyro, Signal::YawRate],
            vec![Signal::MeasuredSteering],
            vec![Signal::X, Signal::Y, Signal::Heading],
        ]);
        let mut aligner = Aligner::with_layout(AlignConfig::default(), layout).keeping();
        for t in [0, 10, 20] {
            aligner.push(mapped(0, t, &[(Signal::ForwardSpeed, 3.0)])).unwrap();
        }
        for (t, w) in [(5, 1.0), (15, 2.0), (25, 3.0)] {
            aligner.push(mapped(1, t, &[(Signal::Gyro, w), (Signal::YawRate, w)])).unwrap();
            aligner.push(mapped(2, t, &[(Signal::MeasuredSteering, 0.1 * w)])).unwrap();
        }
        let pose = |t, yaw| mapped(3, t, &[(Signal::X, 1.0), (Signal::Y, 2.0), (Signal::Heading, yaw)]);
        aligner.push(pose(0, 3.1)).unwrap();
        aligner.push(pose(20, -3.1)).unwrap();
        let samples: Vec<_> = std::iter::from_fn(|| aligner.drain()).collect();
        assert_eq!(samples.len(), 3);
        let middle = samples[1];
        approx::assert_relative_eq!(middle.odometry.yaw_rate_radps, 1.5);
        approx::assert_relative_eq!(middle.drive.steering_angle_rad, 0.15);
        approx::assert_relative_eq!(middle.odometry.yaw_rad, std::f64::consts::PI, epsilon = 1e-12);
        assert!(middle.odometry.v_y_mps.is_nan() && middle.command.is_none() && middle.wheels.is_none());
        assert_eq!(aligner.take_kept().poses.len(), 2);
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
