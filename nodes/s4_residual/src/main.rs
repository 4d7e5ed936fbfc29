//! Node: state sequences and a candidate to a learned residual model.

fn main() {}
