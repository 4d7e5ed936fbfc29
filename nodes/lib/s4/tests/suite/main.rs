//! Tests of the crate through its public interface.

mod errors;
mod golden;
mod gradients;
mod plant;
mod streaming;
mod training;
