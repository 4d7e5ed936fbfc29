//! ROS 2 messages of the gripsight suite as serde structs, and the standard messages it exchanges.
//!
//! The suite's messages are defined twice: as `.msg` files for colcon (`msg/`) and as the structs
//! here. A test compares the two. Serialized with a CDR encoder, a struct is the message's body on
//! the wire and in a bag (encoding `cdr`, without the four bytes of the encapsulation header).
//!
//! [`schema`] gives the `ros2msg` schema text that a bag stores, [`type_hash`] the hash (RIHS01) by
//! which ROS 2 tells versions of a message apart.

mod definitions;
mod error;
mod hash;
pub mod idl;
mod schema;
pub mod standard;
mod suite;

pub use definitions::{definition, type_names};
pub use error::Error;
pub use hash::{type_hash, type_hash_of};
pub use schema::schema;
pub use suite::*;

/// A ROS message: its struct and its name.
pub trait Message: serde::Serialize + serde::de::DeserializeOwned + Clone + Send + Sync + 'static {
    /// Full name, `<package>/msg/<Type>`.
    const TYPE: &'static str;
}
