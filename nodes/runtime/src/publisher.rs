//! Publishers: messages are serialized here, once, and padded.
//!
//! RustDDS 0.15.1 sends a malformed last fragment when a fragmented sample's length, with the four
//! bytes of the encapsulation header, is not a multiple of 4; CycloneDDS then drops the sample.
//! Zero bytes after the message, which readers ignore, make the length a multiple of 4.

use std::marker::PhantomData;
use std::sync::{Mutex, PoisonError, Weak};

use byteorder::LittleEndian;
use gripsight_msgs::Message;
use serde::ser::{Serialize, SerializeTuple, Serializer};

use crate::diagnostics::Diagnostics;

/// A message's CDR body, as it goes on the wire.
#[derive(Clone)]
pub(crate) struct RawCdr(Vec<u8>);

impl RawCdr {
    pub(crate) fn padded(mut body: Vec<u8>) -> Self {
        body.resize(body.len().next_multiple_of(4), 0);
        Self(body)
    }
}

/// Bytes one after the other: no length in front, no alignment.
impl Serialize for RawCdr {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(self.0.len())?;
        self.0.iter().try_for_each(|byte| tuple.serialize_element(byte))?;
        tuple.end()
    }
}

/// A publisher of messages that are serialized already, such as a bag's.
pub struct RawPublisher {
    pub(crate) topic: String,
    pub(crate) writer: ros2_client::Publisher<RawCdr>,
    pub(crate) node: Weak<Mutex<ros2_client::Node>>,
    pub(crate) diagnostics: Diagnostics,
}

impl RawPublisher {
    /// The topic's absolute name.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// Publishes a message: its CDR (little-endian) without the encapsulation header. Waits, for a
    /// second at most, while a reliable reader has not yet acknowledged enough of what was sent
    /// before. A message that could not be sent shows in the diagnostics.
    pub async fn publish(&self, body: Vec<u8>) {
        if let Err(error) = self.writer.async_publish(RawCdr::padded(body)).await {
            tracing::warn!("{}: message not sent: {error}", self.topic);
            self.diagnostics.unsent(&self.topic, error.to_string());
        }
    }

    /// Subscriptions that are connected now.
    pub fn subscriptions(&self) -> usize {
        self.node.upgrade().map_or(0, |node| {
            self.writer.get_subscription_count(&node.lock().unwrap_or_else(PoisonError::into_inner))
        })
    }
}

/// A publisher of messages of type `M`.
pub struct Publisher<M> {
    pub(crate) raw: RawPublisher,
    pub(crate) kind: PhantomData<fn(&M)>,
}

impl<M: Message> Publisher<M> {
    /// Publishes a message; see [`RawPublisher::publish`].
    pub async fn publish(&self, message: &M) {
        match cdr_encoding::to_vec::<M, LittleEndian>(message) {
            Ok(body) => self.raw.publish(body).await,
            Err(error) => {
                tracing::warn!("{}: message not serialized: {error}", self.raw.topic);
                self.raw.diagnostics.unsent(&self.raw.topic, error.to_string());
            }
        }
    }

    /// The topic's absolute name.
    pub fn topic(&self) -> &str {
        self.raw.topic()
    }

    /// Subscriptions that are connected now.
    pub fn subscriptions(&self) -> usize {
        self.raw.subscriptions()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn raw_messages_are_padded_and_otherwise_untouched() {
        for length in 0..9_u8 {
            let body: Vec<u8> = (1..=length).collect();
            let wire = cdr_encoding::to_vec::<_, LittleEndian>(&RawCdr::padded(body.clone())).unwrap();
            assert_eq!(wire.len() % 4, 0);
            assert!(wire.len() < body.len() + 4 && wire.starts_with(&body));
            assert!(wire[body.len()..].iter().all(|byte| *byte == 0));
        }
    }
}
