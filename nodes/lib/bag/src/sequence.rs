//! `StateSequence`: the domain's and the message's, in chunks that stay under [`CHUNK_LIMIT_BYTES`].
//!
//! All channels are float32 on both sides and pass bit for bit.

use std::collections::{BTreeMap, VecDeque};

use gripsight_msgs::standard::std_msgs::Header;
use gripsight_msgs::{Handshake, StateSequence as Wire};
use gripsight_signals::{Clock, StateSequence};

use crate::{Bag, BagError, decode, encode, from_cdr};

/// No chunk is longer: under 64 KB a message is one datagram on the loopback. Two of 150 KB in a row, each within a default receive
/// buffer (208 KiB) of its own, overran that of a CycloneDDS reader, and the second never arrived.
pub const CHUNK_LIMIT_BYTES: usize = 60_000;
/// Sequences that a [`Reassembler`] holds open or remembers as done.
const KEPT: usize = 16;

/// A sequence as it travelled, with the run it belongs to.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedSequence {
    /// The sender's run and seed; `sequence_id` is the sequence's.
    pub handshake: Handshake,
    /// The sequence, every channel as sent.
    pub sequence: StateSequence,
}

/// The messages that carry a sequence. `handshake.sequence_id` is replaced by the sequence's own; `frame_id` names the frame of
/// its pose.
#[must_use]
pub fn sequence_to_messages(sequence: &StateSequence, handshake: &Handshake, frame_id: &str) -> Vec<Wire> {
    let channels = sequence.table();
    let values: usize = channels.iter().map(|(_, values)| values.len()).sum();
    let texts = frame_id.len() + handshake.run_id.len() + handshake.vehicle_hash.len();
    // A share of each clock's stamps goes into each part; a share that does not divide evenly is one value longer, and so is padding.
    let room = CHUNK_LIMIT_BYTES.saturating_sub(texts + 512 + 2 * size_of::<f32>() * channels.len());
    let chunks = (size_of::<f32>() * values).div_ceil(room.max(1)).max(1);
    let header = Header { stamp: encode::time(sequence.start_stamp_ns), frame_id: frame_id.to_owned() };
    let handshake = Handshake { sequence_id: sequence.sequence_id, ..handshake.clone() };
    let part = |chunk: usize| {
        let range = |clock: Clock| {
            let len = sequence.stamps_s(clock).len();
            chunk * len / chunks..(chunk + 1) * len / chunks
        };
        let mut message = Wire {
            header: header.clone(),
            handshake: handshake.clone(),
            chunk: chunk as u32,
            chunks: chunks as u32,
            ..Wire::default()
        };
        for (to, (channel, from)) in message.channels_mut().into_iter().zip(&channels) {
            *to = from.get(range(channel.clock)).unwrap_or_default().to_vec();
        }
        message
    };
    (0..chunks).map(part).collect()
}

/// Puts sequences together from chunks that may be lost, late, repeated or mixed with other sequences'.
#[derive(Debug, Clone, Default)]
pub struct Reassembler {
    open: VecDeque<Open>,
    done: VecDeque<Key>,
}

/// What tells sequences apart: the sender's run, and the sequence's number.
type Key = (String, u64);

#[derive(Debug, Clone)]
struct Open {
    key: Key,
    chunks: u32,
    parts: BTreeMap<u32, Wire>,
}

impl Reassembler {
    /// Takes a chunk; gives the sequence that it completes. A sequence already given is not given again until [`Self::clear`];
    /// the oldest of more than sixteen incomplete ones is forgotten.
    ///
    /// # Errors
    /// [`BagError::Chunk`] for a number out of range, [`BagError::Samples`] where the channels do not fit together.
    pub fn push(&mut self, message: Wire) -> Result<Option<RecordedSequence>, BagError> {
        let key = (message.handshake.run_id.clone(), message.handshake.sequence_id);
        let (chunk, chunks) = (message.chunk, message.chunks);
        if chunk >= chunks {
            return Err(BagError::Chunk { sequence_id: key.1, chunk, chunks });
        }
        if self.done.contains(&key) {
            return Ok(None);
        }
        let place = self.open.iter().position(|o| o.key == key && o.chunks == chunks);
        let mut open = place.and_then(|place| self.open.remove(place)).unwrap_or_else(|| Open {
            key,
            chunks,
            parts: BTreeMap::new(),
        });
        open.parts.entry(chunk).or_insert(message);
        if open.parts.len() < chunks as usize {
            push_bounded(&mut self.open, open);
            return Ok(None);
        }
        push_bounded(&mut self.done, open.key);
        let joined = join(open.parts.into_values());
        joined.sequence.check()?;
        Ok(Some(joined))
    }

    /// Forgets everything: after the clock jumped back, the same sequences may come again.
    pub fn clear(&mut self) {
        self.open.clear();
        self.done.clear();
    }
}

fn push_bounded<T>(queue: &mut VecDeque<T>, item: T) {
    queue.push_back(item);
    if queue.len() > KEPT {
        queue.pop_front();
    }
}

fn join(parts: impl Iterator<Item = Wire>) -> RecordedSequence {
    let mut whole = Wire::default();
    for mut part in parts {
        if part.chunk == 0 {
            (whole.header, whole.handshake) = (part.header.clone(), part.handshake.clone());
        }
        for (to, from) in whole.channels_mut().into_iter().zip(part.channels_mut()) {
            to.append(from);
        }
    }
    let mut sequence = StateSequence {
        sequence_id: whole.handshake.sequence_id,
        start_stamp_ns: decode::stamp_ns(whole.header.stamp),
        ..StateSequence::default()
    };
    for ((_, to), from) in sequence.table_mut().into_iter().zip(whole.channels_mut()) {
        std::mem::swap(to, from);
    }
    RecordedSequence { handshake: whole.handshake, sequence }
}

/// The sequences recorded under a topic in the order in which they became whole, and where the bag is cut off.
pub(crate) fn read_recorded(
    bag: &Bag,
    topic: &str,
) -> Result<(Vec<RecordedSequence>, Option<String>), BagError> {
    let mut reassembler = Reassembler::default();
    let mut sequences = Vec::new();
    let mut index = 0;
    for message in bag.messages() {
        let message = match message {
            Ok(message) => message,
            Err(error @ BagError::Truncated { .. }) => return Ok((sequences, Some(error.to_string()))),
            Err(error) => return Err(error),
        };
        if message.channel.topic != topic {
            continue;
        }
        let whole = from_cdr(&message.data).and_then(|part| reassembler.push(part));
        sequences.extend(whole.map_err(|error| error.in_message(topic, index, message.log_time))?);
        index += 1;
    }
    if sequences.is_empty() {
        return Err(BagError::Empty { path: bag.path().to_owned() });
    }
    Ok((sequences, None))
}

/// The recorded `StateSequence`s of a bag with their handshakes; see [`crate::TopicMap::sequence`] for choosing the topic. Empty
/// where the bag has no such topic.
///
/// # Errors
/// [`BagError`]; a truncated bag gives the sequences that are whole.
pub fn read_recorded_sequences(
    bag: &Bag,
    topics: &crate::TopicMap,
) -> Result<Vec<RecordedSequence>, BagError> {
    match topics.resolve_sequence(bag)? {
        Some(topic) => read_recorded(bag, &topic).map(|(sequences, _)| sequences),
        None => Ok(Vec::new()),
    }
}
