#![no_main]
//! A type's text, and a message that is read by it; a byte 0 parts them.

use gripsight_bag::dynamic::{Reader, Schema};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let Ok(text) = std::str::from_utf8(&bytes[..end]) else { return };
    let message = bytes.get(end + 1..).unwrap_or_default();
    let Ok(layout) = Schema::parse("p/msg/A", text) else { return };
    let Ok(paths) = layout.numbers().iter().map(|path| path.parse()).collect() else { return };
    if let Ok(reader) = Reader::new(layout, paths) {
        drop(reader.read(message));
    }
});
