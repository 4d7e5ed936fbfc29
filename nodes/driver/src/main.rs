//! Node: drives a car around a track on the tires that the identifier publishes. See the README beside this folder.

mod diagnostics;
mod laps;
mod model;
mod node;
mod sets;
mod settings;

fn main() -> anyhow::Result<()> {
    gripsight_runtime::run("driver", include_str!("../README.md"), node::setup)
}
