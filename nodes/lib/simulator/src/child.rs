//! One process of a simulator: started, asked, and ended.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ndarray::Array3;

use crate::wire::{self, Answer, Batch, RequestHeader, VERSION};
use crate::{Description, SimulatorError};

/// How much of what a simulator prints is kept.
const KEPT_BYTES: usize = 2000;
/// How often a process that has not called back yet is looked at.
const LOOK: Duration = Duration::from_millis(2);

/// A running simulator.
#[derive(Debug)]
pub(crate) struct Child {
    process: std::process::Child,
    stream: UnixStream,
    printed: Arc<Mutex<VecDeque<u8>>>,
    listener: Option<JoinHandle<()>>,
    limit: Duration,
    next_id: u64,
}

impl Child {
    /// Starts a command and waits until it calls back.
    pub(crate) fn start(
        arguments: &[String],
        folder: &Path,
        scratch: &Path,
        number: usize,
        limit: Duration,
    ) -> Result<Self, SimulatorError> {
        let when = "when it was started";
        let socket = scratch.join(format!("{number}.socket"));
        let listener = UnixListener::bind(&socket).map_err(SimulatorError::io(&socket))?;
        listener.set_nonblocking(true).map_err(SimulatorError::io(&socket))?;
        let shown = arguments.join(" ");
        let start_error = |why| SimulatorError::Start { command: shown.clone(), why };
        let (mut reader, writer) = std::io::pipe().map_err(start_error)?;
        let Some((program, rest)) = arguments.split_first() else {
            return Err(start_error(ErrorKind::NotFound.into()));
        };
        let mut path = std::ffi::OsString::from(scratch);
        if let Some(others) = std::env::var_os("PYTHONPATH").filter(|p| !p.is_empty()) {
            path.push(":");
            path.push(others);
        }
        let mut process = Command::new(program)
            .args(rest)
            .current_dir(folder)
            .env("GRIPSIGHT_SOCKET", &socket)
            .env("PYTHONPATH", path)
            // One process is one core: several stand side by side.
            .env("OMP_NUM_THREADS", "1")
            .stdin(Stdio::null())
            .stdout(writer.try_clone().map_err(start_error)?)
            .stderr(writer)
            .spawn()
            .map_err(start_error)?;
        let printed = Arc::new(Mutex::new(VecDeque::new()));
        let kept = Arc::clone(&printed);
        let ear = std::thread::spawn(move || {
            let mut part = [0; 4096];
            while let Ok(count @ 1..) = reader.read(&mut part) {
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                kept.extend(&part[..count]);
                let surplus = kept.len().saturating_sub(KEPT_BYTES);
                kept.drain(..surplus);
            }
        });
        let deadline = Instant::now() + limit;
        let stream = loop {
            match listener.accept() {
                Ok((stream, _)) => break Ok(stream),
                Err(e) if e.kind() == ErrorKind::WouldBlock => {}
                Err(e) => break Err(SimulatorError::io(&socket)(e)),
            }
            if let Ok(Some(status)) = process.try_wait() {
                let _ = ear.join();
                let last_words = text(&printed);
                return Err(SimulatorError::Died { when, status: status.to_string(), last_words });
            }
            if Instant::now() > deadline {
                break Err(late(when, limit, &printed));
            }
            std::thread::sleep(LOOK);
        };
        let stream = stream.and_then(|s| {
            s.set_nonblocking(false).map_err(SimulatorError::io(&socket))?;
            Ok(s)
        });
        match stream {
            Ok(stream) => Ok(Self { process, stream, printed, listener: Some(ear), limit, next_id: 0 }),
            Err(error) => {
                let _ = process.kill();
                let _ = process.wait();
                Err(error)
            }
        }
    }

    /// Asks what it is.
    pub(crate) fn describe(&mut self) -> Result<Description, SimulatorError> {
        let when = "when it was asked what it is";
        let answer = self.ask("describe", None, when)?;
        let description = answer.header.description().map_err(|why| SimulatorError::Answer { when, why })?;
        description.check()?;
        Ok(description)
    }

    /// Runs a batch: outputs (B, M, C).
    pub(crate) fn rollout(&mut self, batch: &Batch, channels: usize) -> Result<Array3<f64>, SimulatorError> {
        let when = "in a rollout";
        let answer = self.ask("rollout", Some(batch), when)?;
        let wrong = |why: String| SimulatorError::Answer { when, why };
        let outputs = answer.outputs.ok_or_else(|| wrong("it holds no array `outputs`".to_owned()))?;
        let expected = [batch.passes(), batch.output_steps.len(), channels];
        if outputs.shape() != expected {
            return Err(wrong(format!(
                "outputs has the shape {:?}, expected {expected:?} (passes, times, channels)",
                outputs.shape()
            )));
        }
        Ok(outputs)
    }

    fn ask(
        &mut self,
        kind: &'static str,
        batch: Option<&Batch>,
        when: &'static str,
    ) -> Result<Answer, SimulatorError> {
        self.next_id += 1;
        let id = self.next_id;
        let mut timed = Timed { stream: &self.stream, deadline: Instant::now() + self.limit };
        let asked = wire::write(&mut timed, &RequestHeader { version: VERSION, id, kind }, batch);
        let answered = asked.and_then(|()| wire::read(&mut timed));
        let answer = match answered {
            Ok(Ok(answer)) => answer,
            Ok(Err(why)) => return Err(SimulatorError::Answer { when, why }),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                let _ = self.process.kill();
                return Err(late(when, self.limit, &self.printed));
            }
            Err(_) => return Err(self.died(when)),
        };
        let AnswerHeader { version, id: of, kind, message } = heads(&answer);
        if version != VERSION {
            let why = format!("it speaks version {version} of the messages, this program version {VERSION}");
            return Err(SimulatorError::Answer { when, why });
        }
        if kind == "error" {
            return Err(SimulatorError::Failed { when, message: message.to_owned() });
        }
        if of != Some(id) {
            let why = format!("it answers request {of:?}, asked was {id}");
            return Err(SimulatorError::Answer { when, why });
        }
        Ok(answer)
    }

    /// What became of a process that hung up.
    fn died(&mut self, when: &'static str) -> SimulatorError {
        let deadline = Instant::now() + Duration::from_secs(1);
        let mut status = None;
        while status.is_none() && Instant::now() < deadline {
            status = self.process.try_wait().ok().flatten();
            std::thread::sleep(LOOK);
        }
        let status = status.map_or_else(|| "it hung up and still runs".to_owned(), |s| s.to_string());
        let _ = self.process.kill();
        let _ = self.process.wait();
        if let Some(ear) = self.listener.take() {
            let _ = ear.join();
        }
        SimulatorError::Died { when, status, last_words: text(&self.printed) }
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

struct AnswerHeader<'a> {
    version: u32,
    id: Option<u64>,
    kind: &'a str,
    message: &'a str,
}

fn heads(answer: &Answer) -> AnswerHeader<'_> {
    let h = &answer.header;
    AnswerHeader { version: h.version, id: h.id, kind: &h.kind, message: &h.message }
}

fn late(when: &'static str, limit: Duration, printed: &Mutex<VecDeque<u8>>) -> SimulatorError {
    SimulatorError::Late { when, limit_s: limit.as_secs_f64(), last_words: text(printed) }
}

fn text(printed: &Mutex<VecDeque<u8>>) -> String {
    let mut kept = printed.lock().unwrap_or_else(PoisonError::into_inner);
    let text = String::from_utf8_lossy(kept.make_contiguous()).trim().to_owned();
    if text.is_empty() { "(it printed nothing)".to_owned() } else { text }
}

/// A stream that gives up at a time.
struct Timed<'a> {
    stream: &'a UnixStream,
    deadline: Instant,
}

impl Timed<'_> {
    fn left(&self) -> std::io::Result<Option<Duration>> {
        let left = self.deadline.saturating_duration_since(Instant::now());
        if left.is_zero() { Err(ErrorKind::TimedOut.into()) } else { Ok(Some(left)) }
    }
}

impl Read for Timed<'_> {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        self.stream.set_read_timeout(self.left()?)?;
        self.stream.read(to)
    }
}

impl Write for Timed<'_> {
    fn write(&mut self, from: &[u8]) -> std::io::Result<usize> {
        self.stream.set_write_timeout(self.left()?)?;
        self.stream.write(from)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}
