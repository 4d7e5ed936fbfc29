//! A message that cannot be read costs itself, not the bag.

use std::fmt;

use serde::Serialize;

use crate::BagError;

/// Messages of a topic whose bytes are none of its type.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Unreadable {
    /// The topic.
    pub topic: String,
    /// How many there are: fewer than were read.
    pub messages: usize,
    /// The first of them, and what is wrong with it.
    pub first: String,
}

impl fmt::Display for Unreadable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = match self.messages {
            1 => "a message that cannot be read is".to_owned(),
            n => format!("{n} messages that cannot be read are"),
        };
        write!(f, "{}: {count} left out (first: {})", self.topic, self.first)
    }
}

/// What of a topic has been read and what could not be.
#[derive(Debug)]
pub struct Reading {
    topic: String,
    read: usize,
    unreadable: usize,
    first: Option<BagError>,
}

impl Reading {
    /// Nothing yet of a topic.
    #[must_use]
    pub fn new(topic: &str) -> Self {
        Self { topic: topic.to_owned(), read: 0, unreadable: 0, first: None }
    }

    /// Counts a message; `None` where it is left out.
    pub fn take<T>(&mut self, log_time_ns: u64, message: Result<T, BagError>) -> Option<T> {
        match message {
            Ok(message) => {
                self.read += 1;
                Some(message)
            }
            Err(error) => {
                let index = self.read + self.unreadable;
                self.first.get_or_insert_with(|| error.in_message(&self.topic, index, log_time_ns));
                self.unreadable += 1;
                None
            }
        }
    }

    /// What was left out.
    ///
    /// # Errors
    /// The first error, where as many messages could not be read as could: then the topic is another one than it seems.
    pub fn done(self) -> Result<Option<Unreadable>, BagError> {
        match self.first {
            Some(error) if self.unreadable >= self.read => Err(error),
            Some(error) => {
                let (topic, messages) = (self.topic, self.unreadable);
                Ok(Some(Unreadable { topic, messages, first: error.to_string() }))
            }
            None => Ok(None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_that_cannot_be_read_are_left_out_and_as_many_as_can_end_the_reading() {
        let bad = || Err(BagError::NoEncapsulation { len: 2 });
        let mut reading = Reading::new("/camera");
        assert_eq!(reading.take(1_000_000_000, Ok(7)), Some(7));
        assert_eq!(reading.take::<i32>(2_000_000_000, bad()), None);
        assert_eq!(reading.take(3_000_000_000, Ok(8)), Some(8));
        let left_out = reading.done().unwrap().unwrap();
        assert_eq!((&left_out.topic[..], left_out.messages), ("/camera", 1));
        let text = left_out.to_string();
        assert!(text.starts_with("/camera: a message that cannot be read is left out (first: "), "{text}");
        assert!(text.contains("message 1 "), "{text}");

        let mut reading = Reading::new("/camera");
        reading.take(1, Ok(7));
        reading.take::<i32>(2, bad());
        assert!(matches!(reading.done(), Err(BagError::Message { index: 1, .. })));
        assert!(Reading::new("/camera").done().unwrap().is_none());
    }
}
