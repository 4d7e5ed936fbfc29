//! gripsight: what the nodes do on the car, offline on bags and without ROS.
//!
//! Standard output holds results, standard error progress and logs. Exit codes: 0 done, 1 failed, 2 wrong usage, 3 done but the
//! result is not accepted (or not identifiable).

#![allow(
    rustdoc::invalid_html_tags,
    reason = "doc comments of arguments are help texts: <car> is a name left open"
)]

/// Prints on standard output; see [`say`].
macro_rules! print {
    ($($text:tt)*) => { $crate::say(format_args!($($text)*)) };
}

/// Prints a line on standard output; see [`say`].
macro_rules! println {
    ($($text:tt)*) => { $crate::say(format_args!("{}\n", format_args!($($text)*))) };
}

mod bag;
mod camera;
mod data;
mod diagnose;
mod export;
mod friction;
#[cfg(test)]
mod hostile;
mod identify;
mod invocation;
mod notes;
mod outputs;
mod predictions;
mod simulate;
mod simulator;
mod verify;
mod withheld;

use std::io::{ErrorKind, IsTerminal as _, Write as _};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use tracing_subscriber::EnvFilter;

/// Identify a race car's tires from its telemetry, and explain where its model and the real car disagree.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 110, after_help = EXIT_CODES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const EXIT_CODES: &str = "\
Exit codes: 0 done; 1 failed; 2 wrong usage; 3 done, but the result is not accepted or not identifiable.
Results go to standard output, progress and logs to standard error; RUST_LOG=debug shows more.";

#[derive(Debug, Subcommand)]
enum Command {
    Identify(identify::IdentifyArgs),
    Verify(verify::VerifyArgs),
    Diagnose(diagnose::DiagnoseArgs),
    Export(export::ExportArgs),
    Friction(friction::FrictionArgs),
    Simulate(simulate::SimulateArgs),
    Withheld(withheld::WithheldArgs),
    Bag(bag::BagArgs),
}

/// How a subcommand ended that did not fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outcome {
    /// Exit code 0.
    Done,
    /// Exit code 3: done, but the result is not accepted or not identifiable.
    NotAccepted,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .without_time()
        .with_target(false)
        .init();
    match run(cli.command) {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::NotAccepted) => ExitCode::from(3),
        Err(error) => {
            // One line for what failed, one for each cause.
            eprintln!("error: {error}");
            error.chain().skip(1).for_each(|cause| eprintln!("  because: {cause}"));
            ExitCode::FAILURE
        }
    }
}

/// Prints on standard output. The standard library's macros panic where a reader has seen enough and closed the pipe (`| head`); here what is left is said to
/// nobody, and the files are written all the same.
fn say(text: std::fmt::Arguments<'_>) {
    match std::io::stdout().lock().write_fmt(text) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            eprintln!("error: cannot write to standard output: {error}");
        }
        _ => {}
    }
}

fn run(command: Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Identify(args) => identify::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::Diagnose(args) => diagnose::run(&args),
        Command::Export(args) => export::run(&args),
        Command::Friction(args) => friction::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Withheld(args) => withheld::run(&args),
        Command::Bag(args) => bag::run(&args),
    }
}
