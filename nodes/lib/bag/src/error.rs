//! Errors of this crate. Each says all it knows in one line; causes are part of it.

use std::path::PathBuf;

use gripsight_signals::SignalError;

/// What can be wrong with a bag, with the place where it is.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BagError {
    /// The operating system refused.
    #[error("{}: {error}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        error: std::io::Error,
    },
    /// Neither an MCAP or sqlite3 file nor a rosbag2 folder of such files.
    #[error("{}: not a bag gripsight can read: {why}", path.display())]
    NotABag {
        /// The path given.
        path: PathBuf,
        /// What was found instead.
        why: String,
    },
    /// A bag of ROS 1.
    #[error(
        "{0}: a ROS 1 bag; convert it: `pip install rosbags`, then `rosbags-convert --src {0} --dst {1}`",
        path.display(), path.with_extension("").display()
    )]
    Ros1 {
        /// The file.
        path: PathBuf,
    },
    /// A message of a sqlite3 file that cannot be.
    #[error("{}, message {message}: {why}", path.display())]
    Sqlite {
        /// The file.
        path: PathBuf,
        /// Its number in the table `messages`.
        message: i64,
        /// What is wrong with it.
        why: String,
    },
    /// The text of a message type does not read, or is not there.
    #[error("type {type_name}: {why}")]
    Layout {
        /// The type.
        type_name: String,
        /// What is wrong.
        why: String,
    },
    /// A field that a topics file names leads to no number.
    #[error("{type_name}, field `{field}`: {why}")]
    Field {
        /// The type.
        type_name: String,
        /// The path as given.
        field: String,
        /// What stands there.
        why: String,
    },
    /// A signal of a topics file cannot be taken from the bag.
    #[error("{}: {signal}: {why}", path.display())]
    Mapping {
        /// The bag.
        path: PathBuf,
        /// The signal, as the topics file names it.
        signal: &'static str,
        /// What is wrong.
        why: String,
    },
    /// Bytes that are no message of a type known by its text alone.
    #[error("{len} bytes are no {type_name}: {why}")]
    DynamicBody {
        /// The type.
        type_name: String,
        /// Bytes there.
        len: usize,
        /// What the reader met.
        why: String,
    },
    /// The file follows another profile than ROS 2.
    #[error("{}: profile `{profile}`, expected `ros2`; convert the bag first (`ros2 bag convert`, `rosbags-convert`)", path.display())]
    Profile {
        /// The file.
        path: PathBuf,
        /// The profile in its header.
        profile: String,
    },
    /// A chunk is compressed in a way unknown here.
    #[error("{}, byte {at}: chunk compressed with `{compression}`, known are zstd, lz4 and none", path.display())]
    Compression {
        /// The file.
        path: PathBuf,
        /// Offset of the chunk's record.
        at: u64,
        /// The compression named in it.
        compression: String,
    },
    /// The file ends in the middle of a record: a recording that was cut off.
    #[error(
        "{}: cut off at byte {at} after {messages} whole messages; `gripsight bag recover` rewrites what is there",
        path.display()
    )]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Offset of the record that is not whole.
        at: u64,
        /// Messages before it.
        messages: u64,
    },
    /// A record that cannot be what it says it is.
    #[error("{}, byte {at}: damaged: {why}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Offset of the record in the file.
        at: u64,
        /// What is wrong with it.
        why: String,
    },
    /// There is no message in the bag.
    #[error("{}: the bag is empty", path.display())]
    Empty {
        /// The bag.
        path: PathBuf,
    },
    /// A stream that is needed is not there.
    #[error("{}: no topic for {role}: looked for {wanted}; the bag holds {found}; `gripsight bag info --write-topics FILE` proposes where to take it from, and `--topics FILE` takes the file",
        path.display())]
    MissingTopic {
        /// The bag.
        path: PathBuf,
        /// The stream, as the topics file names it.
        role: &'static str,
        /// The name or type looked for.
        wanted: String,
        /// What is there, as text.
        found: String,
    },
    /// Several topics could be a stream.
    #[error(
        "{}: several topics of type {type_name}: {}; choose one in a topics file (`--topics FILE`) with the line `{role}: {}`",
        path.display(), candidates.join(", "), candidates.first().map_or("/name", String::as_str)
    )]
    AmbiguousTopic {
        /// The bag.
        path: PathBuf,
        /// The stream, as the topics file names it.
        role: &'static str,
        /// The type of all of them.
        type_name: &'static str,
        /// Their names.
        candidates: Vec<String>,
    },
    /// A topic chosen by name has another type.
    #[error("{}: {topic} has type {got}, {role} needs {expected}", path.display())]
    WrongType {
        /// The bag.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// The stream it was chosen for.
        role: &'static str,
        /// The type needed.
        expected: &'static str,
        /// The type recorded.
        got: String,
    },
    /// Messages of a topic are not in CDR.
    #[error("{}: {topic} is encoded as `{encoding}`, expected `cdr`", path.display())]
    Encoding {
        /// The bag.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// The encoding recorded.
        encoding: String,
    },
    /// A message does not decode.
    #[error("{topic}, message {index} (logged at {log_time_s:.6} s): {error}")]
    Message {
        /// The topic.
        topic: String,
        /// Place in the topic, from 0.
        index: usize,
        /// When it was logged.
        log_time_s: f64,
        /// What is wrong.
        error: Box<BagError>,
    },
    /// Bytes too few for the encapsulation header of CDR.
    #[error("{len} bytes are too few for a CDR message")]
    NoEncapsulation {
        /// Bytes there.
        len: usize,
    },
    /// Another representation than plain CDR.
    #[error("encapsulation {identifier:#06x}; plain CDR is 0x0000 (big-endian) or 0x0001 (little-endian)")]
    Encapsulation {
        /// The representation identifier found.
        identifier: u16,
    },
    /// Bytes that are no message of the type.
    #[error("{len} bytes are no {type_name}: {why}")]
    Body {
        /// The type expected.
        type_name: &'static str,
        /// Bytes there.
        len: usize,
        /// What the decoder met.
        why: String,
    },
    /// Arrays of a message that belong together differ in length.
    #[error("{type_name}.{field} holds {got} values, expected {expected}")]
    ArrayLength {
        /// The type.
        type_name: &'static str,
        /// The array.
        field: &'static str,
        /// Values there.
        got: usize,
        /// Values expected.
        expected: usize,
    },
    /// A part of a `StateSequence` whose number cannot be.
    #[error("sequence {sequence_id}: part {chunk} of {chunks}, counted from 0")]
    Chunk {
        /// The sequence.
        sequence_id: u64,
        /// The part's number.
        chunk: u32,
        /// Parts in all.
        chunks: u32,
    },
    /// The samples themselves are wrong.
    #[error("{topic}: {error}")]
    Signal {
        /// The topic they came from.
        topic: String,
        /// What is wrong.
        error: SignalError,
    },
    /// Streams that do not meet: hardly an odometry message has a drive command in force.
    #[error(
        "{}: {odometry} odometry and {drive} drive messages give {aligned} samples ({without_drive} odometry messages without \
         a drive command in force, {duplicates} messages with a stamp seen before); both topics need header stamps of one clock",
        path.display()
    )]
    NothingAligned {
        /// The bag.
        path: PathBuf,
        /// Odometry messages.
        odometry: usize,
        /// Drive messages.
        drive: usize,
        /// Samples that could be made.
        aligned: usize,
        /// Odometry messages without a drive command in force.
        without_drive: usize,
        /// Messages with a stamp seen before.
        duplicates: usize,
    },
    /// A setting is wrong, or recorded sequences do not hold together.
    #[error(transparent)]
    Samples(#[from] SignalError),
    /// The topics file does not read.
    #[error("{}: {why}", path.display())]
    TopicsFile {
        /// The file.
        path: PathBuf,
        /// What is wrong, with its place.
        why: String,
    },
    /// A bag cannot be written.
    #[error("{}: {why}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// A message type whose definition is not known here.
    #[error("{topic}: {error}")]
    Schema {
        /// The topic to be written.
        topic: String,
        /// What is wrong.
        error: gripsight_msgs::Error,
    },
    /// An effect that cannot be injected.
    #[error("effect `{given}`: {why}")]
    Effect {
        /// The effect as given.
        given: String,
        /// What is wrong, and what is possible.
        why: String,
    },
}

impl BagError {
    pub(crate) fn io(path: &std::path::Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        |error| Self::Io { path: path.to_owned(), error }
    }

    /// Says which message of a bag the error is about.
    pub(crate) fn in_message(self, topic: &str, index: usize, log_time_ns: u64) -> Self {
        let log_time_s = log_time_ns as f64 * 1e-9;
        Self::Message { topic: topic.to_owned(), index, log_time_s, error: Box::new(self) }
    }
}
