//! What makes the cases shares no model code with what diagnoses them.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand};

/// Crates that model, identify or diagnose.
const MODELS: [&str; 4] = ["gripsight_vehicle", "gripsight_identification", "gripsight_gap", "gripsight_s4"];
/// Crates that make cases.
const MAKERS: [&str; 2] = ["gripsight_withheld_make", "gripsight_reference_car"];

fn metadata() -> Metadata {
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    MetadataCommand::new().manifest_path(manifest).no_deps().exec().unwrap()
}

fn dependencies(metadata: &Metadata, name: &str) -> Vec<String> {
    let package = metadata.packages.iter().find(|p| p.name.as_str() == name).unwrap();
    let own = package.dependencies.iter().filter(|d| d.kind != DependencyKind::Development);
    own.map(|d| d.name.clone()).collect()
}

/// The bag crate converts the messages of identification, too, and so links its types; hence sources are looked through as well.
#[test]
fn makers_depend_on_no_model_and_models_on_no_maker() {
    let metadata = metadata();
    for maker in MAKERS {
        let own = dependencies(&metadata, maker);
        assert!(
            !own.is_empty() && MODELS.iter().all(|m| !own.contains(&(*m).to_owned())),
            "{maker}: {own:?}"
        );
    }
    for model in MODELS {
        let own = dependencies(&metadata, model);
        assert!(MAKERS.iter().all(|m| !own.contains(&(*m).to_owned())), "{model}: {own:?}");
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
        for name in MODELS.iter().chain(&["identification_messages"]) {
            assert!(!text.contains(name), "{} names {name}", path.display());
        }
    }
}
