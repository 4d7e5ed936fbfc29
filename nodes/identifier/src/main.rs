//! Node: residual models and a friction prior to Pacejka parameters. See the README beside this folder.

mod controller;
mod diagnostics;
mod memory;
mod node;
mod outputs;
mod own_tires;
mod run;
mod watch;

fn main() -> anyhow::Result<()> {
    gripsight_runtime::run("identifier", include_str!("../README.md"), node::setup)
}
