//! Writes bags that rosbag2 and the MCAP tools read: profile `ros2`, schemas `ros2msg`, CDR, zstd.
//!
//! The bytes depend on the messages alone. What is written reaches the disk every second of bag time, under a name ending in
//! `.part`, which becomes the bag's own when it is finished; what a crash leaves under that name, [`crate::recover`] reads.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use gripsight_msgs::Message;
use mcap::records::MessageHeader;

use crate::rosbag2::{self, Content, HASH_KEY, QOS_KEY};
use crate::{BagError, RawMessage, to_cdr};

const CHUNK_BYTES: u64 = 1 << 20;
const ZSTD_LEVEL: u32 = 2;
const SYNC_EVERY_NS: u64 = 1_000_000_000;

/// A bag being written: a file where the path ends in `.mcap`, a rosbag2 folder (one file and `metadata.yaml`) otherwise.
///
/// Nothing stands at the path before [`Self::finish`].
pub struct BagWriter {
    path: PathBuf,
    /// What is renamed to `path` in the end.
    part: PathBuf,
    /// The MCAP file: `part` itself, or in it.
    file_path: PathBuf,
    file: File,
    mcap: mcap::Writer<BufWriter<File>>,
    written: BTreeMap<String, Written>,
    /// Channels of other bags, and their numbers in this one.
    copied: Vec<(Arc<mcap::Channel<'static>>, u16)>,
    content: Content,
    synced_ns: Option<u64>,
}

/// A topic that [`BagWriter::write`] has written to.
struct Written {
    channel_id: u16,
    type_name: &'static str,
    next_sequence: u32,
}

impl BagWriter {
    /// Begins a bag. A file at `path` is replaced by [`Self::finish`]; a folder there is refused.
    ///
    /// # Errors
    /// [`BagError::Io`], [`BagError::Write`].
    pub fn create(path: &Path) -> Result<Self, BagError> {
        let refuse = |why: &str| BagError::Write { path: path.to_owned(), why: why.to_owned() };
        let name =
            path.file_name().ok_or_else(|| refuse("no name for a bag"))?.to_string_lossy().into_owned();
        let part = part_of(path);
        if path.is_dir() {
            return Err(refuse("there is a folder of that name, and folders are not overwritten"));
        }
        let file_path = if is_file_name(path) {
            part.clone()
        } else {
            std::fs::create_dir_all(&part).map_err(BagError::io(&part))?;
            part.join(format!("{name}_0.mcap"))
        };
        let file = File::create(&file_path).map_err(BagError::io(&file_path))?;
        let buffered = BufWriter::new(file.try_clone().map_err(BagError::io(&file_path))?);
        let mcap = mcap::WriteOptions::new()
            .profile("ros2")
            .library("gripsight")
            .compression(Some(mcap::Compression::Zstd))
            .compression_level(ZSTD_LEVEL)
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            .create(buffered)
            .map_err(failed(&file_path))?;
        Ok(Self {
            path: path.to_owned(),
            part,
            file_path,
            file,
            mcap,
            written: BTreeMap::new(),
            copied: Vec::new(),
            content: Content::default(),
            synced_ns: None,
        })
    }

    /// Appends a message; `stamp_ns` is both its log and its publish time.
    ///
    /// # Errors
    /// [`BagError::Schema`] for a type without definition, [`BagError::Write`] for a topic that holds another type or a stamp
    /// before 1970, [`BagError::Body`], [`BagError::Io`].
    pub fn write<T: Message>(&mut self, topic: &str, stamp_ns: i64, message: &T) -> Result<(), BagError> {
        let refuse = |why: String| BagError::Write { path: self.path.clone(), why };
        let log_time = u64::try_from(stamp_ns)
            .map_err(|_| refuse(format!("{topic}: stamp {stamp_ns} ns lies before 1970")))?;
        let (channel_id, sequence) = match self.written.get_mut(topic) {
            Some(known) if known.type_name == T::TYPE => {
                let sequence = known.next_sequence;
                known.next_sequence = sequence.wrapping_add(1);
                (known.channel_id, sequence)
            }
            Some(known) => return Err(refuse(format!("{topic} holds {}, got {}", known.type_name, T::TYPE))),
            None => {
                let channel_id = self.declare::<T>(topic)?;
                let known = Written { channel_id, type_name: T::TYPE, next_sequence: 1 };
                self.written.insert(topic.to_owned(), known);
                (channel_id, 0)
            }
        };
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        self.append(topic, &header, &to_cdr(message)?)
    }

    /// Appends a message of another bag as it is: bytes, times, sequence number, channel and schema.
    ///
    /// # Errors
    /// [`BagError::Write`], [`BagError::Io`].
    pub fn copy(&mut self, message: &RawMessage) -> Result<(), BagError> {
        let channel = &message.channel;
        let known = self.copied.iter().find(|(other, _)| Arc::ptr_eq(other, channel)).map(|&(_, id)| id);
        let channel_id = match known {
            Some(id) => id,
            None => {
                let id = self.add_channel(channel)?;
                self.copied.push((Arc::clone(channel), id));
                id
            }
        };
        let header = MessageHeader {
            channel_id,
            sequence: message.sequence,
            log_time: message.log_time,
            publish_time: message.publish_time,
        };
        self.append(&channel.topic, &header, &message.data)
    }

    /// Completes the bag and gives it its name.
    ///
    /// # Errors
    /// [`BagError::Write`], [`BagError::Io`]; what was written stays under the name ending in `.part`.
    pub fn finish(mut self) -> Result<(), BagError> {
        self.mcap.finish().map_err(failed(&self.file_path))?;
        self.file.sync_all().map_err(BagError::io(&self.file_path))?;
        if !is_file_name(&self.path) {
            rosbag2::write_metadata(&self.part, &self.file_path, &self.content)?;
        }
        std::fs::rename(&self.part, &self.path).map_err(BagError::io(&self.path))
    }

    /// Adds the channel of a topic that [`Self::write`] writes to.
    fn declare<T: Message>(&mut self, topic: &str) -> Result<u16, BagError> {
        let unknown = |error| BagError::Schema { topic: topic.to_owned(), error };
        let text = gripsight_msgs::schema(T::TYPE).map_err(unknown)?;
        let hash = gripsight_msgs::type_hash(T::TYPE).map_err(unknown)?;
        let schema = mcap::Schema {
            id: 0,
            name: T::TYPE.to_owned(),
            encoding: "ros2msg".to_owned(),
            data: text.into_bytes().into(),
        };
        self.add_channel(&mcap::Channel {
            id: 0,
            topic: topic.to_owned(),
            schema: Some(Arc::new(schema)),
            message_encoding: "cdr".to_owned(),
            metadata: [(QOS_KEY, String::new()), (HASH_KEY, hash)].map(|(k, v)| (k.to_owned(), v)).into(),
        })
    }

    /// Adds a channel and its schema under numbers of this file; the same content gets the same number.
    fn add_channel(&mut self, channel: &mcap::Channel) -> Result<u16, BagError> {
        let schema_id = match &channel.schema {
            Some(schema) => self.mcap.add_schema(&schema.name, &schema.encoding, &schema.data),
            None => Ok(0),
        }
        .map_err(failed(&self.file_path))?;
        self.content.add_topic(channel);
        self.mcap
            .add_channel(schema_id, &channel.topic, &channel.message_encoding, &channel.metadata)
            .map_err(failed(&self.file_path))
    }

    fn append(&mut self, topic: &str, header: &MessageHeader, data: &[u8]) -> Result<(), BagError> {
        self.mcap.write_to_known_channel(header, data).map_err(failed(&self.file_path))?;
        self.content.add_message(topic, header.log_time);
        let since_ns = header.log_time.saturating_sub(*self.synced_ns.get_or_insert(header.log_time));
        if since_ns >= SYNC_EVERY_NS {
            self.synced_ns = Some(header.log_time);
            self.mcap.flush().map_err(failed(&self.file_path))?;
            self.file.sync_data().map_err(BagError::io(&self.file_path))?;
        }
        Ok(())
    }
}

/// Where a bag is written before it has its name.
pub(crate) fn part_of(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".part");
    path.with_file_name(name)
}

/// Whether a path names a file rather than a rosbag2 folder.
fn is_file_name(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "mcap")
}

fn failed(path: &Path) -> impl Fn(mcap::McapError) -> BagError + '_ {
    |error| BagError::Write { path: path.to_owned(), why: error.to_string() }
}
