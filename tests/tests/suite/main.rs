//! Topic-level tests: real processes, real DDS peers, real time.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop")]

mod bag_player;
mod camera_prior;
mod controller;
mod driver;
mod fault_injector;
mod gap_diagnosis;
mod guard;
mod hostile;
mod identification;
mod packaging;
mod parameters;
mod restart;
mod ros2;
mod runtime;
mod sim_car;
mod whole_suite;
