//! Applies known effects to a recorded bag: everything else in it stays, byte for byte.

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;

use gripsight_msgs::Message;
use gripsight_msgs::standard::ackermann_msgs::AckermannDriveStamped;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::sensor_msgs::Imu;
use gripsight_signals::{DriveSample, ImuSample, Measurement, OdometrySample};

use crate::effect::{Effect, Series};
use crate::recover::refuse_overwriting;
use crate::{
    Bag, BagError, BagWriter, RawMessage, Role, Streams, TopicMap, decode, encode, from_cdr, to_cdr,
};

/// Writes to `out` the bag as it would be had the effects been there, in the order given. Messages of other topics, and all
/// fields that an effect does not touch, stay as they are; the log stays in the order of log times where a delay moves commands.
/// Gives the number of messages changed.
///
/// # Errors
/// [`BagError`]; a truncated bag is refused, as is an effect on a stream that is not recorded, or a bag of recorded sequences.
pub fn inject(bag: &Path, topics: &TopicMap, effects: &[Effect], out: &Path) -> Result<u64, BagError> {
    let bag = Bag::open(bag)?;
    refuse_overwriting(bag.path(), out)?;
    if let Some(topic) = topics.resolve_sequence(&bag)? {
        let why = format!("{topic} holds sequences that are cut already; inject into the recording itself");
        return Err(BagError::Effect {
            given: effects.iter().map(Effect::name).collect::<Vec<_>>().join(", "),
            why,
        });
    }
    let streams = topics.resolve(&bag)?;
    for effect in effects {
        let role = effect.stream();
        if streams.topic(role).is_none() {
            let why = format!("the bag holds no {} ({})", role.name(), role.type_name());
            return Err(BagError::Effect { given: effect.name().to_owned(), why });
        }
    }
    let recorded = read_series(&bag, &streams)?;
    let mut changed = recorded.clone();
    effects.iter().for_each(|effect| effect.apply(&mut changed));
    let late_ns = recorded.drive.iter().zip(&changed.drive).map(|(a, b)| a.stamp_ns - b.stamp_ns);
    let mut log = SortedLog::new(BagWriter::create(out)?, late_ns.max().unwrap_or(0).unsigned_abs());
    let mut patches = Patches::new(&recorded, &changed);
    let mut count = 0;
    for message in bag.messages() {
        let mut message = message?;
        if let Some(role) = streams.role(&message.channel.topic) {
            count += u64::from(patches.apply(role, &mut message)?);
        }
        log.push(message)?;
    }
    log.finish()?;
    Ok(count)
}

/// The telemetry that effects act on.
fn read_series(bag: &Bag, streams: &Streams) -> Result<Series, BagError> {
    let mut series = Series::default();
    let mut counts = [0; 4];
    for message in bag.messages() {
        let message = message?;
        let topic = &message.channel.topic;
        let Some(role) = streams.role(topic) else { continue };
        let index = counts[role as usize];
        counts[role as usize] += 1;
        let measurement = decode::measurement(role, &message.data)
            .map_err(|error| error.in_message(topic, index, message.log_time))?;
        match measurement {
            Some(Measurement::Odometry(m)) => series.odometry.push(m),
            Some(Measurement::Drive(m)) => series.drive.push(m),
            Some(Measurement::Imu(m)) => series.imu.push(m),
            Some(Measurement::Wheels(_) | Measurement::Mapped(_)) | None => {}
        }
    }
    Ok(series)
}

/// Turns the messages of a stream from recorded to changed, in the order of recording.
struct Patches<'a> {
    odometry: Stream<'a, OdometrySample>,
    drive: Stream<'a, DriveSample>,
    imu: Stream<'a, ImuSample>,
}

type Stream<'a, T> = std::iter::Zip<std::slice::Iter<'a, T>, std::slice::Iter<'a, T>>;

impl<'a> Patches<'a> {
    fn new(recorded: &'a Series, changed: &'a Series) -> Self {
        Self {
            odometry: recorded.odometry.iter().zip(&changed.odometry),
            drive: recorded.drive.iter().zip(&changed.drive),
            imu: recorded.imu.iter().zip(&changed.imu),
        }
    }

    /// Changes the next message of a stream, and says whether there was something to change.
    fn apply(&mut self, role: Role, message: &mut RawMessage) -> Result<bool, BagError> {
        match role {
            Role::Odom => patch(message, self.odometry.next(), |m: &mut Odometry, to| {
                m.twist.twist.linear.x = to.v_x_mps;
                m.twist.twist.linear.y = to.v_y_mps;
                m.twist.twist.angular.z = to.yaw_rate_radps;
            }),
            Role::Drive => {
                let next = self.drive.next();
                if let Some((from, to)) = next {
                    let moved_ns = to.stamp_ns - from.stamp_ns;
                    message.log_time = message.log_time.saturating_add_signed(moved_ns);
                    message.publish_time = message.publish_time.saturating_add_signed(moved_ns);
                }
                patch(message, next, |m: &mut AckermannDriveStamped, to| {
                    m.header.stamp = encode::time(to.stamp_ns);
                    m.drive.steering_angle = to.steering_angle_rad as f32;
                })
            }
            Role::Imu => {
                // A message that says "not measured" has no sample.
                if decode::imu(&from_cdr(&message.data)?).is_none() {
                    return Ok(false);
                }
                patch(message, self.imu.next(), |m: &mut Imu, to| {
                    m.angular_velocity.z = to.yaw_rate_radps;
                    m.linear_acceleration.y = to.a_y_mps2;
                })
            }
            Role::Wheels => Ok(false),
        }
    }
}

fn patch<M: Message, T: PartialEq>(
    message: &mut RawMessage,
    next: Option<(&T, &T)>,
    change: impl FnOnce(&mut M, &T),
) -> Result<bool, BagError> {
    let Some((_, to)) = next.filter(|(from, to)| from != to) else { return Ok(false) };
    let mut content: M = from_cdr(&message.data)?;
    change(&mut content, to);
    message.data = to_cdr(&content)?.into();
    Ok(true)
}

/// A bag being written whose messages may come late by at most `late_ns` of log time.
struct SortedLog {
    writer: BagWriter,
    late_ns: u64,
    newest_ns: u64,
    /// By log time, then by order of arrival.
    waiting: BTreeMap<u64, VecDeque<RawMessage>>,
}

impl SortedLog {
    fn new(writer: BagWriter, late_ns: u64) -> Self {
        Self { writer, late_ns, newest_ns: 0, waiting: BTreeMap::new() }
    }

    fn push(&mut self, message: RawMessage) -> Result<(), BagError> {
        self.newest_ns = self.newest_ns.max(message.log_time);
        self.waiting.entry(message.log_time).or_default().push_back(message);
        self.write_until(self.newest_ns.saturating_sub(self.late_ns))
    }

    fn finish(mut self) -> Result<(), BagError> {
        self.write_until(u64::MAX)?;
        self.writer.finish()
    }

    fn write_until(&mut self, until_ns: u64) -> Result<(), BagError> {
        while let Some(entry) = self.waiting.first_entry().filter(|e| *e.key() <= until_ns) {
            for message in entry.remove() {
                self.writer.copy(&message)?;
            }
        }
        Ok(())
    }
}
