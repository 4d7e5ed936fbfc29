//! A simulator as a child process, sound and broken.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

mod adapters;
mod child;
mod export;
mod pages;
mod support;
