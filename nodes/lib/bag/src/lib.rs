//! Bags (MCAP and sqlite3) and ROS 2 messages to telemetry and back: the one conversion, used live (from message structs) and offline (from the
//! CDR bytes of a bag).
//!
//! - [`read_sequences`] and [`read_measurements`]: a bag's telemetry, topics found by type or by a [`TopicMap`].
//! - [`Bag`]: its topics and its messages as bytes.
//! - [`decode`], [`encode`]: messages and samples; [`sequence_to_messages`], [`Reassembler`]: sequences in chunks.
//! - [`BagWriter`], [`recover`]: writing bags, and rewriting what is left of a damaged one.
//! - [`info`]: what is in a bag; [`inject`]: a recorded bag with a known [`effect`].
//! - [`from_cdr`], [`to_cdr`]: messages and bytes.
//!
//! - [`dynamic`]: any field of any message, by the schema in the bag.
//!
//! A bag is an `.mcap` or `.db3` file or a rosbag2 folder; its memory is bounded by one chunk or page, and no length in it is trusted.

mod bag;
mod cdr;
pub mod decode;
pub mod dynamic;
pub mod effect;
pub mod encode;
mod error;
mod health;
mod info;
mod inject;
mod propose;
mod reading;
mod records;
mod recover;
mod rosbag2;
mod sequence;
mod sqlite;
mod storage;
mod telemetry;
mod texts;
mod topics;
mod writer;

pub use bag::{Bag, Messages, RawMessage, Topic};
pub use cdr::{from_cdr, to_cdr};
pub use error::BagError;
pub use info::{BagInfo, TopicInfo, Usable, info};
pub use inject::inject;
pub use propose::{Proposal, propose};
pub use reading::{Reading, Unreadable};
pub use recover::{Recovered, recover, refuse_overwriting};
pub use sequence::{
    CHUNK_LIMIT_BYTES, Reassembler, RecordedSequence, read_recorded_sequences, sequence_to_messages,
};
pub use telemetry::{ReadReport, read_measurements, read_sequences};
pub use topics::{LiveStreams, MappedTopic, Mapping, Role, Streams, TopicMap};
pub use writer::BagWriter;
