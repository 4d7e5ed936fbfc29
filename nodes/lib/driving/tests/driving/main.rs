//! The driver on a car of its own model, and on the reference car.

#![allow(clippy::unwrap_used)]

mod closed;
mod predictive;
mod reference;
mod table;
