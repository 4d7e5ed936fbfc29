//! The bag's messages, read and unpacked on a thread of its own, ahead of the player.

use gripsight_bag::{Bag, BagError};
use tokio::sync::mpsc;

/// Messages read ahead.
const READ_AHEAD: usize = 512;

/// Length of the encapsulation header in front of a message's CDR.
const HEADER_LENGTH: usize = 4;

/// A message of the bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Recorded {
    pub(crate) topic: String,
    /// When it was recorded (ns).
    pub(crate) log_time_ns: u64,
    /// CDR, little-endian, without the encapsulation header; `None` when it is not that.
    pub(crate) body: Option<Vec<u8>>,
}

/// Starts to read `bag`. An error comes last, after everything that could be read.
pub(crate) fn read(bag: Bag) -> mpsc::Receiver<Result<Recorded, BagError>> {
    let (sender, receiver) = mpsc::channel(READ_AHEAD);
    tokio::task::spawn_blocking(move || {
        for message in bag.messages() {
            let recorded = message.map(|message| Recorded {
                topic: message.channel.topic.clone(),
                log_time_ns: message.log_time,
                body: body(&message.data),
            });
            if sender.blocking_send(recorded).is_err() {
                break;
            }
        }
    });
    receiver
}

fn body(data: &[u8]) -> Option<Vec<u8>> {
    match data {
        [0, 1, _, _, ..] => Some(data[HEADER_LENGTH..].to_vec()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_little_endian_cdr_has_a_body() {
        assert_eq!(body(&[0, 1, 0, 0, 7, 8]), Some(vec![7, 8]));
        assert_eq!(body(&[0, 1, 0, 0]), Some(vec![]));
        for wrong in [&[0, 0, 0, 0, 7][..], &[0, 7, 0, 0], &[0, 1, 0], &[]] {
            assert_eq!(body(wrong), None);
        }
    }
}
