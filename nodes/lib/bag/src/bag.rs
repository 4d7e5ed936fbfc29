//! A bag on disk: its files, its topics, its messages as bytes.

use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

use mcap::records::Record;

use crate::records::Records;
use crate::sqlite::{SqliteMessages, ZSTD_MAGIC, unpacked};
use crate::storage::{Kind, Source, source};
use crate::{BagError, rosbag2, texts};

/// A message as recorded: channel (topic, schema, metadata), times, CDR bytes.
pub type RawMessage = mcap::Message<'static>;

/// A topic of a bag.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topic {
    /// Its name.
    pub name: String,
    /// Its type, such as `nav_msgs/msg/Odometry`; empty where the bag does not say.
    pub type_name: String,
    /// How its messages are encoded; `cdr` in ROS 2.
    pub encoding: String,
    /// The publishers' quality of service, as YAML; empty where not recorded.
    pub offered_qos_profiles: String,
    /// The text that describes its type; empty where neither the bag nor a `.msg` file beside it has one.
    pub schema: String,
    /// How that text is written: `ros2msg` or `ros2idl`.
    pub schema_encoding: String,
}

/// A bag: an `.mcap` or `.db3` file, or a rosbag2 folder of several that follow each other.
#[derive(Debug, Clone)]
pub struct Bag {
    path: PathBuf,
    files: Vec<PathBuf>,
    sources: Vec<Source>,
    topics: Vec<Topic>,
}

impl Bag {
    /// Looks at a bag: finds its files and its topics (from the files' summaries, or by reading through a file that has none).
    ///
    /// # Errors
    /// [`BagError::NotABag`], [`BagError::Profile`], [`BagError::Io`], [`BagError::Damaged`]; not [`BagError::Truncated`]:
    /// what is there of a truncated bag can be read.
    pub fn open(path: &Path) -> Result<Self, BagError> {
        let files = rosbag2::files(path)?;
        let sources = files.iter().map(|file| source(file)).collect::<Result<Vec<_>, _>>()?;
        let mut topics: BTreeMap<String, Topic> = BTreeMap::new();
        for source in &sources {
            for (name, topic) in source_topics(source)? {
                topics.entry(name).or_insert(topic);
            }
        }
        Ok(Self { path: path.to_owned(), files, sources, topics: topics.into_values().collect() })
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its files in order.
    #[must_use]
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// Its topics, sorted by name.
    #[must_use]
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// Its messages in the order of the files, which is the order of recording.
    #[must_use]
    pub fn messages(&self) -> Messages {
        Messages::of(self.sources.iter().cloned())
    }
}

/// The messages of a bag. After an error nothing follows; all whole messages before the place come first.
pub struct Messages {
    sources: VecDeque<Source>,
    open: Option<Open>,
}

/// The file being read.
struct Open {
    reading: Reading,
    /// What unpacked it is kept as long.
    _source: Source,
}

enum Reading {
    Mcap(Box<(Records, Channels)>),
    Sqlite(Box<SqliteMessages>),
}

impl Open {
    fn of(source: Source) -> Result<Self, BagError> {
        let reading = match source.kind {
            Kind::Mcap => Reading::Mcap(Box::new((Records::open(&source.path)?, Channels::default()))),
            Kind::Sqlite => Reading::Sqlite(Box::new(SqliteMessages::open(&source.path, &source.beside)?)),
        };
        Ok(Self { reading, _source: source })
    }

    fn next(&mut self) -> Option<Result<RawMessage, BagError>> {
        match &mut self.reading {
            Reading::Mcap(open) => open.1.next_message(&mut open.0),
            Reading::Sqlite(messages) => messages.next(),
        }
    }
}

impl Iterator for Messages {
    type Item = Result<RawMessage, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if self.open.is_none() {
                match Open::of(self.sources.pop_front()?) {
                    Ok(open) => self.open = Some(open),
                    Err(error) => return Some(Err(self.stop(error))),
                }
            }
            match self.open.as_mut()?.next() {
                Some(Ok(message)) => return Some(Ok(message)),
                Some(Err(error)) => return Some(Err(self.stop(error))),
                None => self.open = None,
            }
        }
    }
}

impl Messages {
    /// The messages of these files, one after the other.
    pub(crate) fn of(sources: impl IntoIterator<Item = Source>) -> Self {
        Self { sources: sources.into_iter().collect(), open: None }
    }

    fn stop(&mut self, error: BagError) -> BagError {
        self.sources.clear();
        self.open = None;
        error
    }
}

/// Links messages to their channels and schemas.
#[derive(Default)]
struct Channels {
    known: mcap::read::ChannelAccumulator<'static>,
    topics: BTreeMap<String, Topic>,
}

impl Channels {
    fn next_message(&mut self, records: &mut Records) -> Option<Result<RawMessage, BagError>> {
        loop {
            let linked = match records.next()? {
                Ok(Record::Message { header, data }) => match self.known.get(header.channel_id) {
                    Some(channel) => {
                        // What rosbag2 compressed message by message.
                        let data = match data.starts_with(&ZSTD_MAGIC) {
                            true => unpacked(&data),
                            false => Ok(data.into_owned()),
                        };
                        match data {
                            Ok(data) => {
                                return Some(Ok(RawMessage {
                                    channel,
                                    sequence: header.sequence,
                                    log_time: header.log_time,
                                    publish_time: header.publish_time,
                                    data: Cow::Owned(data),
                                }));
                            }
                            Err(why) => Err(why),
                        }
                    }
                    None => Err(format!("a message on channel {}, which is not declared", header.channel_id)),
                },
                Ok(Record::Schema { header, data }) => {
                    self.known.add_schema(header, Cow::Owned(data.into_owned())).map_err(|e| e.to_string())
                }
                Ok(Record::Channel(channel)) => self.add_channel(channel).map_err(|e| e.to_string()),
                Ok(_) => Ok(()),
                Err(error) => return Some(Err(error)),
            };
            if let Err(why) = linked {
                return Some(Err(records.damaged(why)));
            }
        }
    }
}

impl Channels {
    fn add_channel(&mut self, channel: mcap::records::Channel) -> mcap::McapResult<()> {
        let id = channel.id;
        self.known.add_channel(channel)?;
        if let Some(channel) = self.known.get(id) {
            self.topics.entry(channel.topic.clone()).or_insert_with(|| Topic::of(&channel));
        }
        Ok(())
    }
}

impl Topic {
    fn of(channel: &mcap::Channel) -> Self {
        Self {
            name: channel.topic.clone(),
            type_name: channel.schema.as_ref().map(|s| s.name.clone()).unwrap_or_default(),
            encoding: channel.message_encoding.clone(),
            offered_qos_profiles: channel.metadata.get(rosbag2::QOS_KEY).cloned().unwrap_or_default(),
            schema: channel
                .schema
                .as_ref()
                .map(|s| String::from_utf8_lossy(&s.data).into_owned())
                .unwrap_or_default(),
            schema_encoding: channel.schema.as_ref().map(|s| s.encoding.clone()).unwrap_or_default(),
        }
    }

    /// Where the bag has no text that is read, one beside it.
    fn described(mut self, beside: &Path) -> Self {
        if (self.schema.trim().is_empty() || self.schema_encoding != "ros2msg")
            && let Some(text) = texts::find(&self.type_name, beside)
        {
            (self.schema, self.schema_encoding) = (text, "ros2msg".to_owned());
        }
        self
    }
}

pub(crate) fn check_profile(path: &Path) -> Result<(), BagError> {
    let mut records = Records::open(path)?;
    match records.next() {
        Some(Ok(Record::Header(header))) if header.profile == "ros2" => Ok(()),
        Some(Ok(Record::Header(header))) => {
            Err(BagError::Profile { path: path.to_owned(), profile: header.profile })
        }
        Some(Err(error)) => Err(error),
        _ => Err(records.damaged("the first record is not the header")),
    }
}

/// The topics of one file.
fn source_topics(source: &Source) -> Result<BTreeMap<String, Topic>, BagError> {
    let topics = match source.kind {
        Kind::Mcap => {
            check_profile(&source.path)?;
            file_topics(&source.path)?
        }
        Kind::Sqlite => SqliteMessages::open(&source.path, &source.beside)?
            .channels()
            .map(|channel| (channel.topic.clone(), Topic::of(channel)))
            .collect(),
    };
    Ok(topics.into_iter().map(|(name, topic)| (name, topic.described(&source.beside))).collect())
}

/// The topics of one MCAP file.
fn file_topics(path: &Path) -> Result<BTreeMap<String, Topic>, BagError> {
    let mut records = Records::open(path)?;
    if records.seek_summary()? {
        let mut channels = Channels::default();
        let whole = !matches!(channels.next_message(&mut records), Some(Err(_)));
        let topics = channels.topics;
        if whole && !topics.is_empty() {
            return Ok(topics);
        }
    }
    let mut records = Records::open(path)?;
    let mut channels = Channels::default();
    while let Some(message) = channels.next_message(&mut records) {
        match message {
            Ok(_) => {}
            Err(BagError::Truncated { .. }) => break,
            Err(error) => return Err(error),
        }
    }
    Ok(channels.topics)
}
