//! The rosbag2 folder: `metadata.yaml` and the files that it names.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::BagError;
use crate::storage::read_text;

/// Under this key a channel's metadata hold the publishers' quality of service.
pub(crate) const QOS_KEY: &str = "offered_qos_profiles";
/// Under this key a channel's metadata hold the hash of its message type.
pub(crate) const HASH_KEY: &str = "topic_type_hash";

/// What is read of `metadata.yaml`; the rest is left alone.
#[derive(Deserialize)]
struct MetadataFile {
    rosbag2_bagfile_information: Information,
}

#[derive(Deserialize)]
struct Information {
    relative_file_paths: Vec<String>,
}

/// Names of a bag's files end so.
const ENDINGS: [&str; 4] = [".mcap", ".db3", ".mcap.zstd", ".db3.zstd"];

/// The files of a bag in order: the file itself; what a folder's `metadata.yaml` names; or, where a recording was killed
/// before that was written, the folder's files by number.
pub(crate) fn files(path: &Path) -> Result<Vec<PathBuf>, BagError> {
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let refuse = |why: String| BagError::NotABag { path: path.to_owned(), why };
    let metadata = path.join("metadata.yaml");
    if !metadata.is_file() {
        let files = bag_files(path)?;
        return if files.is_empty() {
            Err(refuse("a folder with neither metadata.yaml nor .mcap or .db3 files".to_owned()))
        } else {
            Ok(files)
        };
    }
    let text = read_text(&metadata).map_err(BagError::io(&metadata))?;
    let MetadataFile { rosbag2_bagfile_information: information } =
        serde_saphyr::from_str(&text).map_err(|e| refuse(format!("metadata.yaml: {e}")))?;
    if information.relative_file_paths.is_empty() {
        return Err(refuse("metadata.yaml names no file".to_owned()));
    }
    Ok(information.relative_file_paths.iter().map(|name| named(path, name)).collect())
}

/// The file that `metadata.yaml` names. Early versions name the folder, too, and one that was compressed or unpacked by hand has another
/// ending than its name.
fn named(folder: &Path, name: &str) -> PathBuf {
    let given = folder.join(name);
    let base = folder.join(Path::new(name).file_name().unwrap_or_default());
    let packed = PathBuf::from(format!("{}.zstd", base.display()));
    let unpacked = base.with_extension("");
    [&given, &base, &packed, &unpacked].into_iter().find(|p| p.is_file()).unwrap_or(&given).clone()
}

/// The bag files in a folder, ordered by the number at the end of their names (`bag_2` before `bag_10`).
fn bag_files(folder: &Path) -> Result<Vec<PathBuf>, BagError> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(BagError::io(folder))? {
        let path = entry.map_err(BagError::io(folder))?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if ENDINGS.iter().any(|ending| name.ends_with(ending)) {
            files.push(path);
        }
    }
    files.sort_by_key(|path| {
        let name = path.file_name().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let stem = name.split('.').next().unwrap_or_default().to_owned();
        let number = stem.rsplit('_').next().and_then(|n| n.parse::<u64>().ok());
        (number, stem)
    });
    Ok(files)
}

/// What `metadata.yaml` tells of a bag, gathered while it is written.
#[derive(Default)]
pub(crate) struct Content {
    topics: BTreeMap<String, (TopicMetadata, u64)>,
    messages: u64,
    /// Log times of the earliest and the latest message.
    span_ns: Option<(u64, u64)>,
}

impl Content {
    /// A topic that will be written to.
    pub(crate) fn add_topic(&mut self, channel: &mcap::Channel) {
        let metadata = TopicMetadata {
            name: channel.topic.clone(),
            r#type: channel.schema.as_ref().map(|s| s.name.clone()).unwrap_or_default(),
            serialization_format: channel.message_encoding.clone(),
            offered_qos_profiles: [],
            type_description_hash: channel.metadata.get(HASH_KEY).cloned().unwrap_or_default(),
        };
        self.topics.entry(channel.topic.clone()).or_insert((metadata, 0));
    }

    /// A message that was written.
    pub(crate) fn add_message(&mut self, topic: &str, log_time_ns: u64) {
        self.messages += 1;
        if let Some((_, count)) = self.topics.get_mut(topic) {
            *count += 1;
        }
        let (first_ns, last_ns) = self.span_ns.unwrap_or((log_time_ns, log_time_ns));
        self.span_ns = Some((first_ns.min(log_time_ns), last_ns.max(log_time_ns)));
    }
}

#[derive(Clone, Serialize)]
struct TopicMetadata {
    name: String,
    r#type: String,
    serialization_format: String,
    offered_qos_profiles: [(); 0],
    type_description_hash: String,
}

/// `metadata.yaml`, version 9, as rosbag2 of ROS 2 Jazzy writes it.
#[derive(Serialize)]
struct MetadataOut {
    rosbag2_bagfile_information: InformationOut,
}

#[derive(Serialize)]
struct InformationOut {
    version: u8,
    storage_identifier: &'static str,
    duration: Nanoseconds,
    starting_time: SinceEpoch,
    message_count: u64,
    topics_with_message_count: Vec<TopicOut>,
    compression_format: &'static str,
    compression_mode: &'static str,
    relative_file_paths: [String; 1],
    files: [FileOut; 1],
    custom_data: Option<()>,
    ros_distro: &'static str,
}

#[derive(Serialize, Clone, Copy)]
struct Nanoseconds {
    nanoseconds: u64,
}

#[derive(Serialize, Clone, Copy)]
struct SinceEpoch {
    nanoseconds_since_epoch: u64,
}

#[derive(Serialize)]
struct TopicOut {
    topic_metadata: TopicMetadata,
    message_count: u64,
}

#[derive(Serialize)]
struct FileOut {
    path: String,
    starting_time: SinceEpoch,
    duration: Nanoseconds,
    message_count: u64,
}

/// Writes a folder's `metadata.yaml` beside its one file.
pub(crate) fn write_metadata(folder: &Path, file: &Path, content: &Content) -> Result<(), BagError> {
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let (first_ns, last_ns) = content.span_ns.unwrap_or_default();
    let starting_time = SinceEpoch { nanoseconds_since_epoch: first_ns };
    let duration = Nanoseconds { nanoseconds: last_ns - first_ns };
    let message_count = content.messages;
    let topics = content.topics.values().cloned();
    let information = InformationOut {
        version: 9,
        storage_identifier: "mcap",
        duration,
        starting_time,
        message_count,
        topics_with_message_count: topics
            .map(|(topic_metadata, message_count)| TopicOut { topic_metadata, message_count })
            .collect(),
        compression_format: "",
        compression_mode: "",
        relative_file_paths: [name.clone()],
        files: [FileOut { path: name, starting_time, duration, message_count }],
        custom_data: None,
        ros_distro: "jazzy",
    };
    let path = folder.join("metadata.yaml");
    let text = serde_saphyr::to_string(&MetadataOut { rosbag2_bagfile_information: information })
        .map_err(|e| BagError::Write { path: path.clone(), why: e.to_string() })?;
    std::fs::write(&path, text).map_err(BagError::io(&path))
}
