//! Node: a bag to its topics and `/clock`. See the README beside this folder.

mod diagnostics;
mod node;
mod pace;
mod source;

fn main() -> anyhow::Result<()> {
    gripsight_runtime::run("bag_player", include_str!("../README.md"), node::setup)
}
