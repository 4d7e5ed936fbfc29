//! The process around a node.

use std::future::Future;
use std::io::Write as _;
use std::time::Duration;

use crate::guard::Guard;
use crate::node::Ended;
use crate::{Error, Node, restart};

/// Time that computations still running have to end when the node is done.
const COMPUTATION_TIME: Duration = Duration::from_millis(300);

/// How settings are given, the same for every node.
const USAGE: &str = "\
## Usage
    NODE --ros-args [-p NAME:=VALUE] [-r FROM:=TO] [--params-file FILE] [--log-level LEVEL]

Example: take another odometry topic, in the namespace /car

    NODE --ros-args -r odom:=/car_state/odom -r __ns:=/car

## As every node of the suite
SIGINT and SIGTERM end it within two seconds. Parameter `memory_limit_mb` (512; 0: none): beyond it the node starts itself anew, with what
it held forgotten. Exit codes: 0 ended as asked, 1 it could not start or go on, or had to be ended by force; the last line says why.
Parts of `/diagnostics` that every node has:

| part | level | when |
| --- | --- | --- |
| `process` | ERROR | the node's loop has stalled for more than two seconds |
| `process` | WARN | more than four fifths of `memory_limit_mb` are held |
| `transport` | WARN | messages could not be decoded, or not be sent within a second |
| `input TOPIC` | WARN | nothing has arrived for five seconds on a topic that the node needs; the text, which is in the log too, names who publishes there |
";

/// Runs the node that the program calls `name`: `setup` declares its parameters and topics and
/// gives its work. The process ends when the work does, or on SIGINT or SIGTERM: the work is dropped at its next `await`, and the
/// process has ended two seconds later whatever it does. Where DDS has stopped, or the
/// process holds more memory than the parameter `memory_limit_mb` allows, it starts anew in its place, with
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
    let guard = Guard::start()?;
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().map_err(Error::Process)?;
    if runtime.block_on(async { tokio::time::timeout(restart::pause(), guard.asked()).await }).is_ok() {
        return Ok(());
    }
    let ended = runtime.block_on(async {
        let mut node = Node::start(name, std::env::args(), &guard)?;
        let work = match setup(&mut node) {
            // DDS stopped while it set itself up.
            Err(_) if node.is_deaf() => return Ok(Ended::Deaf),
            work => work?,
        };
        node.check_parameters()?;
        tracing::info!("{} has started in DDS domain {}", node.name(), node.domain());
        let beat = guard.beat();
        let work = async {
            tokio::select! {
                result = work => result,
                never = beat => match never {},
            }
        };
        Ok::<_, E>(node.run(work, guard.asked()).await)
    });
    if let Ok(Ended::Deaf) = &ended {
        tracing::error!("DDS has stopped: starting anew");
    }
    runtime.shutdown_timeout(COMPUTATION_TIME);
    match ended? {
        Ended::Work(result) => result,
        Ended::Deaf => Err(Error::Process(restart::start_anew(guard.age())).into()),
    }
}

/// Whether `-h` or `--help` stands before the arguments that ROS 2 owns; `arguments` begins with the program's name.
fn asks_for_help(arguments: impl IntoIterator<Item = String>) -> bool {
    let mut own = arguments.into_iter().skip(1).take_while(|word| word != "--ros-args");
    own.any(|word| word == "-h" || word == "--help")
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
