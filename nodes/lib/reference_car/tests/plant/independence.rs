//! The plant shares no code with what is tested on it.

use std::collections::BTreeSet;

use cargo_metadata::{DependencyKind, MetadataCommand};

/// Crates that model, identify or diagnose.
const TESTED: [&str; 6] = [
    "gripsight_vehicle",
    "gripsight_model",
    "gripsight_estimation",
    "gripsight_identification",
    "gripsight_diagnosis",
    "gripsight_s4",
];

#[test]
fn it_depends_on_nothing_that_is_tested_on_it() {
    // Only crates of this workspace can lead to another one, so the registry need not be asked.
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    let metadata = MetadataCommand::new().manifest_path(manifest).no_deps().exec().unwrap();
    let mut waiting = vec!["gripsight_reference_car".to_owned()];
    let mut seen = BTreeSet::new();
    while let Some(name) = waiting.pop() {
        let package = metadata.packages.iter().find(|p| p.name.as_str() == name);
        if !seen.insert(name.clone()) || package.is_none() {
            continue;
        }
        let own = seen.len() == 1;
        // Its own tests count too; those of its dependencies do not.
        let dependencies = package.unwrap().dependencies.iter();
        waiting.extend(
            dependencies.filter(|d| own || d.kind != DependencyKind::Development).map(|d| d.name.clone()),
        );
    }
    assert!(seen.contains("rand_chacha"), "the walk over the dependencies is broken: {seen:?}");
    for tested in TESTED {
        assert!(metadata.packages.iter().any(|p| p.name.as_str() == tested), "there is no crate {tested}");
        assert!(!seen.contains(tested), "the reference car depends on {tested}");
    }
}
