//! Topic-level tests: real processes, real DDS peers, real time.

mod bag_player;
mod runtime;
