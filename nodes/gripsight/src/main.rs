//! The command line: identify, diagnose, friction, simulate, withheld, bag.

fn main() {}
