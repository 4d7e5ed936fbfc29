//! Node: road pictures to a friction prior. See the README beside this folder.

mod diagnostics;
mod lesson;
mod node;
mod pace;
mod settings;

fn main() -> anyhow::Result<()> {
    gripsight_runtime::run("camera_prior", include_str!("../README.md"), node::setup)
}
