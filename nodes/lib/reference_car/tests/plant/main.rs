//! Tests of the reference car as a whole: one binary.

// Helpers of tests may fail like the tests themselves.
#![allow(clippy::unwrap_used)]

mod effects;
mod independence;
mod oracle;
mod physics;
mod recording;
mod single_track;
