//! A thread that looks after the node's process, whatever its loop does: a signal ends it within two seconds, a loop that stalls is
//! told, and memory beyond the stated limit starts it anew.
//!
//! It has a runtime of its own and takes no lock that the loop could hold for long. What a peer can make RustDDS 0.15.1 keep is not
//! bounded: tens of thousands of mutated datagrams took a node of 16 MB to 8 GB.

use std::convert::Infallible;
use std::future::Future;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::watch;
use tokio::time::MissedTickBehavior;

use crate::diagnostics::{Diagnostics, Level, Status};
use crate::parameters::{Descriptor, Parameter, ParameterStore};
use crate::{Error, restart};

/// Memory (MB) that a node may hold unless the parameter says otherwise: ten times what the largest needs.
const MEMORY_LIMIT_MB: i64 = 512;
/// From a signal to the end by force; an orderly end takes a fraction of it.
const ORDERLY_END: Duration = Duration::from_millis(1300);
/// Time for last words, and for the process's own end.
const LAST_WORDS: Duration = Duration::from_millis(150);
/// The loop says this often that it turns.
const BEAT: Duration = Duration::from_millis(100);
/// The guard looks this often.
const LOOK: Duration = Duration::from_millis(250);
/// A loop that has not turned for this long has stalled.
const STALLED: Duration = Duration::from_secs(2);
/// A share of the limit from which memory is warned of.
const MUCH: f64 = 0.8;
/// Exit code of a process that had to be ended by force.
const FORCED: i32 = 1;

/// The loop's and the node's side of the guard.
pub(crate) struct Guard {
    shared: Arc<Shared>,
    asked: watch::Receiver<bool>,
}

struct Shared {
    started: Instant,
    /// When the loop last turned, ms after the start; 0: it has not begun.
    beat_ms: AtomicU64,
    node: OnceLock<(Diagnostics, Parameter<i64>)>,
}

impl Guard {
    /// Starts the thread. From then on SIGINT and SIGTERM no longer end the process by themselves.
    ///
    /// # Errors
    /// [`Error::Process`] when there is no thread or no signal handler to be had.
    pub(crate) fn start() -> Result<Self, Error> {
        let shared =
            Arc::new(Shared { started: Instant::now(), beat_ms: AtomicU64::new(0), node: OnceLock::new() });
        let (sender, asked) = watch::channel(false);
        let (ready, is_ready) = std::sync::mpsc::sync_channel(1);
        let theirs = Arc::clone(&shared);
        thread::Builder::new().name("guard".to_owned()).spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
            let work = runtime.and_then(|runtime| {
                let _inside = runtime.enter();
                let signals = (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
                Ok((runtime, signals))
            });
            match work {
                Ok((runtime, signals)) => {
                    ready.send(Ok(())).ok();
                    runtime.block_on(look_after(&theirs, signals, &sender));
                }
                Err(error) => drop(ready.send(Err(error))),
            }
        })?;
        is_ready.recv().map_err(|_| std::io::Error::other("the guard ended"))??;
        Ok(Self { shared, asked })
    }

    /// The parameter that bounds the process's memory.
    pub(crate) fn limit(parameters: &Arc<ParameterStore>) -> Result<Parameter<i64>, Error> {
        let meaning = "Memory [MB] beyond which the node starts itself anew; 0: no limit";
        parameters.declare("memory_limit_mb", MEMORY_LIMIT_MB, Descriptor::new(meaning).range(0.0..=1e6))
    }

    /// From now on loop and memory are watched, too.
    pub(crate) fn watch(&self, diagnostics: Diagnostics, limit_mb: Parameter<i64>) {
        // A process has one node.
        self.shared.node.set((diagnostics, limit_mb)).ok();
    }

    /// To be polled by the node's loop, in the same task: says that it turns.
    pub(crate) fn beat(&self) -> impl Future<Output = Infallible> + use<> {
        let shared = Arc::clone(&self.shared);
        async move {
            let mut beats = tokio::time::interval(BEAT);
            beats.set_missed_tick_behavior(MissedTickBehavior::Delay);
            loop {
                beats.tick().await;
                shared.beat_ms.store(shared.age_ms().max(1), Ordering::Relaxed);
            }
        }
    }

    /// Resolves on SIGINT or SIGTERM.
    pub(crate) fn asked(&self) -> impl Future<Output = ()> + use<> {
        let mut asked = self.asked.clone();
        async move {
            // A guard that is gone asks for the end as well.
            asked.wait_for(|asked| *asked).await.ok();
        }
    }

    /// How long the process has run.
    pub(crate) fn age(&self) -> Duration {
        self.shared.started.elapsed()
    }
}

impl Shared {
    fn age_ms(&self) -> u64 {
        u64::try_from(self.started.elapsed().as_millis()).unwrap_or(u64::MAX)
    }

    /// How long the loop has not turned; `None` before it has begun.
    fn stood(&self) -> Option<Duration> {
        let beat_ms = self.beat_ms.load(Ordering::Relaxed);
        (beat_ms > 0).then(|| Duration::from_millis(self.age_ms().saturating_sub(beat_ms)))
    }
}

async fn look_after(shared: &Shared, signals: (Signal, Signal), asked: &watch::Sender<bool>) {
    let (mut interrupt, mut terminate) = signals;
    let mut looks = tokio::time::interval(LOOK);
    looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut last_look = Instant::now();
    let mut stalled = false;
    loop {
        tokio::select! {
            _ = interrupt.recv() => break,
            _ = terminate.recv() => break,
            _ = looks.tick() => {
                // The whole process was stopped, and the loop may not have had its turn yet.
                let was_stopped = last_look.elapsed() > 4 * LOOK;
                last_look = Instant::now();
                if !was_stopped {
                    look(shared, &mut stalled);
                }
            }
        }
    }
    say(|| tracing::info!("asked to end"));
    asked.send_replace(true);
    tokio::time::sleep(ORDERLY_END).await;
    say(|| tracing::error!("asked to end {ORDERLY_END:?} ago and still at work: ended by force"));
    end_by_force();
}

fn look(shared: &Shared, stalled: &mut bool) {
    let Some((diagnostics, limit_mb)) = shared.node.get() else { return };
    let stood = shared.stood().filter(|stood| *stood > STALLED);
    if stood.is_some() != *stalled {
        *stalled = stood.is_some();
        match stood {
            Some(stood) => {
                let stood_s = stood.as_secs_f64();
                say(move || {
                    tracing::error!("the node's loop has not turned for {stood_s:.1} s: its inputs wait");
                });
            }
            None => say(|| tracing::warn!("the node's loop turns again")),
        }
    }
    let held_mb = memory_mb();
    let limit_mb = limit_mb.get();
    diagnostics.report("process", status(stood, held_mb, limit_mb));
    if limit_mb > 0 && held_mb.is_some_and(|held_mb| held_mb > limit_mb as f64) {
        let held_mb = held_mb.unwrap_or_default();
        say(move || {
            tracing::error!(
                "{held_mb:.0} MB held, the limit is {limit_mb} MB (memory_limit_mb): starting anew"
            );
        });
        let error = restart::start_anew(shared.started.elapsed());
        say(move || tracing::error!("cannot start anew, so the node ends: {error}"));
        end_by_force();
    }
}

/// How the process is. ERROR: its loop has stalled. WARN: it holds more than four fifths of the memory that it may.
fn status(stood: Option<Duration>, held_mb: Option<f64>, limit_mb: i64) -> Status {
    let much = held_mb.is_some_and(|held_mb| limit_mb > 0 && held_mb > MUCH * limit_mb as f64);
    let (level, text) = match stood {
        Some(stood) => {
            (Level::Error, format!("the node's loop has not turned for {:.1} s", stood.as_secs_f64()))
        }
        None if much => {
            (Level::Warn, format!("{:.0} of {limit_mb} MB are held", held_mb.unwrap_or_default()))
        }
        None => (Level::Ok, "the node's loop turns".to_owned()),
    };
    let held = held_mb.map_or("not known".to_owned(), |held_mb| format!("{held_mb:.1}"));
    Status::new(level, text).value("memory [MB]", held).value("memory limit [MB]", limit_mb)
}

/// Memory that is this process's own, in RAM or swapped out; a mapped bag is not. `None` where the system does not tell.
fn memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kb = |name: &str| -> Option<f64> {
        let line = status.lines().find_map(|line| line.strip_prefix(name))?;
        line.trim_start_matches(':').trim().trim_end_matches(" kB").parse().ok()
    };
    Some((kb("RssAnon")? + kb("VmSwap").unwrap_or(0.0)) / 1e3)
}

/// Says something, and does not wait for a terminal that takes nothing.
fn say(line: impl FnOnce() + Send + 'static) {
    let (done, is_done) = std::sync::mpsc::sync_channel(1);
    let speaker = thread::Builder::new().name("last words".to_owned()).spawn(move || {
        line();
        done.send(()).ok();
    });
    if speaker.is_ok() {
        is_done.recv_timeout(LAST_WORDS).ok();
    }
}

/// Ends the process, even where its own end hangs (another library's destructor, a lock).
fn end_by_force() {
    thread::Builder::new().name("end".to_owned()).spawn(|| std::process::exit(FORCED)).ok();
    thread::sleep(LAST_WORDS);
    rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::KILL).ok();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_condition_has_its_level() {
        let second = Some(Duration::from_secs(3));
        assert_eq!(status(None, Some(10.0), 512).level, Level::Ok);
        assert_eq!(status(None, Some(500.0), 512).level, Level::Warn);
        assert_eq!(status(None, Some(500.0), 0).level, Level::Ok);
        assert_eq!(status(second, Some(500.0), 512).level, Level::Error);
        assert!(status(second, None, 512).message.contains("3.0 s"));
    }

    #[test]
    fn this_process_holds_memory() {
        assert!((0.1..1e5).contains(&memory_mb().unwrap()));
    }
}
