//! What is in a bag, and what the suite would make of it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use gripsight_signals::{Checks, DataHealth, Pace, WindowConfig, cross_check};
use serde::Serialize;

use crate::telemetry::sequences_of;
use crate::{Bag, BagError, ReadReport, TopicMap};

/// A look into a bag.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BagInfo {
    /// Its files.
    pub files: Vec<PathBuf>,
    /// Their size together.
    pub size_bytes: u64,
    /// Log time of the first message, since the epoch.
    pub start_s: f64,
    /// From the first to the last log time.
    pub duration_s: f64,
    /// Messages in all.
    pub messages: u64,
    /// Where the bag is cut off or damaged, in words.
    pub damage: Option<String>,
    /// Its topics, sorted by name.
    pub topics: Vec<TopicInfo>,
    /// What the suite would use.
    pub telemetry: Usable,
}

/// One topic.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TopicInfo {
    /// Its name.
    pub name: String,
    /// Its type.
    #[serde(rename = "type")]
    pub type_name: String,
    /// Encoding of its messages.
    pub encoding: String,
    /// Messages.
    pub messages: usize,
    /// How regularly they were logged.
    #[serde(flatten)]
    pub pace: Pace,
}

/// What the suite would use of a bag.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Usable {
    /// It can work on this.
    Sequences {
        /// Where the streams were found, and what was left out.
        report: Box<ReadReport>,
        /// State of the data, one entry for each sequence.
        health: Vec<DataHealth>,
        /// What the signals say of each other, one entry for each sequence.
        checks: Vec<Checks>,
    },
    /// It cannot, and this is why.
    Nothing(String),
}

/// Looks into a bag. What keeps the suite from using it, damage included, is part of the answer.
///
/// # Errors
/// [`BagError::NotABag`], [`BagError::Profile`], [`BagError::Io`].
pub fn info(path: &Path, topics: &TopicMap) -> Result<BagInfo, BagError> {
    let bag = Bag::open(path)?;
    let mut log_times_ns: BTreeMap<String, Vec<u64>> =
        bag.topics().iter().map(|t| (t.name.clone(), Vec::new())).collect();
    let mut damage = None;
    for message in bag.messages() {
        match message {
            Ok(message) => match log_times_ns.get_mut(&message.channel.topic) {
                Some(times) => times.push(message.log_time),
                None => _ = log_times_ns.insert(message.channel.topic.clone(), vec![message.log_time]),
            },
            Err(error) => damage = Some(error.to_string()),
        }
    }
    let all = || log_times_ns.values().flatten().copied();
    let (first_ns, last_ns) = (all().min().unwrap_or(0), all().max().unwrap_or(0));
    let size = |file: &PathBuf| std::fs::metadata(file).map(|m| m.len()).map_err(BagError::io(file));
    Ok(BagInfo {
        files: bag.files().to_vec(),
        size_bytes: bag.files().iter().map(size).sum::<Result<_, _>>()?,
        start_s: first_ns as f64 * 1e-9,
        duration_s: (last_ns - first_ns) as f64 * 1e-9,
        messages: all().count() as u64,
        damage,
        topics: bag
            .topics()
            .iter()
            .map(|topic| {
                let times_ns = log_times_ns.get(&topic.name).map_or(&[][..], Vec::as_slice);
                TopicInfo {
                    name: topic.name.clone(),
                    type_name: topic.type_name.clone(),
                    encoding: topic.encoding.clone(),
                    messages: times_ns.len(),
                    pace: Pace::of(times_ns.windows(2).map(|w| w[1].saturating_sub(w[0]) as f64 * 1e-9)),
                }
            })
            .collect(),
        telemetry: usable(&bag, topics),
    })
}

fn usable(bag: &Bag, topics: &TopicMap) -> Usable {
    let whole = WindowConfig { length_s: f64::INFINITY, hop_s: f64::INFINITY };
    let looked = sequences_of(bag, topics, whole).and_then(|(sequences, report)| {
        let health = sequences.iter().map(DataHealth::of).collect::<Result<_, _>>()?;
        let checks = sequences.iter().map(cross_check).collect::<Result<_, _>>()?;
        Ok(Usable::Sequences { report: Box::new(report), health, checks })
    });
    looked.unwrap_or_else(|error| Usable::Nothing(error.to_string()))
}
