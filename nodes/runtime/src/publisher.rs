//! Publishers: messages are serialized here, once, and padded.
//!
//! RustDDS 0.15.1 sends a malformed last fragment when a fragmented sample's length, with the four
//! bytes of the encapsulation header, is not a multiple of 4; CycloneDDS then drops the sample.
//! Zero bytes after the message, which readers ignore, make the length a multiple of 4.

use std::marker::PhantomData;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use byteorder::LittleEndian;
use gripsight_msgs::Message;
use serde::ser::{Serialize, SerializeTuple, Serializer};

use crate::diagnostics::Diagnostics;
use crate::readers::Readers;

/// Where the last message waited in vain the next one waits so much less: a reader that never makes room shall not slow the loop message by
/// message.
const IMPATIENT: u32 = 100;

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
    pub(crate) readers: Readers,
    pub(crate) diagnostics: Diagnostics,
    /// A message waits this long for room; RustDDS 0.15.1 looks at its own limit only when there is room.
    pub(crate) patience: Duration,
    /// The last message found no room.
    pub(crate) is_full: AtomicBool,
}

impl RawPublisher {
    /// The topic's absolute name.
    pub fn topic(&self) -> &str {
        &self.topic
    }

    /// Publishes a message: its CDR (little-endian) without the encapsulation header. Waits, for as long as
    /// its [`Qos`](crate::Qos) has patience, while a reliable reader has not yet acknowledged enough of what was sent
    /// before; one that acknowledges nothing then loses the oldest. A message that could not be sent shows in the diagnostics.
    pub async fn publish(&self, body: Vec<u8>) {
        let is_full = self.is_full.load(Ordering::Relaxed);
        let patience = if is_full { self.patience / IMPATIENT } else { self.patience };
        let sent = within(patience, self.writer.async_publish(RawCdr::padded(body))).await;
        self.is_full.store(sent.is_err(), Ordering::Relaxed);
        if let Err(reason) = sent {
            tracing::warn!("{}: message not sent: {reason}", self.topic);
            self.diagnostics.unsent(&self.topic, reason);
        }
    }

    /// Subscriptions that are connected now.
    pub fn subscriptions(&self) -> usize {
        self.readers.of(self.writer.guid())
    }
}

/// The end of `sending`, or that it took too long, so that no reader can hold a node's loop up for good.
async fn within<E: std::fmt::Display>(
    patience: Duration,
    sending: impl Future<Output = Result<(), E>>,
) -> Result<(), String> {
    match tokio::time::timeout(patience, sending).await {
        Ok(sent) => sent.map_err(|error| error.to_string()),
        Err(_) => Err(format!("its readers have made no room for {} s", patience.as_secs_f64())),
    }
}

/// A publisher of messages of type `M`.
pub struct Publisher<M> {
    pub(crate) raw: RawPublisher,
    pub(crate) kind: PhantomData<fn(&M)>,
}

impl<M: Message> Publisher<M> {
    /// Publishes a message as [`RawPublisher::publish`] does.
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

    #[tokio::test]
    async fn readers_that_never_make_room_cost_a_message_and_no_more() {
        let never = std::future::pending::<Result<(), String>>();
        let reason = within(Duration::from_millis(10), never).await.unwrap_err();
        assert!(reason.contains("0.01 s"), "{reason}");
        assert_eq!(within(Duration::from_secs(1), async { Err("full") }).await, Err("full".to_owned()));
    }

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
