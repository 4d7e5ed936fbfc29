//! Node: odometry and steering to state sequences.

fn main() {}
