//! Node: the car's topics with faults, for tests. See the README beside this folder.

mod diagnostics;
mod fault;
mod node;
mod plan;
mod signal;
mod stream;

fn main() -> anyhow::Result<()> {
    gripsight_runtime::run("fault_injector", include_str!("../README.md"), node::setup)
}
