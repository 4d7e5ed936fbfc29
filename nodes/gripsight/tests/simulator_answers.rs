//! Damaged answers of a user's simulator: each is answered by an error or taken, in bounded memory, and the next one is asked for as before.

#![allow(clippy::unwrap_used, reason = "helpers of tests, not only test functions, may fail")]

use std::fs;
use std::io::Cursor;
use std::path::Path;
use std::time::Instant;

use gripsight_mutants::{Mutants, bombs, peak_memory_mb};
use gripsight_simulator::wire::Batch;
use gripsight_simulator::{Roll as _, Simulator, SimulatorError, SimulatorFile};
use ndarray::{Array1, Array2, Array3};
use ndarray_npy::NpzWriter;
use serde_json::json;

/// What a test may hold (MB).
const MOST_MB: f64 = 400.0;

/// Answers whatever it is asked with what lies in a file.
const PARROT: &str = r#"
import os, socket, struct
line = socket.socket(socket.AF_UNIX)
line.connect(os.environ["GRIPSIGHT_SOCKET"])
stream = line.makefile("rwb")
while head := stream.read(8):
    stream.read(struct.unpack("<Q", head)[0])
    with open("answer", "rb") as file:
        answer = file.read()
    stream.write(struct.pack("<Q", len(answer)) + answer)
    stream.flush()
"#;

fn description() -> serde_json::Value {
    json!({
        "name": "parrot", "step_s": 0.01, "states": ["v_x_mps", "v_y_mps", "yaw_rate_radps"],
        "inputs": [{"name": "steering", "kind": "steering_angle"}], "outputs": ["v_x_mps", "v_y_mps", "yaw_rate_radps"],
        "parameters": [{"name": "mass", "value": 3.5, "low": 1.0, "high": 9.0}], "imposes_v_x": true, "lacks": [],
    })
}

/// An answer's archive: its header, and arrays beside it.
fn archive(header: &str, outputs: Option<&Array3<f64>>) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut archive = NpzWriter::new(&mut bytes);
    archive.add_array("header", &Array1::from_vec(header.as_bytes().to_vec())).unwrap();
    if let Some(outputs) = outputs {
        archive.add_array("outputs", outputs).unwrap();
    }
    archive.finish().unwrap();
    bytes.into_inner()
}

fn described(header: &str) -> Vec<u8> {
    archive(header, None)
}

fn file(folder: &Path) -> SimulatorFile {
    fs::write(folder.join("parrot.py"), PARROT).unwrap();
    SimulatorFile::parse("command: [python3, parrot.py]\nprocesses: 1\ntime_limit_s: 10", folder).unwrap()
}

fn first(value: &serde_json::Value) -> String {
    json!({"version": 1, "id": 1, "kind": "description", "description": value}).to_string()
}

fn start(folder: &Path) -> Simulator {
    fs::write(folder.join("answer"), described(&first(&description()))).unwrap();
    Simulator::start(&file(folder)).unwrap()
}

fn batch() -> Batch {
    Batch {
        parameters: Array2::from_elem((2, 1), 3.5),
        commands: Array3::zeros((1, 5, 1)),
        place_steps: Array1::from_vec(vec![0]),
        motions: Array3::zeros((1, 1, 3)),
        v_x_mps: None,
        kicks: None,
        output_steps: Array1::from_iter(0..6),
    }
}

fn assert_said(error: &SimulatorError) {
    let text = error.to_string();
    assert!(text.len() < 6000, "{} bytes of text: {text:.300}", text.len());
}

fn assert_held(what: &str, count: usize, refused: usize, start: Instant) {
    let held_mb = peak_memory_mb();
    println!(
        "{what}: {count} mutants in {:.1?}, {refused} refused, held at most {held_mb:?} MB",
        start.elapsed()
    );
    assert!(held_mb.is_none_or(|held_mb| held_mb < MOST_MB), "{held_mb:?} MB");
}

#[test]
fn a_mutated_answer_to_a_rollout_is_refused_or_taken() {
    let folder = tempfile::tempdir().unwrap();
    let (simulator, batch) = (start(folder.path()), batch());
    let outputs = Array3::from_shape_fn((2, 6, 3), |(b, k, c)| (b + k + c) as f64 / 7.0);
    // The first request was for the description.
    let whole = |k: usize| {
        let header = json!({"version": 1, "id": k + 2, "kind": "outputs"}).to_string();
        archive(&header, Some(&outputs))
    };
    let (mut mutants, mut refused, begin) = (Mutants::new(0x517), 0, Instant::now());
    let count = Mutants::count(1500);
    for k in 0..count {
        let mut bytes = whole(k);
        if k > 0 {
            bytes = mutants.binary(&bytes, 0, usize::MAX);
            for _ in 0..mutants.below(3) {
                mutants.length(&mut bytes);
            }
        }
        fs::write(folder.path().join("answer"), bytes).unwrap();
        match simulator.rollout(&batch) {
            Ok(seen) => assert_eq!(seen.shape(), [2, 6, 3]),
            Err(error) => {
                assert!(k > 0, "{error}");
                refused += 1;
                assert_said(&error);
                assert!(matches!(error, SimulatorError::Answer { .. }), "{error}");
            }
        }
    }
    assert!(refused > count / 2);
    assert_held("a simulator's outputs (.npz)", count, refused, begin);
}

/// Each starts a process.
#[test]
fn a_mutated_description_is_refused_or_taken() {
    let folder = tempfile::tempdir().unwrap();
    let (mut mutants, mut refused, begin) = (Mutants::new(0xde5c), 0, Instant::now());
    let whole = first(&description());
    let count = Mutants::count(40);
    let file = file(folder.path());
    let headers: Vec<String> = (0..count).map(|_| mutants.text(&whole)).chain(bombs()).collect();
    for header in &headers {
        fs::write(folder.path().join("answer"), described(header)).unwrap();
        match Simulator::start(&file) {
            Ok(simulator) => assert!(simulator.description().check().is_ok()),
            Err(error) => {
                refused += 1;
                assert_said(&error);
            }
        }
    }
    assert!(refused > count / 2);
    assert_held("a simulator's description (.npz, JSON)", count, refused, begin);
}

/// Few bytes that claim arrays of no size, or of more values than can be counted.
#[test]
fn an_answer_that_claims_without_measure_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (simulator, batch) = (start(folder.path()), batch());
    let shape = "(2, 6, 3)";
    let claims = ["(0, 0, 0)}", "(9223372036854775807, 2, 2)}"];
    for (k, claim) in claims.into_iter().enumerate() {
        let header = json!({"version": 1, "id": k + 2, "kind": "outputs"}).to_string();
        let mut bytes = archive(&header, Some(&Array3::zeros((2, 6, 3))));
        let at = bytes.windows(shape.len()).position(|part| part == shape.as_bytes()).unwrap();
        // Blanks follow it.
        bytes[at..at + claim.len()].copy_from_slice(claim.as_bytes());
        fs::write(folder.path().join("answer"), bytes).unwrap();
        assert_said(&simulator.rollout(&batch).unwrap_err());
    }
    assert_held("claims of a simulator", claims.len(), claims.len(), Instant::now());
}
