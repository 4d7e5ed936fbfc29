//! Everything that reads a bag, on bytes that stand in a file.

use std::cell::RefCell;
use std::path::PathBuf;

use gripsight_bag::{Bag, TopicMap, info, propose, read_sequences};
use gripsight_signals::WindowConfig;

thread_local! {
    static FOLDER: RefCell<Option<tempfile::TempDir>> = const { RefCell::new(None) };
}

fn at(name: &str) -> PathBuf {
    FOLDER.with_borrow_mut(|folder| {
        folder.get_or_insert_with(|| tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap()).path().join(name)
    })
}

/// Any of them may refuse; none may panic, hang, or take memory that the file is not worth.
pub fn read(name: &str, bytes: &[u8]) {
    let path = at(name);
    std::fs::write(&path, bytes).unwrap();
    if let Ok(bag) = Bag::open(&path) {
        let read = bag.messages().count();
        assert!(read <= 1000 * bytes.len() + 1000, "{read} messages of {} bytes", bytes.len());
    }
    let whole = WindowConfig { length_s: f64::INFINITY, hop_s: f64::INFINITY };
    drop(read_sequences(&path, &TopicMap::default(), whole));
    drop(info(&path, &TopicMap::default()));
    drop(propose(&path));
}
