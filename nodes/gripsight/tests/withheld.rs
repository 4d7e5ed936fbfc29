//! The blind check from end to end on a small batch, as a user runs it.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

/// Cases of the small batch, and their length.
const CASES: usize = 12;
const DURATION_S: &str = "12";

fn gripsight(folder: &Path, arguments: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gripsight"))
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .env_remove("RUST_LOG")
        .output()
        .unwrap()
}

fn done(folder: &Path, arguments: &str) -> String {
    let output = gripsight(folder, arguments);
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn refused(folder: &Path, arguments: &str) -> String {
    let output = gripsight(folder, arguments);
    assert_eq!(output.status.code(), Some(1), "{arguments}");
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn a_small_batch_is_made_diagnosed_and_scored() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    done(
        folder,
        &format!(
            "withheld make --cases {CASES} --seed 5 --pool development --duration {DURATION_S} --out cases --labels labels.json"
        ),
    );
    assert!(
        refused(folder, "withheld score cases verdicts --labels labels.json --out report")
            .contains("withheld diagnose")
    );
    done(folder, "withheld diagnose cases --out verdicts");

    // Stopped after all but one case: only that one is diagnosed again.
    let kept = folder.join("verdicts/case_0001/gap.json");
    let stamp = fs::metadata(&kept).unwrap().modified().unwrap();
    fs::remove_file(folder.join("verdicts/case_0002/gap.json")).unwrap();
    done(folder, "withheld diagnose cases --out verdicts");
    assert_eq!(fs::metadata(&kept).unwrap().modified().unwrap(), stamp);

    let text = done(folder, "withheld score cases verdicts --labels labels.json --out report");
    assert!(text.contains("reference: 12 cases") && text.contains("false alarms"), "{text}");
    let score: Value =
        serde_json::from_str(&fs::read_to_string(folder.join("report/score.json")).unwrap()).unwrap();
    let family = &score["scores"]["families"][0];
    let alarms =
        family["lines"].as_array().unwrap().iter().find(|l| l["what"].as_str().unwrap().contains("false"));
    assert_eq!(alarms.unwrap()["rate"]["of"], 3);
    let answers = fs::read_to_string(folder.join("report/answers.jsonl")).unwrap();
    assert_eq!(answers.lines().count(), CASES);
    assert!(!answers.contains("\"failed\""), "{answers}");
    let page = fs::read_to_string(folder.join("report/report.html")).unwrap();
    assert!(page.contains("<svg") && page.contains("Shrinkage") && !page.contains("NaN"));

    let labels = fs::read_to_string(folder.join("labels.json")).unwrap();
    fs::write(folder.join("labels.json"), labels.replacen("\"seed\":5", "\"seed\":6", 1)).unwrap();
    let error = refused(folder, "withheld score cases verdicts --labels labels.json --out report");
    assert!(error.contains("is not the file that cases/commitment.txt was made for"), "{error}");
}

/// As tests/results/simulators says, with a Python named from the folder that the command runs in.
#[test]
fn pairs_of_simulator_and_car_are_made_diagnosed_and_scored() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap();
    if !root.join(".venv/bin/python").exists() {
        println!("skipped: no .venv here; launch_scripts/setup.sh --tests makes it");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::os::unix::fs::symlink(root.join(".venv"), folder.join(".venv")).unwrap();
    let maker = root.join("tests/plants/make_simulator_pairs.py");
    let make = format!(
        "withheld make --simulators 2 --simulator-maker {} --python .venv/bin/python --duration 10 --seed 1 --out pairs --labels labels.json",
        maker.display()
    );
    done(folder, &make);
    done(folder, "withheld diagnose pairs --out verdicts");
    let text =
        done(folder, "withheld score pairs verdicts --labels labels.json --no-oracle --so-far --out report");
    // One unchanged pair, one with a structure that ten seconds may be too short for.
    assert!(text.contains("simulator and car: 2 pairs") && text.contains("right, slipx: 1/1"), "{text}");
}

#[test]
fn what_would_break_the_seal_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let make = "withheld make --cases 1 --seed 1 --duration 10";
    assert!(
        refused(folder, &format!("{make} --out cases --labels cases/labels.json"))
            .contains("among the cases")
    );
    done(folder, &format!("{make} --out cases --labels labels.json"));
    assert!(refused(folder, &format!("{make} --out cases --labels other.json")).contains("sealed batch"));
    assert!(
        refused(folder, &format!("{make} --out others --labels labels.json")).contains("another label file")
    );
    assert!(refused(folder, "withheld diagnose others --out v").contains("commitment.txt"));
}
