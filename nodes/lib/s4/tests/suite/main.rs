//! Tests of the crate through its public interface.

#![allow(clippy::unwrap_used, reason = "helpers of tests, not only test functions, may fail")]

mod errors;
mod golden;
mod gradients;
mod plant;
mod streaming;
mod training;
