//! Who reads what the node publishes.
//!
//! In place of ros2-client's spinner (0.12.1), which counts readers, too, but whether wanted or not subscribes to `/clock` as
//! builtin_interfaces/Time: with two types on one topic, tools of ROS 2 neither show nor record it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use futures::StreamExt as _;
use rustdds::{DomainParticipant, DomainParticipantStatusEvent, GUID, StatusEvented as _};

/// The readers that each writer of this process is connected to. Clones share them.
#[derive(Clone, Debug, Default)]
pub(crate) struct Readers {
    of_writer: Arc<Mutex<BTreeMap<GUID, BTreeSet<GUID>>>>,
}

impl Readers {
    /// How many readers `writer` has now.
    pub(crate) fn of(&self, writer: GUID) -> usize {
        self.known().get(&writer).map_or(0, BTreeSet::len)
    }

    /// How many writers of this process are connected to `reader` now.
    pub(crate) fn writers_of(&self, reader: GUID) -> usize {
        self.known().values().filter(|readers| readers.contains(&reader)).count()
    }

    /// Keeps the readers as `participant` tells of them, for as long as it is polled.
    pub(crate) async fn follow(self, participant: DomainParticipant) {
        let told = participant.status_listener();
        let mut events = std::pin::pin!(told.as_async_status_stream());
        while let Some(event) = events.next().await {
            match event {
                DomainParticipantStatusEvent::RemoteReaderMatched { local_writer, remote_reader } => {
                    self.matched(local_writer, remote_reader);
                }
                DomainParticipantStatusEvent::ReaderLost { guid, .. } => self.lost(guid),
                _ => {}
            }
        }
    }

    fn matched(&self, writer: GUID, reader: GUID) {
        self.known().entry(writer).or_default().insert(reader);
    }

    fn lost(&self, reader: GUID) {
        self.known().values_mut().for_each(|readers| _ = readers.remove(&reader));
    }

    fn known(&self) -> MutexGuard<'_, BTreeMap<GUID, BTreeSet<GUID>>> {
        self.of_writer.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readers_are_counted_once_and_leave_every_writer() {
        let [first, second, reader] = std::array::from_fn(|_| GUID::new_participant_guid());
        let readers = Readers::default();
        for writer in [first, first, second] {
            readers.matched(writer, reader);
        }
        assert_eq!((readers.of(first), readers.of(second), readers.of(reader)), (1, 1, 0));
        assert_eq!((readers.writers_of(reader), readers.writers_of(first)), (2, 0));
        readers.lost(reader);
        assert_eq!((readers.of(first), readers.of(second)), (0, 0));
    }
}
