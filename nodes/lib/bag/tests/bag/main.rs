//! Tests of `gripsight_bag` from outside.

mod errors;
mod hostile;
mod inject;
mod peers;
mod recorded;
mod round_trip;
mod sequences;
mod support;
