//! Node: where the model in use and the real car disagree, and why. See the README beside this folder.

mod diagnostics;
mod message;
mod node;
mod report;

fn main() -> anyhow::Result<()> {
    gripsight_runtime::run("gap_diagnosis", include_str!("../README.md"), node::setup)
}
