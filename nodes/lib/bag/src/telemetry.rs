//! From a bag to measurements and sequences.

use std::collections::BTreeMap;
use std::path::Path;

use gripsight_signals::{Measurement, Sequencer, StateSequence, Taken, TopicHealth, WindowConfig};
use serde::Serialize;

use crate::sequence::read_recorded;
use crate::{Bag, BagError, Reading, Streams, TopicMap, Unreadable, decode, health};

/// What reading a bag met.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct ReadReport {
    /// Where each stream was found.
    pub streams: Streams,
    /// Messages by stream, in the order of [`Role::ALL`](crate::Role::ALL).
    #[serde(serialize_with = "crate::topics::by_role")]
    pub counts: [usize; 4],
    /// State of each stream's messages, in the order of [`Role::ALL`](crate::Role::ALL); empty where recorded sequences were used.
    pub topics: Vec<TopicHealth>,
    /// Messages that said nothing about their stream: joints that are not the four wheels, sensors that report "not measured".
    pub without_content: usize,
    /// Messages that could not be read and were left out, by topic.
    pub unreadable: Vec<Unreadable>,
    /// What became of the rest, and what was left out.
    #[serde(flatten)]
    pub taken: Taken,
    /// Where the bag is cut off, in words; what comes before was read.
    pub truncated: Option<String>,
    /// The topic of the recorded sequences that were used instead of the streams.
    pub recorded_sequences: Option<String>,
}

/// Every measurement of a bag in the order of recording. NaN and stamps that go back are left out
/// by the [`Aligner`](gripsight_signals::Aligner), not here. A message that cannot be read costs itself.
///
/// # Errors
/// [`BagError`], also where half of a topic's messages cannot be read; a truncated bag is none: its whole messages are given, and the report says so.
pub fn read_measurements(path: &Path, topics: &TopicMap) -> Result<(Vec<Measurement>, ReadReport), BagError> {
    measurements_of(&Bag::open(path)?, topics)
}

fn measurements_of(bag: &Bag, topics: &TopicMap) -> Result<(Vec<Measurement>, ReadReport), BagError> {
    let streams = topics.resolve(bag)?;
    let mut report = ReadReport { streams, ..ReadReport::default() };
    let mut measurements = Vec::new();
    let mut log_times_ns = Vec::new();
    let mut readings: BTreeMap<String, Reading> = BTreeMap::new();
    for message in bag.messages() {
        let message = match message {
            Ok(message) => message,
            Err(error @ BagError::Truncated { .. }) => {
                report.truncated = Some(error.to_string());
                break;
            }
            Err(error) => return Err(error),
        };
        let topic = &message.channel.topic;
        let reading = readings.entry(topic.clone()).or_insert_with(|| Reading::new(topic));
        for mapped in report.streams.mapped().iter().filter(|mapped| mapped.topic == *topic) {
            let measurement = mapped.measurement(&message.data, message.log_time);
            if let Some(measurement) = reading.take(message.log_time, measurement) {
                measurements.push(measurement);
                log_times_ns.push(message.log_time);
            }
        }
        let Some(role) = report.streams.role(topic) else { continue };
        report.counts[role as usize] += 1;
        match reading.take(message.log_time, decode::measurement(role, &message.data)) {
            Some(Some(measurement)) => {
                measurements.push(measurement);
                log_times_ns.push(message.log_time);
            }
            Some(None) => report.without_content += 1,
            None => {}
        }
    }
    for reading in readings.into_values() {
        report.unreadable.extend(reading.done()?);
    }
    if measurements.is_empty() {
        return Err(BagError::Empty { path: bag.path().to_owned() });
    }
    report.topics = health::of(&report.streams, &measurements, &log_times_ns);
    Ok((measurements, report))
}

/// The state sequences of a bag. Where it holds recorded ones, exactly those; otherwise its streams, aligned and cut into windows
/// by the rules that the telemetry node follows, so that both give the same sequences.
///
/// Windows are the full ones; where none is full (a short bag, an infinite window) the one window that is open at the end.
///
/// # Errors
/// [`BagError`]; a truncated bag is none, see [`read_measurements`].
pub fn read_sequences(
    path: &Path,
    topics: &TopicMap,
    window: WindowConfig,
) -> Result<(Vec<StateSequence>, ReadReport), BagError> {
    sequences_of(&Bag::open(path)?, topics, window)
}

pub(crate) fn sequences_of(
    bag: &Bag,
    topics: &TopicMap,
    window: WindowConfig,
) -> Result<(Vec<StateSequence>, ReadReport), BagError> {
    if let Some(topic) = topics.resolve_sequence(bag)? {
        let (recorded, truncated) = read_recorded(bag, &topic)?;
        let report = ReadReport { truncated, recorded_sequences: Some(topic), ..ReadReport::default() };
        return Ok((recorded.into_iter().map(|r| r.sequence).collect(), report));
    }
    let (measurements, mut report) = measurements_of(bag, topics)?;
    let mut sequencer = Sequencer::new(window, report.streams.layout())?;
    let mut sequences = Vec::new();
    for measurement in measurements {
        sequences.extend(sequencer.push(measurement).0);
    }
    sequences.extend(sequencer.finish());
    report.taken = sequencer.taken();
    // The last window is open; what an infinite one held when the clock was set back stands before it.
    if sequences.is_empty() || window.length_s.is_infinite() {
        match sequencer.rest() {
            Ok(rest) => sequences.push(rest),
            Err(_) if sequences.is_empty() => {
                return Err(BagError::NothingAligned {
                    path: bag.path().to_owned(),
                    odometry: report.counts[0],
                    drive: report.counts[1],
                    aligned: sequencer.buffered(),
                    without_drive: report.taken.without_drive,
                    duplicates: report.taken.duplicates,
                });
            }
            Err(_) => {}
        }
    }
    Ok((sequences, report))
}
