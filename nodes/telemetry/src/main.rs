//! Node: odometry and drive commands to state sequences. See the README beside this folder.

mod buffer;
mod diagnostics;
mod mapped;
mod node;

fn main() -> anyhow::Result<()> {
    gripsight_runtime::run("telemetry", include_str!("../README.md"), node::setup)
}
