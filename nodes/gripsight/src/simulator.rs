//! `gripsight diagnose --simulator`: what makes the user's own simulator unlike the car.

use std::fs;
use std::path::Path;
use std::time::Instant;

use anyhow::Context;
use gripsight_bag::TopicMap;
use gripsight_report::{PatchSaid, SimulatorInput, TopicUse, simulator_page, simulator_text, topic_uses};
use gripsight_simulator::{
    Commands, Question, Roll as _, Simulator, SimulatorDiagnosis, SimulatorFile, Span, diagnose, error_over,
    patch,
};
use gripsight_vehicle::VehicleParameters;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::diagnose::{DiagnoseArgs, Timing, header, read, vehicle};
use crate::notes::read_notes;
use crate::{Outcome, outputs};

const PATCH_FILE: &str = "simulator.patch";
/// What the names of the simulator's own parameters begin with.
const OWN: &str = "simulator.";

/// gap.json: the diagnosis, the patch's verification, and what both rest on.
#[derive(Serialize)]
struct GapFile<'a> {
    #[serde(flatten)]
    diagnosis: &'a SimulatorDiagnosis,
    patch: PatchFile<'a>,
    topics: Vec<TopicUse<'a>>,
    data_notes: &'a [String],
}

#[derive(Serialize)]
pub(crate) struct PatchFile<'a> {
    written: bool,
    verified: Option<f64>,
    by_hand: &'a [String],
}

impl<'a> PatchFile<'a> {
    fn of(said: &'a PatchSaid) -> Self {
        Self { written: !said.diff.is_empty(), verified: said.verified, by_hand: &said.by_hand }
    }
}

/// What a drive that no fit has seen says: the error over the noise of the simulator as it came, and of the one with the effects named.
#[derive(Serialize)]
pub(crate) struct OtherDrive {
    before: f64,
    after: f64,
}

/// gap.json of a pair of the blind check.
#[derive(Serialize)]
pub(crate) struct PairFile<'a> {
    #[serde(flatten)]
    diagnosis: &'a SimulatorDiagnosis,
    patch: PatchFile<'a>,
    other_drive: OtherDrive,
}

/// Runs `diagnose` with a simulator.
pub(crate) fn run(args: &DiagnoseArgs, simulator_file: &Path) -> anyhow::Result<Outcome> {
    let start = Instant::now();
    outputs::check(&args.out, &["gap.json", "report.html", "timing.json", PATCH_FILE], None, &[&args.bag])?;
    let topics = args.topics.as_deref().map(TopicMap::read).transpose()?.unwrap_or_default();
    // The simulator brings the car's figures: without a file only the report's name of the car is missing.
    let vehicle = match &args.vehicle {
        Some(path) => vehicle(Some(path))?,
        None => VehicleParameters::f1tenth(),
    };
    let file = SimulatorFile::read(simulator_file)?;
    let (sequence, report) = read(&args.bag, &topics)?;
    let commands = Commands::of(&sequence);
    let reading_s = start.elapsed().as_secs_f64();
    let simulator = Simulator::start(&file)?;
    let spinner =
        ProgressBar::new_spinner().with_style(ProgressStyle::with_template("{spinner} {msg} {elapsed}")?);
    let mut progress = |stage: &str| {
        spinner.set_message(stage.to_owned());
        spinner.tick();
        tracing::debug!("{stage}");
    };
    let question = Question { file: &file, sequence: &sequence, commands, without: &args.without };
    let result = diagnose(&simulator, &question, &mut progress)
        .with_context(|| format!("cannot diagnose {}", args.bag.display()))?;
    progress("the patched simulator");
    let (said, _) = patched(&file, &simulator, &question, &result)?;
    spinner.finish_and_clear();
    let diagnosing_s = start.elapsed().as_secs_f64() - reading_s;
    let notes = read_notes(&report);
    let header = header(&args.bag, &vehicle, &sequence);
    let page = simulator_page(&SimulatorInput {
        diagnosis: &result,
        patch: &said,
        header: &header,
        data_notes: &notes,
    })?;
    let gap = GapFile {
        diagnosis: &result,
        patch: PatchFile::of(&said),
        topics: topic_uses(&report.topics),
        data_notes: &notes,
    };
    let total_s = start.elapsed().as_secs_f64();
    let simulator_s = Some(result.simulator.took_s[1]);
    let timing = Timing { reading_s, diagnosing_s, total_s, simulator_s };
    let mut files = vec![
        ("gap.json", serde_json::to_string_pretty(&gap)? + "\n"),
        ("report.html", page),
        ("timing.json", serde_json::to_string_pretty(&timing)? + "\n"),
    ];
    if !said.diff.is_empty() {
        files.push((PATCH_FILE, said.diff.clone()));
    }
    for (name, text) in &files {
        let path = args.out.join(name);
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    let patch_path = args.out.join(PATCH_FILE);
    if said.diff.is_empty() && patch_path.exists() {
        // One of an earlier run fits the parameter file no longer.
        fs::remove_file(&patch_path).with_context(|| format!("cannot remove {}", patch_path.display()))?;
    }
    print!("{}", simulator_text(&result, &said, &notes));
    if let (false, Some(parameters)) = (said.diff.is_empty(), file.parameter_path()) {
        let folder = parameters.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let patch = patch_path.canonicalize().unwrap_or(patch_path);
        println!(
            "next       (cd {} && patch -p1 < {}), and diagnose again",
            folder.display(),
            patch.display()
        );
    }
    let names: Vec<&str> = files.iter().map(|f| f.0).collect();
    println!("files      {} ({})", args.out.display(), names.join(", "));
    Ok(Outcome::Done)
}

/// Diagnoses a bag with a simulator, and says what another drive makes of it: a pair of the blind check, as its gap.json.
pub(crate) fn pair(simulator_file: &Path, bag: &Path, other: &Path) -> anyhow::Result<String> {
    let topics = TopicMap::default();
    let file = SimulatorFile::read(simulator_file)?;
    let [sequence, other] = [read(bag, &topics)?.0, read(other, &topics)?.0];
    let question =
        Question { file: &file, sequence: &sequence, commands: Commands::of(&sequence), without: &[] };
    let simulator = Simulator::start(&file)?;
    let result = diagnose(&simulator, &question, &mut |_| {})?;
    let (said, patched) = patched(&file, &simulator, &question, &result)?;
    let question = Question { sequence: &other, commands: Commands::of(&other), ..question };
    let before = error_over(&simulator, &question, &[], Span::Whole, &[])?.over_noise;
    // What is in no file is changed by hand, as the answer says.
    let in_file = |name: &str| {
        let own = name.strip_prefix(OWN);
        let parameters = &simulator.description().parameters;
        own.is_some_and(|own| parameters.iter().any(|p| p.name == own && !p.keys.is_empty()))
    };
    let is_named = |name: &str| result.effects.iter().any(|e| e.accepted && e.name == *name);
    let named: Vec<(String, f64)> =
        result.fitted.iter().filter(|(name, _)| is_named(name) && !in_file(name)).cloned().collect();
    let after = match patched {
        None if named.is_empty() => before,
        Some(patched) => error_over(&patched, &question, &named, Span::Whole, &[])?.over_noise,
        None => error_over(&simulator, &question, &named, Span::Whole, &[])?.over_noise,
    };
    let file = PairFile {
        diagnosis: &result,
        patch: PatchFile::of(&said),
        other_drive: OtherDrive { before, after },
    };
    Ok(serde_json::to_string(&file)? + "\n")
}

/// The patch of the parameter file, what the simulator that reads it says of held-out data, and that simulator. One that these are not
/// clearly better with is not given.
fn patched(
    file: &SimulatorFile,
    simulator: &Simulator,
    question: &Question<'_>,
    result: &SimulatorDiagnosis,
) -> anyhow::Result<(PatchSaid, Option<Simulator>)> {
    let found = patch(file, simulator.description(), &result.changes)?;
    let Some(found) = found else { return Ok((PatchSaid::default(), None)) };
    let mut said = PatchSaid { by_hand: found.by_hand.clone(), ..PatchSaid::default() };
    let Some(path) = file.parameter_path().filter(|_| !found.changed.is_empty()) else {
        return Ok((said, None));
    };
    // Beside a copy of its neighbours: a parameter file may name others.
    let copy = tempfile::tempdir().context("cannot make a temporary folder")?;
    let parent = path.parent().unwrap_or(Path::new("."));
    copy_files(parent, copy.path()).with_context(|| format!("cannot copy {}", parent.display()))?;
    let name = path.file_name().context("the parameter file has no name")?;
    fs::write(copy.path().join(name), &found.text).context("cannot write the patched parameters")?;
    let patched = Simulator::start_with(file, Some(&copy.path().join(name)))
        .context("cannot start the simulator with the patched parameters")?;
    let around: Vec<(String, f64)> =
        result.fitted.iter().filter(|(name, _)| !name.starts_with(OWN)).cloned().collect();
    let error = error_over(&patched, question, &around, Span::HeldOut, &result.residuals)?;
    said.verified = Some(error.over_noise);
    said.is_no_better = !error.is_clearly_less;
    if said.is_no_better {
        return Ok((said, None));
    }
    said.diff = found.diff;
    Ok((said, Some(patched)))
}

/// Copies a folder's own files; large ones are no parameters.
fn copy_files(from: &Path, to: &Path) -> std::io::Result<()> {
    const MOST_BYTES: u64 = 1 << 20;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let about = entry.metadata()?;
        if about.is_file() && about.len() <= MOST_BYTES {
            fs::copy(entry.path(), to.join(entry.file_name()))?;
        }
    }
    Ok(())
}
