//! `gripsight withheld score`: the labels opened, verdicts scored.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use gripsight_bag::{Role, TopicMap};
use gripsight_report::{WithheldInput, withheld_page};
use gripsight_signals::Measurement;
use gripsight_withheld_make::{CaseLabel, Family, Kind, Labels, files};
use gripsight_withheld_score::{
    Answer, Control, Outside, PairScores, Said, Scores, Targets, control, excuse_what_drives_have,
};
use indicatif::{ParallelProgressIterator as _, ProgressBar, ProgressStyle};
use rayon::prelude::*;
use serde::Serialize;

use super::case::{Case, cases, gap_json, said, write_whole};
use super::diagnose::{About, Timing};
use crate::Outcome;
use crate::invocation::invocation;

/// Open the labels of a batch and score the verdicts on it.
///
/// The label file is checked against DIR/commitment.txt first. Each case that the targets speak of is then diagnosed once more with
/// the names of its effects given (the oracle), unless --no-oracle. REPORT receives report.html, score.json, answers.jsonl and score.txt; pairs.csv
/// where the batch has pairs of simulator and car.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLE)]
pub(crate) struct ScoreArgs {
    /// The batch that `withheld make` wrote.
    dir: PathBuf,
    /// What `withheld diagnose` said of it.
    verdicts: PathBuf,
    /// The label file.
    #[arg(long, value_name = "FILE")]
    labels: PathBuf,
    /// Do without the oracle: no shrinkage beside it.
    #[arg(long)]
    no_oracle: bool,
    /// Score the cases that are diagnosed so far. Their order tells nothing, so they stand for the batch.
    #[arg(long)]
    so_far: bool,
    /// Where the files go; made if it is not there.
    #[arg(long, value_name = "REPORT")]
    out: PathBuf,
}

const EXAMPLE: &str = "\
Example:
  gripsight withheld score cases verdicts --labels labels.json --out report";

/// What score.json holds.
#[derive(Serialize)]
struct File<'a> {
    about: &'a About,
    command: String,
    settings: &'a BTreeMap<String, serde_json::Value>,
    seed: u64,
    scores: &'a Scores,
    #[serde(skip_serializing_if = "Option::is_none")]
    pairs: Option<&'a PairScores>,
}

/// Runs the subcommand.
pub(crate) fn run(args: &ScoreArgs) -> anyhow::Result<Outcome> {
    let labels = Labels::open(&args.labels, &args.dir)?;
    let about = About::read(&args.verdicts)?;
    let names = cases(&args.dir)?;
    if names.len() != labels.cases.len() {
        bail!("{} cases, but labels of {}", names.len(), labels.cases.len());
    }
    fs::create_dir_all(&args.out).with_context(|| format!("cannot make {}", args.out.display()))?;
    let targets = Targets::fixed()?;
    let diagnosed =
        |label: &&CaseLabel| !args.so_far || args.verdicts.join(&label.case).join("gap.json").exists();
    let mut answers = labels
        .cases
        .iter()
        .filter(diagnosed)
        .map(|label| answer(label, &args.verdicts))
        .collect::<anyhow::Result<Vec<_>>>()?;
    if answers.len() < labels.cases.len() {
        tracing::warn!("{} of {} cases are diagnosed so far", answers.len(), labels.cases.len());
    }
    let pairs: Vec<Answer> = answers.extract_if(.., |a| a.label.family == Family::Simulator).collect();
    let pairs = (!pairs.is_empty()).then(|| PairScores::of(&pairs));
    excuse_what_drives_have(&mut answers);
    if !args.no_oracle {
        ask_oracle(&mut answers, &targets, args)?;
    }
    answers.par_iter_mut().try_for_each(|answer| -> anyhow::Result<()> {
        if answer.label.kind == Kind::Single {
            answer.baselines = Case::read(&args.dir.join(&answer.label.case))?.baselines()?;
        }
        Ok(())
    })?;
    let scores = Scores::of(&answers, controls(&answers, &args.dir)?, targets);
    let file = File {
        about: &about,
        command: invocation(std::env::args()),
        settings: &labels.settings,
        seed: labels.seed,
        scores: &scores,
        pairs: pairs.as_ref(),
    };
    let lines = answers.iter().map(|a| Ok(serde_json::to_string(a)? + "\n"));
    let text = scores.text() + &pairs.as_ref().map(PairScores::text).unwrap_or_default();
    let page = withheld_page(&WithheldInput {
        scores: &scores,
        batch: &args.dir.file_name().unwrap_or_default().to_string_lossy(),
        commitment: &about.commitment,
        tool_version: &about.version,
        executable_sha256: &about.executable_sha256,
        seed: labels.seed,
        command: &file.command,
    })?;
    write_whole(&args.out.join("report.html"), &page)?;
    write_whole(&args.out.join("answers.jsonl"), &lines.collect::<anyhow::Result<String>>()?)?;
    write_whole(&args.out.join("score.json"), &(serde_json::to_string_pretty(&file)? + "\n"))?;
    write_whole(&args.out.join("score.txt"), &text)?;
    if let Some(pairs) = &pairs {
        let mut table = csv::Writer::from_writer(Vec::new());
        pairs.rows.iter().try_for_each(|row| table.serialize(row))?;
        write_whole(&args.out.join("pairs.csv"), &String::from_utf8(table.into_inner()?)?)?;
    }
    print!("{text}");
    println!("files: {} (report.html, score.txt, score.json, answers.jsonl)", args.out.display());
    Ok(Outcome::Done)
}

fn answer(label: &CaseLabel, verdicts: &Path) -> anyhow::Result<Answer> {
    let folder = verdicts.join(&label.case);
    let timing = folder.join("timing.json");
    let text = fs::read_to_string(&timing)
        .with_context(|| format!("{} is not diagnosed; call `withheld diagnose` again", label.case))?;
    let timing: Timing =
        serde_json::from_str(&text).with_context(|| format!("cannot use {}", timing.display()))?;
    Ok(Answer {
        label: label.clone(),
        said: said(&folder.join("gap.json"))?,
        oracle: None,
        baselines: BTreeMap::new(),
        time_s: timing.diagnosing_s,
    })
}

/// Diagnoses once more with the true names given where shrinkage is compared; what was asked before is read.
fn ask_oracle(answers: &mut [Answer], targets: &Targets, args: &ScoreArgs) -> anyhow::Result<()> {
    let kept = args.out.join("oracle");
    fs::create_dir_all(&kept).with_context(|| format!("cannot make {}", kept.display()))?;
    let asked: Vec<&mut Answer> = answers
        .iter_mut()
        .filter(|a| matches!(a.label.kind, Kind::Single | Kind::Pair) && a.in_scope(targets))
        .collect();
    let bar = ProgressBar::new(asked.len() as u64)
        .with_style(ProgressStyle::with_template("{bar:40} {pos}/{len} oracle runs, {eta} left")?);
    asked.into_par_iter().progress_with(bar).try_for_each(|answer| -> anyhow::Result<()> {
        let path = kept.join(format!("{}.json", answer.label.case));
        if !path.exists() {
            let only: Vec<String> = answer.label.effects.iter().map(|e| e.name.clone()).collect();
            let case = Case::read(&args.dir.join(&answer.label.case))?;
            write_whole(
                &path,
                &serde_json::to_string(&serde_json::from_str::<Said>(&gap_json(&case.diagnose(&only))?)?)?,
            )?;
        }
        answer.oracle = Some(said(&path)?);
        Ok(())
    })
}

/// The topics of a case's bags.
const TOPICS: [&str; 4] = ["/car_state/odom", "/drive", "/imu/data", "/wheel_speeds"];

/// The control by family: sizes of files, counts and stamps of messages, place in the order.
fn controls(answers: &[Answer], dir: &Path) -> anyhow::Result<BTreeMap<String, Control>> {
    let mut by_family: BTreeMap<Family, Vec<Outside>> = BTreeMap::new();
    for (place, answer) in answers.iter().enumerate() {
        let folder = dir.join(&answer.label.case);
        let mut figures = vec![place as f64];
        let is_compared = folder.join(files::EARLIER).exists();
        for name in [files::BAG, if is_compared { files::EARLIER } else { files::HELD_OUT }] {
            let (path, topics) = (folder.join(name), TopicMap::default());
            let info = gripsight_bag::info(&path, &topics)?;
            let (measurements, _) = gripsight_bag::read_measurements(&path, &topics)?;
            let first = |role: Role| {
                measurements.iter().find(|m| m.stream() == role.name()).map(Measurement::stamp_ns)
            };
            let begin = first(Role::Odom).unwrap_or(0);
            figures.extend(Role::ALL.map(|role| first(role).map_or(0.0, |stamp| (stamp - begin) as f64)));
            figures.extend([info.size_bytes as f64, info.duration_s, info.messages as f64]);
            // Drives may lack a stream; every case has the same figures.
            for topic in TOPICS {
                let found = info.topics.iter().find(|t| t.name == topic);
                figures.extend(found.map_or([0.0, 0.0], |t| [t.messages as f64, t.pace.longest_step_s]));
            }
        }
        for name in [files::VEHICLE, files::TIRES, files::WITHOUT] {
            figures.push(fs::metadata(folder.join(name)).map_or(0.0, |m| m.len() as f64));
        }
        by_family.entry(answer.label.family).or_default().push(Outside { kind: answer.label.kind, figures });
    }
    Ok(by_family.into_iter().map(|(family, own)| (family.name().to_owned(), control(&own))).collect())
}
