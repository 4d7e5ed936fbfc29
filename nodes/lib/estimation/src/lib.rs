//! Fitting a car model to windows of a recording, for identification and diagnosis alike.
//!
//! [`shooting`] is the least-squares engine: windows with free starts, exact derivatives, priors. [`split`] cuts a recording into windows, blocks
//! of windows and folds of blocks; [`by_block`] and [`bootstrap`] turn errors of rollouts into figures with intervals. [`selection`] compares all
//! subsets of many candidate terms on one linearisation. Nothing here knows an effect by name: what is fitted is a [`gripsight_model::Rollout`].

mod evaluate;
pub mod selection;
pub mod shooting;
mod windows;

pub use evaluate::{Estimate, Score, bootstrap, by_block, interval, mean, of_picked};
pub use windows::{HORIZON_S, Split, Windows, of_length, split};
