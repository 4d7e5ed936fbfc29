//! Where things are.

use std::path::PathBuf;

use gripsight_simulator::SimulatorFile;

/// The Python that launch_scripts/setup.sh makes, else the system's.
pub(crate) fn python() -> String {
    let venv = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../.venv/bin/python");
    if venv.exists() { venv.display().to_string() } else { "python3".to_owned() }
}

/// The bicycle of `simulators/bicycle.py`, broken in some way.
pub(crate) fn bicycle(how: &str, more: &str) -> SimulatorFile {
    let home = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/suite/simulators");
    let text = format!("command: ['{}', bicycle.py, {how}]\n{more}", python());
    SimulatorFile::parse(&text, &home).unwrap()
}
