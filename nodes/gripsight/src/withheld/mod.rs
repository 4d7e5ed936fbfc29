//! `gripsight withheld`: the blind check of the diagnosis.

mod case;
mod diagnose;
mod make;
mod score;
mod simulator;

use clap::{Args, Subcommand};

use crate::Outcome;

/// Score the diagnosis on cases whose effect is withheld from it.
///
/// `make` writes cases and seals what was true of them, `diagnose` explains each case without knowing it, `score` opens the
/// labels and compares.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(crate) struct WithheldArgs {
    #[command(subcommand)]
    command: WithheldCommand,
}

const EXAMPLE: &str = "\
Example:
  gripsight withheld make --cases 600 --out cases --labels labels.json
  gripsight withheld diagnose cases --out verdicts
  gripsight withheld score cases verdicts --labels labels.json --out report

Each step uses all cores, can be stopped at any time and, called again in the same way, goes on where it stopped.";

#[derive(Debug, Subcommand)]
enum WithheldCommand {
    Make(make::MakeArgs),
    Diagnose(diagnose::DiagnoseArgs),
    Score(score::ScoreArgs),
    #[command(hide = true)]
    Simulator(simulator::SimulatorArgs),
}

/// Runs the subcommand.
pub(crate) fn run(args: &WithheldArgs) -> anyhow::Result<Outcome> {
    match &args.command {
        WithheldCommand::Make(args) => make::run(args),
        WithheldCommand::Diagnose(args) => diagnose::run(args),
        WithheldCommand::Score(args) => score::run(args),
        WithheldCommand::Simulator(args) => simulator::run(args),
    }
}
