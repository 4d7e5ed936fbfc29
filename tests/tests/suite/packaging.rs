//! What colcon needs of every package.

use std::path::{Path, PathBuf};

/// Folders of the nodes, and of the command line.
fn packages() -> Vec<PathBuf> {
    let nodes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../nodes");
    let folders = std::fs::read_dir(nodes).unwrap().map(|entry| entry.unwrap().path());
    folders.filter(|folder| folder.join("package.xml").exists()).collect()
}

/// colcon-ros-cargo hands every installed crate's source to cargo, which then looks for the workspace that the crate inherits from: in the
/// folder above it, where `install_to_share` puts it.
#[test]
fn every_package_installs_the_manifest_that_it_inherits_from_and_is_built_for_release() {
    let packages = packages();
    assert!(packages.len() >= 8, "{packages:?}");
    for folder in packages {
        let manifest = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        let installed = manifest.lines().find_map(|line| line.strip_prefix("install_to_share = ")).unwrap();
        let files: Vec<String> = serde_json::from_str(installed).unwrap();
        assert!(files.contains(&"../../Cargo.toml".to_owned()), "{}", folder.display());
        for file in files {
            assert!(folder.join(&file).exists(), "{}: {file}", folder.display());
        }
        // Not handed to cargo as a crate that others build on: each cargo would write into Cargo.lock that it is unused.
        assert!(manifest.contains("[package.metadata.ros-env]\ninclude = true\n"), "{}", folder.display());
        let colcon: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(folder.join("colcon.pkg")).unwrap()).unwrap();
        assert_eq!(colcon["cargo-args"], serde_json::json!(["--release"]));
    }
}

/// A node that colcon builds alone carries its own page, not the blind check's with the plant behind it.
#[test]
fn the_diagnosis_on_the_car_links_no_plant() {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let tree = ["tree", "--package", "gripsight_gap_diagnosis", "--edges", "normal", "--prefix", "none"];
    let cargo = std::process::Command::new(env!("CARGO"))
        .args(tree)
        .args(["--locked", "--offline"])
        .current_dir(workspace)
        .output()
        .unwrap();
    let linked = String::from_utf8(cargo.stdout).unwrap();
    assert!(linked.contains("gripsight_report"), "{}", String::from_utf8_lossy(&cargo.stderr));
    for not in ["gripsight_reference_car", "gripsight_withheld", "gripsight_simulator"] {
        assert!(!linked.contains(not), "{linked}");
    }
}
