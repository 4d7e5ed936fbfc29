//! Node: an MCAP bag to its topics and /clock.

fn main() {}
