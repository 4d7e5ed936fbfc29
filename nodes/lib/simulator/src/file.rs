//! The simulator's file: how to start it, and how its channels relate to the recorded ones.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::SimulatorError;
use crate::adapters::Adapter;

/// Bounds of a parameter, where the simulator's own are too wide or too narrow.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// The least.
    pub low: f64,
    /// The most.
    pub high: f64,
}

/// What is to be done with the forward speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ForwardSpeed {
    /// Imposed where the simulator can, else simulated.
    #[default]
    Auto,
    /// As the simulator's own longitudinal side makes it of the recorded commands.
    Simulated,
}

/// Where the recorded channels are taken, in metres ahead of the simulator's reference point.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Reference {
    /// Of the recorded v_y: `-0.17` where the car reports it at the rear axle and the simulator at the centre of gravity 0.17 m before it.
    pub v_y_ahead_m: f64,
}

/// `--simulator FILE`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SimulatorFile {
    /// One of the adapters that come with gripsight, in place of a command.
    #[serde(default)]
    pub adapter: Option<Adapter>,
    /// What to run, in `folder`. `{parameter_file}` stands for the parameter file.
    #[serde(default)]
    pub command: Vec<String>,
    /// The Python of an adapter.
    #[serde(default = "python")]
    pub python: String,
    /// What an adapter needs beside its parameter file, such as the user's checkout: passed on as `NAME=VALUE`.
    #[serde(default)]
    pub options: BTreeMap<String, String>,
    /// Working folder; from the file's own folder on.
    #[serde(default)]
    pub folder: PathBuf,
    /// The simulator's own parameters; from the file's own folder on. What a patch changes.
    #[serde(default)]
    pub parameter_file: Option<PathBuf>,
    /// Processes side by side.
    #[serde(default = "two")]
    pub processes: usize,
    /// Time for one answer.
    #[serde(default = "minute")]
    pub time_limit_s: f64,
    /// Where channels are taken.
    #[serde(default)]
    pub reference: Reference,
    /// Throttle for an acceleration, where the simulator takes pedals.
    #[serde(default)]
    pub pedal_per_mps2: Option<f64>,
    /// What becomes of the forward speed.
    #[serde(default)]
    pub v_x: ForwardSpeed,
    /// Parameters that are known and must not be touched.
    #[serde(default)]
    pub fixed: Vec<String>,
    /// Other bounds.
    #[serde(default)]
    pub bounds: BTreeMap<String, Bounds>,
    /// Ratios of units that a gain may be mistaken by, beside 180/pi, 3.6 and 9.81.
    #[serde(default)]
    pub unit_ratios: BTreeMap<String, f64>,
    /// Where the file stands.
    #[serde(skip)]
    home: PathBuf,
}

fn python() -> String {
    "python3".to_owned()
}

fn two() -> usize {
    2
}

fn minute() -> f64 {
    60.0
}

impl SimulatorFile {
    /// Reads a file.
    ///
    /// # Errors
    /// [`SimulatorError::Io`], [`SimulatorError::File`].
    pub fn read(path: &Path) -> Result<Self, SimulatorError> {
        let text = text_of(path).map_err(SimulatorError::io(path))?;
        let home = path.parent().map(Path::to_owned).unwrap_or_default();
        Self::parse(&text, &home).map_err(|why| SimulatorError::File { path: path.to_owned(), why })
    }

    /// Takes the text of a file that stands in a folder.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str, home: &Path) -> Result<Self, String> {
        let mut file: Self = serde_saphyr::from_str(text).map_err(|e| e.to_string())?;
        let home = if home.as_os_str().is_empty() { Path::new(".") } else { home };
        file.home = home.canonicalize().map_err(|e| format!("{}: {e}", home.display()))?;
        if file.adapter.is_some() != file.command.is_empty() {
            return Err("give either `adapter` or `command`".to_owned());
        }
        if !(1..=64).contains(&file.processes) {
            return Err(format!("processes: {}, between 1 and 64 is possible", file.processes));
        }
        if file.time_limit_s.is_nan() || file.time_limit_s <= 0.0 {
            return Err(format!("time_limit_s: {}, must be positive", file.time_limit_s));
        }
        if let Some(missing) = file.parameter_path().filter(|p| !p.is_file()) {
            return Err(format!("parameter_file: there is no file {}", missing.display()));
        }
        if !file.working_folder().is_dir() {
            return Err(format!("folder: there is no folder {}", file.working_folder().display()));
        }
        Ok(file)
    }

    /// Where the command runs.
    #[must_use]
    pub fn working_folder(&self) -> PathBuf {
        self.home.join(&self.folder)
    }

    /// The parameter file, as it can be opened.
    #[must_use]
    pub fn parameter_path(&self) -> Option<PathBuf> {
        self.parameter_file.as_ref().map(|p| self.home.join(p))
    }

    /// The command with its arguments, for a parameter file and the folder of the adapters.
    pub(crate) fn arguments(&self, parameter_file: Option<&Path>, adapters: &Path) -> Vec<String> {
        let parameters = parameter_file.map(|p| p.display().to_string()).unwrap_or_default();
        match self.adapter {
            Some(adapter) => {
                let script = adapters.join(adapter.script()).display().to_string();
                let options = self.options.iter().map(|(name, value)| format!("{name}={value}"));
                [self.python.clone(), script, parameters].into_iter().chain(options).collect()
            }
            None => self.command.iter().map(|a| a.replace("{parameter_file}", &parameters)).collect(),
        }
    }
}

/// A simulator's file and its parameter file are no longer (bytes).
const MOST_TEXT: u64 = 16 << 20;

/// A file's text.
pub(crate) fn text_of(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    // What is no plain file does not tell its length.
    if File::open(path)?.take(MOST_TEXT + 1).read_to_string(&mut text)? as u64 > MOST_TEXT {
        let error = format!("larger than {} MiB", MOST_TEXT >> 20);
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, error));
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_without_an_end_is_refused() {
        let said = SimulatorFile::read(Path::new("/dev/zero")).unwrap_err().to_string();
        assert!(said.contains("/dev/zero") && said.contains("larger than 16 MiB"), "{said}");
    }

    #[test]
    fn a_file_names_what_is_wrong_with_it() {
        let home = std::env::temp_dir();
        let parse = |text: &str| SimulatorFile::parse(text, &home);
        assert_eq!(parse("adapter: slipx").unwrap().processes, 2);
        assert_eq!(parse("command: [python3, car.py]\nfolder: .").unwrap().time_limit_s, 60.0);
        for (text, why) in [
            ("processes: 1", "either `adapter` or `command`"),
            ("adapter: slipx\ncommand: [a]", "either `adapter` or `command`"),
            ("adapter: slipz", "slipz"),
            ("command: [a]\ncomand: [b]", "comand"),
            ("command: [a]\nprocesses: 0", "processes: 0"),
            ("command: [a]\ntime_limit_s: -1", "must be positive"),
            ("command: [a]\nparameter_file: not_there.yaml", "there is no file"),
            ("command: [a]\nfolder: not_there", "there is no folder"),
        ] {
            let said = parse(text).unwrap_err();
            assert!(said.contains(why), "{text}: {said}");
        }
    }
}
