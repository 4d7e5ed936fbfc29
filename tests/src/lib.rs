//! Helpers of the topic-level tests: processes that end with their test, a DDS domain of their
//! own, peers that share no code with the suite, and messages whose every field is known.

#![expect(clippy::expect_used, reason = "a test that cannot go on should say so and stop")]

pub mod domain;
pub mod peers;
pub mod process;
pub mod samples;
