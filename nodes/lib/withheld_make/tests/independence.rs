//! What makes the cases shares no model code with what diagnoses them.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand};

/// Crates that model, identify or diagnose.
const MODELS: [&str; 6] = [
    "gripsight_vehicle",
    "gripsight_model",
    "gripsight_estimation",
    "gripsight_identification",
    "gripsight_diagnosis",
    "gripsight_s4",
];
/// Crates that make cases.
const MAKERS: [&str; 2] = ["gripsight_withheld_make", "gripsight_reference_car"];

/// The packages of this workspace that `name` needs, directly or through others.
fn needed(metadata: &Metadata, name: &str) -> BTreeSet<String> {
    let package = metadata.packages.iter().find(|p| p.name.as_str() == name).unwrap();
    let own =
        package.dependencies.iter().filter(|d| d.kind != DependencyKind::Development && d.path.is_some());
    let mut found = BTreeSet::new();
    for dependency in own {
        found.extend(needed(metadata, &dependency.name));
        found.insert(dependency.name.clone());
    }
    found
}

#[test]
fn makers_need_no_model_and_models_no_maker() {
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    let metadata = MetadataCommand::new().manifest_path(manifest).no_deps().exec().unwrap();
    for maker in MAKERS {
        let found = needed(&metadata, maker);
        assert!(
            found.contains("gripsight_signals") && MODELS.iter().all(|m| !found.contains(*m)),
            "{maker}: {found:?}"
        );
    }
    for model in MODELS {
        let found = needed(&metadata, model);
        assert!(MAKERS.iter().all(|m| !found.contains(*m)), "{model}: {found:?}");
    }
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn the_makers_sources_name_no_model() {
    let lib = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    let mut found = Vec::new();
    for folder in ["withheld_make/src", "reference_car/src"] {
        sources(&lib.join(folder), &mut found);
    }
    assert!(found.len() > 30);
    for path in found {
        let text = fs::read_to_string(&path).unwrap();
        for name in MODELS {
            assert!(!text.contains(name), "{} names {name}", path.display());
        }
    }
}
