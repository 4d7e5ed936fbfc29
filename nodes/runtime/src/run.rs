//! The process around a node.

use std::future::Future;
use std::io::Write as _;
use std::os::unix::process::CommandExt as _;
use std::process::Command;
use std::time::Duration;

use tokio::signal::unix::{SignalKind, signal};

use crate::node::Ended;
use crate::{Error, Node};

/// Time that computations still running have to end when the node is done.
const COMPUTATION_TIME: Duration = Duration::from_secs(1);

/// How settings are given, the same for every node.
const USAGE: &str = "\
## Usage
    NODE --ros-args [-p NAME:=VALUE] [-r FROM:=TO] [--params-file FILE] [--log-level LEVEL]

Example: take another odometry topic, in the namespace /car

    NODE --ros-args -r odom:=/car_state/odom -r __ns:=/car
";

/// Runs the node that the program calls `name`: `setup` declares its parameters and topics and
/// gives its work. The process ends when the work does, or on SIGINT or SIGTERM; the work is then
/// dropped at its next `await`. Where DDS has stopped, as it does when a suspended process goes on, the process starts anew in its place, with
/// the same arguments; what it held is gone. With `--help` it prints `manual`, the text of the node's README,
/// and ends.
///
/// # Errors
/// What kept the node from starting, or the error of its work.
pub fn run<Setup, Work, E>(name: &str, manual: &str, setup: Setup) -> Result<(), E>
where
    Setup: FnOnce(&mut Node) -> Result<Work, E>,
    Work: Future<Output = Result<(), E>>,
    E: From<Error>,
{
    if asks_for_help(std::env::args()) {
        let text = format!("{manual}\n{}", USAGE.replace("NODE", name));
        return Ok(std::io::stdout().write_all(text.as_bytes()).map_err(Error::Process)?);
    }
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().map_err(Error::Process)?;
    let ended = runtime.block_on(async {
        let mut node = Node::start(name, std::env::args())?;
        let end = signalled().map_err(Error::Process)?;
        let work = setup(&mut node)?;
        Ok::<_, E>(node.run(work, end).await)
    });
    if let Ok(Ended::Deaf) = &ended {
        tracing::error!("DDS has stopped, as it does when a suspended process goes on: starting anew");
    }
    runtime.shutdown_timeout(COMPUTATION_TIME);
    match ended? {
        Ended::Work(result) => result,
        Ended::Deaf => Err(start_anew().into()),
    }
}

/// Replaces this process by a new start of the same program; what it gives is why that failed.
fn start_anew() -> Error {
    let mut arguments = std::env::args_os();
    let called = arguments.next().unwrap_or_default();
    match std::env::current_exe() {
        Ok(program) => Error::Process(Command::new(program).arg0(called).args(arguments).exec()),
        Err(error) => Error::Process(error),
    }
}

/// Whether `-h` or `--help` stands before the arguments that ROS 2 owns; `arguments` begins with the program's name.
fn asks_for_help(arguments: impl IntoIterator<Item = String>) -> bool {
    let mut own = arguments.into_iter().skip(1).take_while(|word| word != "--ros-args");
    own.any(|word| word == "-h" || word == "--help")
}

/// Resolves on SIGINT or SIGTERM.
fn signalled() -> std::io::Result<impl Future<Output = ()>> {
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
        }
        tracing::info!("asked to end");
    })
}

#[cfg(test)]
mod tests {
    use super::asks_for_help;

    #[test]
    fn help_is_asked_for_before_the_ros_arguments() {
        let asks = |line: &str| asks_for_help(line.split_whitespace().map(str::to_owned));
        assert!(asks("node --help") && asks("node -h --ros-args -p a:=1"));
        assert!(!asks("node") && !asks("node --ros-args -p text:=--help --help"));
    }
}
