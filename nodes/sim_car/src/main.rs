//! Node: the reference car, live on topics. See the README beside this folder.

mod diagnostics;
mod node;
mod settings;

fn main() -> anyhow::Result<()> {
    gripsight_runtime::run("sim_car", include_str!("../README.md"), node::setup)
}
