//! Tests of `gripsight_bag` from outside.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "helpers of tests, not only test functions, may fail"
)]

mod errors;
mod health;
mod hostile;
mod inject;
mod peers;
mod recorded;
mod round_trip;
mod sequences;
mod sqlite;
mod support;
