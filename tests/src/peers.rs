//! DDS peers that share no code with the suite: CycloneDDS (Python, and C
//! in the version of ROS 2 Jazzy) and Fast DDS (C++).
//!
//! Where a peer is missing its tests fail, unless `GRIPSIGHT_SKIP_PEERS=1` says that they may not count.

use std::ffi::OsStr;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use serde::de::DeserializeOwned;

use crate::domain::Domain;
use crate::process::{Process, program_folder};

/// Time that anything between two processes may take.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// A peer, or why it is not there.
type Found = Result<PathBuf, String>;

/// A path below the package.
fn own(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// True when the peers are there. Says so when a test is skipped.
///
/// # Panics
/// When a peer is missing and the tests with peers count.
pub fn available(found: &[Found]) -> bool {
    let missing: Vec<&str> =
        found.iter().filter_map(|found| found.as_ref().err()).map(String::as_str).collect();
    if missing.is_empty() {
        return true;
    }
    let missing = missing.join("\n");
    assert!(
        std::env::var("GRIPSIGHT_SKIP_PEERS").is_ok_and(|value| value == "1"),
        "a DDS peer is missing (launch_scripts/setup.sh installs it; GRIPSIGHT_SKIP_PEERS=1 skips):\n{missing}"
    );
    eprintln!("SKIPPED, a DDS peer is missing:\n{missing}");
    false
}

/// The Python that has CycloneDDS.
pub fn cyclone() -> Found {
    let python = own("../.venv/bin/python");
    let works = Command::new(&python)
        .args(["-c", "import cyclonedds.domain"])
        .output()
        .is_ok_and(|output| output.status.success());
    if works { Ok(python) } else { Err("CycloneDDS: `.venv` has no Python package `cyclonedds`".into()) }
}

/// The Fast DDS peer, built when its source is newer.
pub fn fast_dds() -> Found {
    build("fastdds_peer", "fastdds_peer.cpp", |folder, source, program| {
        let libraries = ["-lfastrtps", "-lfastcdr"];
        let mut compiler = Command::new("c++");
        compiler.args(["-std=c++14", "-O1", "-pthread"]).args(from_to(source, program));
        finish(compiler.args(unpacked_without_root()).args(libraries).current_dir(folder))
    })
}

/// The peer on CycloneDDS 0.10, built when its source is newer.
pub fn cyclone_of_jazzy() -> Found {
    build("cyclone_peer", "cyclone_peer.c", |folder, source, program| {
        let unpacked = own("../.deps/system/usr/bin/idlc");
        let idlc = if unpacked.exists() { unpacked } else { "idlc".into() };
        finish(Command::new(idlc).arg(own("peers/compressed_image.idl")).current_dir(folder))?;
        let mut compiler = Command::new("cc");
        compiler.args(from_to(source, program)).args(["-I.", "compressed_image.c"]);
        finish(compiler.args(unpacked_without_root()).arg("-lddsc").current_dir(folder))
    })
}

/// Builds a peer beside the programs under test: `compile` gets a scratch folder, source and program.
fn build(name: &str, source: &str, compile: impl Fn(&Path, &Path, &Path) -> Result<(), String>) -> Found {
    let failed = |reason: String| format!("{name}: {reason}");
    let source = own("peers").join(source);
    let folder = program_folder().join("peers").join(name);
    std::fs::create_dir_all(&folder).map_err(|error| failed(error.to_string()))?;
    let program = folder.join(name);
    // One test builds it, the others wait.
    let lock = File::create(folder.join("lock")).map_err(|error| failed(error.to_string()))?;
    lock.lock().map_err(|error| failed(error.to_string()))?;
    let changed = |path: &Path| path.metadata().and_then(|data| data.modified()).ok();
    if changed(&program) < changed(&source) {
        compile(&folder, &source, &program).map_err(failed)?;
    }
    Ok(program)
}

fn from_to<'a>(source: &'a Path, program: &'a Path) -> [&'a OsStr; 3] {
    [source.as_os_str(), OsStr::new("-o"), program.as_os_str()]
}

fn finish(command: &mut Command) -> Result<(), String> {
    let output = command.output().map_err(|error| format!("{command:?}: {error}"))?;
    if output.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&output.stderr).into_owned()) }
}

/// Compiler options for libraries that the set-up script unpacked below `.deps` for want of root.
fn unpacked_without_root() -> Vec<String> {
    let system = own("../.deps/system/usr");
    if !system.exists() {
        return Vec::new();
    }
    let include = system.join("include").display().to_string();
    let library = system.join(format!("lib/{}-linux-gnu", std::env::consts::ARCH)).display().to_string();
    vec![format!("-I{include}"), format!("-L{library}"), format!("-Wl,-rpath,{library}")]
}

/// Starts the CycloneDDS peer (see its file for the arguments) and waits until its endpoint stands.
pub fn start_cyclone(domain: &Domain, python: &Path, arguments: &[&str]) -> Process {
    let mut command = Command::new(python);
    command.arg(own("peers/cyclone_peer.py")).args(arguments);
    let process = Process::start(domain, command);
    if arguments.first() != Some(&"call") {
        assert_eq!(process.line(PATIENCE), "ready");
    }
    process
}

/// Starts a peer that was built here on a topic and waits until its endpoint stands. The Fast DDS
/// peer takes parameter sets, that on CycloneDDS 0.10 compressed pictures.
pub fn start_built(domain: &Domain, program: &Path, topic: &str, count: u32) -> Process {
    let mut command = Command::new(program);
    command.args([topic, &count.to_string(), &PATIENCE.as_secs().to_string()]);
    let process = Process::start(domain, command);
    assert_eq!(process.line(PATIENCE), "ready");
    process
}

/// The next message that a peer prints.
///
/// # Panics
/// When none comes in time, or it is not of the type.
pub fn message<M: DeserializeOwned>(peer: &Process) -> M {
    parsed(&peer.line(PATIENCE))
}

/// A message from a peer's line: JSON, or with Python's NaN, which only JSON5 has.
///
/// # Panics
/// When the line is not of the type.
pub fn parsed<M: DeserializeOwned>(line: &str) -> M {
    serde_json::from_str(line)
        .or_else(|_| json5::from_str(line))
        .unwrap_or_else(|error| panic!("{error}: {line:.500}"))
}
