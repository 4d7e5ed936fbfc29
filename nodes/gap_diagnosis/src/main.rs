//! Node: where model and car disagree, and why.

fn main() {}
