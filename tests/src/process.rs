//! Processes that end with their test.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use crate::domain::Domain;

/// A running process; it is killed when this is dropped.
pub struct Process {
    name: String,
    child: Child,
    stdout: Receiver<String>,
    stderr: Receiver<String>,
}

/// The folder of the programs that were built for the same profile as the running test.
///
/// # Panics
/// When the test does not run from a target folder.
pub fn program_folder() -> PathBuf {
    let test = std::env::current_exe().expect("the path of the running test");
    test.ancestors().nth(2).expect("target/<profile>/deps/<test>").to_owned()
}

/// The program `name` of this workspace.
///
/// # Panics
/// When it is not there: build it first, as tests do not build other packages' programs.
pub fn program(name: &str) -> PathBuf {
    let path = program_folder().join(name);
    assert!(path.exists(), "{} is missing: run `cargo build --workspace --bins` first", path.display());
    path
}

/// One of our nodes, with the arguments that follow `--ros-args`.
pub fn node(domain: &Domain, name: &str, ros_args: &[&str]) -> Process {
    let mut command = Command::new(program(name));
    if !ros_args.is_empty() {
        command.arg("--ros-args").args(ros_args);
    }
    Process::start(domain, command)
}

impl Process {
    /// Starts `command` in `domain`.
    ///
    /// # Panics
    /// When it cannot be started.
    pub fn start(domain: &Domain, mut command: Command) -> Self {
        let name = format!("{command:?}");
        // As a sourced ROS 2 may have it: nodes would then answer its peers alone.
        if !command.get_envs().any(|(name, _)| name == "RMW_IMPLEMENTATION") {
            command.env_remove("RMW_IMPLEMENTATION");
        }
        command
            .envs(domain.environment())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        let mut child = command.spawn().unwrap_or_else(|error| panic!("cannot start {name}: {error}"));
        let stdout = lines(child.stdout.take());
        let stderr = lines(child.stderr.take());
        Self { name, child, stdout, stderr }
    }

    /// The next line on standard output.
    ///
    /// # Panics
    /// When none comes in time.
    pub fn line(&self, timeout: Duration) -> String {
        self.stdout.recv_timeout(timeout).unwrap_or_else(|_| {
            let errors: Vec<String> = self.stderr.try_iter().collect();
            panic!("{}: no line within {timeout:?}; standard error:\n{}", self.name, errors.join("\n"))
        })
    }

    /// Waits for a line on standard error that contains `text`, and gives it.
    ///
    /// # Panics
    /// When none comes in time.
    pub fn wait_for_log(&self, text: &str, timeout: Duration) -> String {
        let end = Instant::now() + timeout;
        let mut seen = Vec::new();
        while let Ok(line) = self.stderr.recv_timeout(end.saturating_duration_since(Instant::now())) {
            if line.contains(text) {
                return line;
            }
            seen.push(line);
        }
        panic!("{}: no `{text}` within {timeout:?}, but:\n{}", self.name, seen.join("\n"));
    }

    /// Writes to standard input and closes it.
    ///
    /// # Panics
    /// When the process does not read.
    pub fn feed(&mut self, text: &str) {
        let mut stdin = self.child.stdin.take().expect("standard input was fed already");
        stdin.write_all(text.as_bytes()).unwrap_or_else(|error| panic!("{}: {error}", self.name));
    }

    /// Sends SIGTERM or SIGINT, by its name without `SIG`.
    ///
    /// # Panics
    /// When the signal cannot be sent.
    pub fn signal(&self, signal: &str) {
        let pid = self.child.id().to_string();
        let status = Command::new("kill").args(["-s", signal, &pid]).status().expect("kill");
        assert!(status.success(), "cannot signal {}", self.name);
    }

    /// Its number.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// The most memory that the running process has held so far.
    ///
    /// # Panics
    /// When it has ended.
    pub fn peak_memory_mb(&self) -> f64 {
        let status =
            std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).expect("a running process");
        let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).expect("VmHWM");
        let kb: f64 = peak.trim().trim_end_matches(" kB").parse().expect("a number of kB");
        kb / 1e3
    }

    /// Waits for the end of the process.
    ///
    /// # Panics
    /// When it does not end in time.
    pub fn wait(&mut self, timeout: Duration) -> ExitStatus {
        let end = Instant::now() + timeout;
        loop {
            if let Some(status) = self.child.try_wait().expect("state of a child") {
                return status;
            }
            assert!(Instant::now() < end, "{} did not end within {timeout:?}", self.name);
            thread::sleep(Duration::from_millis(10));
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended by itself.
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

fn lines(source: Option<impl Read + Send + 'static>) -> Receiver<String> {
    let (sender, receiver) = channel();
    if let Some(source) = source {
        thread::spawn(move || {
            for line in BufReader::new(source).lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
    }
    receiver
}
