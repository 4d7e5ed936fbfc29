//! Node: the reference car, live on topics.

fn main() {}
