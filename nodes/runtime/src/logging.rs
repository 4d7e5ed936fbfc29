//! `tracing` to the terminal (standard error) and to `/rosout`.

use std::fmt::Write;
use std::io::IsTerminal;

use gripsight_msgs::standard::rcl_interfaces::Log;
use tokio::sync::mpsc;
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::filter::EnvFilter;
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;

use crate::args::Args;

/// Lines that wait for `/rosout`; more are dropped.
const WAITING_LINES: usize = 1000;

/// Starts logging for the process. Gives the lines meant for `/rosout`, without stamp and name;
/// none when another node of the process has started logging already.
pub(crate) fn start(args: &Args) -> mpsc::Receiver<Log> {
    let (lines, receiver) = mpsc::channel(WAITING_LINES);
    // The target tells whose line it is where a launcher mixes the output of several nodes.
    let terminal = args.to_terminal.then(|| {
        let colours = std::io::stderr().is_terminal();
        tracing_subscriber::fmt::layer().with_ansi(colours).with_writer(std::io::stderr)
    });
    let rosout = args.to_rosout.then(|| RosoutLayer { lines });
    // The second call in one process (tests) finds a subscriber set, and keeps it.
    tracing_subscriber::registry().with(filter(args)).with(terminal).with(rosout).try_init().ok();
    receiver
}

/// `RUST_LOG`, or what `--log-level` says. The DDS libraries are silent unless asked
/// (`--log-level rustdds:=warn`): what matters of theirs is in the diagnostics.
fn filter(args: &Args) -> EnvFilter {
    if let Ok(filter) = EnvFilter::try_from_default_env() {
        return filter;
    }
    let mut directives = String::from("info,rustdds=off,ros2_client=off,cdr_encoding=off");
    for (logger, level) in &args.log_levels {
        let separator = if logger.is_some() { "=" } else { "" };
        let logger = logger.as_deref().unwrap_or_default();
        // A `String` takes everything written to it.
        write!(directives, ",{logger}{separator}{level}").ok();
    }
    EnvFilter::new(directives)
}

struct RosoutLayer {
    lines: mpsc::Sender<Log>,
}

impl<S: Subscriber> Layer<S> for RosoutLayer {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let metadata = event.metadata();
        let is_transport = ["rustdds", "ros2_client", "cdr_encoding", "log"];
        if is_transport.iter().any(|name| metadata.target().starts_with(name)) {
            return;
        }
        let mut text = Text::default();
        event.record(&mut text);
        let line = Log {
            level: level(metadata.level()),
            msg: text.message + &text.fields,
            file: metadata.file().unwrap_or_default().to_owned(),
            function: metadata.module_path().unwrap_or_default().to_owned(),
            line: metadata.line().unwrap_or_default(),
            ..Log::default()
        };
        // A full queue loses the line on /rosout; the terminal has it.
        self.lines.try_send(line).ok();
    }
}

fn level(level: &Level) -> u8 {
    match *level {
        Level::ERROR => Log::ERROR,
        Level::WARN => Log::WARN,
        Level::INFO => Log::INFO,
        _ => Log::DEBUG,
    }
}

/// The message of an event, and its other fields as ` name=value`.
#[derive(Default)]
struct Text {
    message: String,
    fields: String,
}

impl Visit for Text {
    fn record_str(&mut self, field: &Field, value: &str) {
        self.record_debug(field, &format_args!("{value}"));
    }

    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        let result = match field.name() {
            "message" => write!(self.message, "{value:?}"),
            name => write!(self.fields, " {name}={value:?}"),
        };
        // A `String` takes everything written to it.
        result.ok();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_become_lines() {
        let (lines, mut receiver) = mpsc::channel(4);
        let subscriber = tracing_subscriber::registry().with(RosoutLayer { lines });
        tracing::subscriber::with_default(subscriber, || {
            tracing::warn!(count = 3, topic = "odom", "{} gaps", 2);
            tracing::error!(target: "rustdds::writer", "transport");
        });
        let line = receiver.try_recv().unwrap();
        assert_eq!((line.level, line.msg.as_str()), (Log::WARN, "2 gaps count=3 topic=odom"));
        assert!(receiver.try_recv().is_err());
    }
}
