//! Node: road pictures to a friction prior.

fn main() {}
