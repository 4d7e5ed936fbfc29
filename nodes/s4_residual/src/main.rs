//! Node: state sequences and a candidate to a learned residual model. See the README beside this folder.

mod diagnostics;
mod live;
mod node;
mod recent;

fn main() -> anyhow::Result<()> {
    gripsight_runtime::run("s4_residual", include_str!("../README.md"), node::setup)
}
