//! Node: residual models and a friction prior to Pacejka parameters.

fn main() {}
