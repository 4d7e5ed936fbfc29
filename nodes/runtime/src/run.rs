//! The process around a node.

use std::future::Future;
use std::time::Duration;

use tokio::signal::unix::{SignalKind, signal};

use crate::{Error, Node};

/// Time that computations still running have to end when the node is done.
const COMPUTATION_TIME: Duration = Duration::from_secs(1);

/// Runs the node that the program calls `name`: `setup` declares its parameters and topics and
/// gives its work. The process ends when the work does, or on SIGINT or SIGTERM; the work is then
/// dropped at its next `await`.
///
/// # Errors
/// What kept the node from starting, or the error of its work.
pub fn run<Setup, Work, E>(name: &str, setup: Setup) -> Result<(), E>
where
    Setup: FnOnce(&mut Node) -> Result<Work, E>,
    Work: Future<Output = Result<(), E>>,
    E: From<Error>,
{
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().map_err(Error::Process)?;
    let result = runtime.block_on(async {
        let mut node = Node::start(name, std::env::args())?;
        let end = signalled().map_err(Error::Process)?;
        let work = setup(&mut node)?;
        node.run(work, end).await
    });
    runtime.shutdown_timeout(COMPUTATION_TIME);
    result
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
