//! `gripsight withheld diagnose`: every case explained, the labels unseen.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, bail};
use clap::Args;
use gripsight_withheld_make::{COMMITMENT, files, sha256_hex};
use indicatif::{ParallelProgressIterator as _, ProgressBar, ProgressStyle};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::case::{Case, cases, gap_json, write_whole};
use crate::Outcome;
use crate::simulator::pair;

/// Diagnose every case of a batch; reads DIR only.
///
/// VERDICTS receives a folder per case (gap.json, timing.json) and about.json: which build diagnosed which batch. Called again,
/// it goes on where it stopped.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(crate) struct DiagnoseArgs {
    /// The batch that `withheld make` wrote.
    dir: PathBuf,
    /// Where the verdicts go; made if it is not there.
    #[arg(long, value_name = "VERDICTS")]
    out: PathBuf,
}

const EXAMPLE: &str = "\
Example:
  gripsight withheld diagnose cases --out verdicts";

/// Which build diagnosed which batch.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct About {
    pub(super) version: String,
    pub(super) executable_sha256: String,
    pub(super) commitment: String,
}

impl About {
    fn now(dir: &Path) -> anyhow::Result<Self> {
        let commitment = dir.join(COMMITMENT);
        let executable = std::env::current_exe().context("cannot find this program's file")?;
        Ok(Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            executable_sha256: sha256_hex(&fs::read(&executable).context("cannot read this program's file")?),
            commitment: fs::read_to_string(&commitment)
                .with_context(|| format!("cannot read {}", commitment.display()))?
                .trim()
                .to_owned(),
        })
    }

    /// Reads the file in a folder of verdicts.
    pub(super) fn read(verdicts: &Path) -> anyhow::Result<Self> {
        let path = verdicts.join(ABOUT);
        let text = fs::read_to_string(&path).with_context(|| {
            format!(
                "cannot read {}; is {} what `withheld diagnose` wrote?",
                path.display(),
                verdicts.display()
            )
        })?;
        serde_json::from_str(&text).with_context(|| format!("cannot use {}", path.display()))
    }
}

const ABOUT: &str = "about.json";

/// Time that a case took.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(super) struct Timing {
    pub(super) diagnosing_s: f64,
}

/// Runs the subcommand.
pub(crate) fn run(args: &DiagnoseArgs) -> anyhow::Result<Outcome> {
    let names = cases(&args.dir)?;
    fs::create_dir_all(&args.out).with_context(|| format!("cannot make {}", args.out.display()))?;
    let now = About::now(&args.dir)?;
    if args.out.join(ABOUT).exists() {
        let before = About::read(&args.out)?;
        if before.commitment != now.commitment {
            bail!("{} holds verdicts on another batch; name another folder", args.out.display());
        }
        if before != now {
            bail!(
                "{} holds verdicts of another build; one batch is diagnosed by one build: name another folder",
                args.out.display()
            );
        }
    }
    write_whole(&args.out.join(ABOUT), &(serde_json::to_string_pretty(&now)? + "\n"))?;
    let waiting: Vec<&String> =
        names.iter().filter(|name| !args.out.join(name).join("gap.json").exists()).collect();
    let bar = ProgressBar::new(waiting.len() as u64)
        .with_style(ProgressStyle::with_template("{bar:40} {pos}/{len} cases, {elapsed}, {eta} left")?);
    waiting.par_iter().progress_with(bar).try_for_each(|name| {
        one(&args.dir.join(name), &args.out.join(name)).with_context(|| (*name).clone())
    })?;
    println!("{}: {} verdicts", args.out.display(), names.len());
    Ok(Outcome::Done)
}

fn one(folder: &Path, out: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    let simulator = folder.join(files::SIMULATOR);
    let start = Instant::now();
    let gap = if simulator.exists() {
        pair(&simulator, &folder.join(files::BAG), &folder.join(files::HELD_OUT))?
    } else {
        gap_json(&Case::read(folder)?.diagnose(&[]))? + "\n"
    };
    let timing = Timing { diagnosing_s: start.elapsed().as_secs_f64() };
    write_whole(&out.join("timing.json"), &(serde_json::to_string(&timing)? + "\n"))?;
    // Last, for its being there says that the case is done.
    write_whole(&out.join("gap.json"), &gap)
}
