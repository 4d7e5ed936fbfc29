//! The last few of what came by, by key: messages may come late, twice, or after a restart of the other side.

use std::collections::VecDeque;
use std::sync::Arc;

/// Keeps the newest `capacity` values; a value put again under its key replaces the old one.
#[derive(Debug)]
pub(crate) struct Recent<K, V> {
    capacity: usize,
    entries: VecDeque<(K, Arc<V>)>,
}

impl<K: PartialEq, V> Recent<K, V> {
    pub(crate) fn new(capacity: usize) -> Self {
        Self { capacity, entries: VecDeque::new() }
    }

    pub(crate) fn put(&mut self, key: K, value: V) {
        self.entries.retain(|(k, _)| *k != key);
        self.entries.push_back((key, Arc::new(value)));
        if self.entries.len() > self.capacity {
            self.entries.pop_front();
        }
    }

    pub(crate) fn get(&self, key: &K) -> Option<Arc<V>> {
        self.entries.iter().find(|(k, _)| k == key).map(|(_, v)| Arc::clone(v))
    }

    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_goes_first_and_a_key_stands_once() {
        let mut recent = Recent::new(2);
        recent.put(1, "a");
        recent.put(2, "b");
        recent.put(1, "c");
        recent.put(3, "d");
        assert_eq!((recent.get(&1).as_deref(), recent.get(&2), recent.len()), (Some(&"c"), None, 2));
    }
}
