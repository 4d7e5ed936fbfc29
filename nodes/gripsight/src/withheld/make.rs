//! `gripsight withheld make`: cases, and labels that are sealed.

use std::fs;
use std::path::PathBuf;
use std::sync::Mutex;

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use gripsight_withheld_make::{
    Batch, BatchSettings, COMMITMENT, Journal, MeasuredDrives, Pool, SimulatorPairs,
};
use indicatif::{ParallelProgressIterator as _, ProgressBar, ProgressStyle};
use rayon::prelude::*;

use crate::Outcome;

/// Make cases whose effect is withheld, and seal what was true of them.
///
/// DIR receives a folder per case (bag.mcap, heldout.mcap, vehicle.yaml, pacejka.yaml, without.txt) and commitment.txt, the
/// SHA-256 of the label file. Publish the commitment, keep the labels away from whoever diagnoses.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct MakeArgs {
    /// Cases of the reference car: a quarter without effect, a sixth each with an effect that the library lacks, with the true
    /// effect left out of the library and with two effects, the rest with one.
    #[arg(long, value_name = "N", required_unless_present = "simulators", default_value_t = 0)]
    cases: usize,
    /// Seed of the batch; without it, one from the system's random source, which the labels then hold.
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Cars and tracks: those to develop on, or those to test on.
    #[arg(long, value_enum, default_value_t = PoolName::Test)]
    pool: PoolName,
    /// Length of every bag in seconds.
    #[arg(long, value_name = "S", default_value_t = 24.0, value_parser = duration)]
    duration: f64,
    /// Drives of plants that others wrote, a folder each (tests/plants/make_foreign_bags.py makes them); effects of sensors and
    /// actuators are put in.
    #[arg(long, value_name = "DIR", requires = "foreign_cases")]
    foreign: Option<PathBuf>,
    /// Cases of them.
    #[arg(long, value_name = "N", requires = "foreign")]
    foreign_cases: Option<usize>,
    /// Recorded bags, a folder each with the .mcap file and vehicle.yaml; effects of sensors and actuators are put in.
    #[arg(long, value_name = "DIR", requires = "recorded_cases")]
    recorded: Option<PathBuf>,
    /// Cases of them.
    #[arg(long, value_name = "N", requires = "recorded")]
    recorded_cases: Option<usize>,
    /// Pairs of simulator and car: half unchanged, a tenth with a structure that the simulator lacks, a tenth with two changes, the
    /// rest with one.
    #[arg(long, value_name = "N", requires = "simulator_maker")]
    simulators: Option<usize>,
    /// What drives them: tests/plants/make_simulator_pairs.py.
    #[arg(long, value_name = "FILE", requires = "simulators")]
    simulator_maker: Option<PathBuf>,
    /// Every case is two drives of one car: earlier.mcap, in place of heldout.mcap, is from before its effects came, and only
    /// these are a change; half of the cars are unchanged.
    #[arg(long, conflicts_with = "simulators")]
    compared: bool,
    /// The Python that has the simulators.
    #[arg(long, value_name = "FILE", default_value = "python3", requires = "simulators")]
    python: PathBuf,
    /// Where the cases go; made if it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The label file to write; outside DIR.
    #[arg(long, value_name = "FILE")]
    labels: PathBuf,
}

const EXAMPLES: &str = "\
Examples:
  gripsight withheld make --cases 600 --out cases --labels labels.json
  gripsight withheld make --cases 60 --seed 1 --pool development --duration 30 --out cases --labels labels.json
  gripsight withheld make --cases 100 --recorded bags --recorded-cases 40 --compared --out cases --labels labels.json";

#[derive(Debug, Clone, Copy, ValueEnum)]
enum PoolName {
    Development,
    Test,
}

fn duration(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(s) if (10.0..=600.0).contains(&s) => Ok(s),
        _ => Err("expected 10 to 600 seconds".to_owned()),
    }
}

/// Runs the subcommand.
pub(crate) fn run(args: &MakeArgs) -> anyhow::Result<Outcome> {
    if args.out.join(COMMITMENT).exists() {
        bail!("{} holds a sealed batch; name another folder", args.out.display());
    }
    if args.labels.exists() {
        bail!("{} exists; name another label file", args.labels.display());
    }
    fs::create_dir_all(&args.out).with_context(|| format!("cannot make {}", args.out.display()))?;
    if args.labels.parent().is_some_and(|folder| same_folder(folder, &args.out)) {
        bail!("the labels must not lie among the cases");
    }
    let pool = match args.pool {
        PoolName::Development => Pool::Development,
        PoolName::Test => Pool::Test,
    };
    let (journal, settings) = Journal::open(&args.labels, args.seed, |seed| BatchSettings {
        cases: args.cases,
        seed,
        pool,
        duration_s: args.duration,
        foreign: drives(args.foreign.as_ref(), args.foreign_cases),
        recorded: drives(args.recorded.as_ref(), args.recorded_cases),
        simulators: pairs(args),
        compared: args.compared,
    })?;
    let batch = Batch::new(settings)?;
    let waiting: Vec<usize> = (0..batch.len())
        .filter(|&i| {
            let case = batch.case_name(i);
            journal.label(&case).is_none() || !args.out.join(&case).is_dir()
        })
        .collect();
    let bar = ProgressBar::new(waiting.len() as u64)
        .with_style(ProgressStyle::with_template("{bar:40} {pos}/{len} cases, {eta} left")?);
    let journal = Mutex::new(journal);
    waiting.par_iter().progress_with(bar).try_for_each(|&index| -> anyhow::Result<()> {
        let label = batch.make(index, &args.out).with_context(|| batch.case_name(index))?;
        match journal.lock() {
            Ok(mut journal) => Ok(journal.note(label)?),
            Err(_) => bail!("another case failed"),
        }
    })?;
    let Ok(journal) = journal.into_inner() else { bail!("a case failed") };
    let (nonce, labels) = journal.content();
    let hash = batch.labels(nonce, labels)?.seal(&args.labels, &args.out)?;
    journal.close()?;
    println!("{}: {} cases", args.out.display(), batch.len());
    println!("{}: sealed, SHA-256 {hash}", args.labels.display());
    Ok(Outcome::Done)
}

fn drives(folder: Option<&PathBuf>, cases: Option<usize>) -> Option<MeasuredDrives> {
    Some(MeasuredDrives { folder: folder?.clone(), cases: cases? })
}

fn pairs(args: &MakeArgs) -> Option<SimulatorPairs> {
    let maker = args.simulator_maker.clone()?;
    Some(SimulatorPairs { maker, python: args.python.clone(), cases: args.simulators? })
}

fn same_folder(a: &std::path::Path, b: &std::path::Path) -> bool {
    let whole = |p: &std::path::Path| {
        let p = if p.as_os_str().is_empty() { std::path::Path::new(".") } else { p };
        p.canonicalize().ok()
    };
    whole(a).is_some_and(|a| Some(a) == whole(b))
}
