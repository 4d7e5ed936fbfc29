//! Tests of the reference car as a whole: one binary.

mod effects;
mod independence;
mod oracle;
mod physics;
mod recording;
mod single_track;
