//! `gripsight diagnose`: where model and car disagree, which effect causes it, how much of it goes away.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, bail};
use clap::builder::PossibleValuesParser;
use clap::error::ErrorKind;
use clap::{Args, Command};
use gripsight_bag::{ReadReport, Role, TopicMap, read_sequences};
use gripsight_diagnosis::{Diagnosis, Earlier, ExtendedModelFile, Request, Together, Verdict, diagnose};
use gripsight_identification::export::{read_text, read_tires, stamp_text};
use gripsight_identification::vehicle_hash;
use gripsight_model::EffectId;
use gripsight_report::{Before, GapInput, Header, TopicUse, gap_page, gap_text, topic_uses};
use gripsight_signals::{Check, Joined, StateSequence, WindowConfig};
use gripsight_vehicle::{TirePosterior, VehicleParameters};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::data::{SignalsOf, for_diagnosis, notes as signal_notes};
use crate::invocation::{file_name, invocation};
use crate::notes::read_notes;
use crate::predictions::{self, Written};
use crate::{Outcome, outputs};

/// Explain where the model and the real car disagree.
///
/// With one BAG the model is the single-track model on the tires of --pacejka, or on tires identified from the bag's training
/// blocks. With two, BAG is compared with BAG2: what has changed from the first drive to the second. With --same-state several drives of a car that
/// nobody has touched are explained together. With --simulator or --simulator-bag the model is your own simulator.
///
/// DIR receives gap.json, report.html, timing.json and extended_model.yaml (with their
/// parameters: the effects named, and beside them what stands in for others that are not among the candidates).
/// Exit code 3: the data cannot tell; with --simulator every verdict is an answer, 0.
#[derive(Debug, Args)]
#[command(after_help = names())]
pub(crate) struct DiagnoseArgs {
    /// An .mcap file or a rosbag2 folder.
    pub(crate) bag: PathBuf,
    /// A later drive of the same car, to be compared with the first: the same as --later.
    bag2: Option<PathBuf>,
    /// More drives, with --same-state.
    #[arg(value_name = "BAG", requires = "same_state")]
    more: Vec<PathBuf>,
    /// All BAGs are drives of the car in the same state: tires, figures and effects are those of all of them, and where one contradicts the
    /// others is said.
    #[arg(long, requires = "bag2", conflicts_with_all = ["later", "heldout", "simulator", "simulator_bag", "predictions"])]
    same_state: bool,
    /// A later drive of the same car: what has changed from BAG to it. One motion recorded twice (a bag and its copy with a signal processed anew)
    /// is compared sample by sample.
    #[arg(long, value_name = "BAG", conflicts_with_all = ["bag2", "pacejka", "extended_model"])]
    later: Option<PathBuf>,
    /// Another drive of the car in the same state, to score on; without it every fourth block is held out.
    #[arg(long, value_name = "BAG")]
    heldout: Option<PathBuf>,
    /// The car, as a ROS 2 parameter file; without it, an F1TENTH-class 1:10 car.
    #[arg(long, value_name = "FILE")]
    pub(crate) vehicle: Option<PathBuf>,
    /// The tires of the model: pacejka.yaml or <car>_pacejka.txt; trusted to a few percent.
    #[arg(long, value_name = "FILE")]
    pacejka: Option<PathBuf>,
    /// The car's own tires with their uncertainty: posterior.json of an identification. On a drive that it was fitted on it is a place to start
    /// from, on another a prior.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["later", "pacejka", "extended_model", "simulator", "simulator_bag"])]
    posterior: Option<PathBuf>,
    /// The model to start from: extended_model.yaml of an earlier diagnosis, its effects in place at their sizes; what is left is diagnosed.
    #[arg(long, value_name = "FILE", conflicts_with = "pacejka")]
    extended_model: Option<PathBuf>,
    /// Your own simulator, as a YAML file that says how to start it: what in it differs from the car, and a patch of its parameter file
    /// (DIR/simulator.patch). Effects may be left out by `--without`; its own parameters by `fixed` in the file.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["bag2", "later", "pacejka", "extended_model", "heldout", "only", "predictions"])]
    pub(crate) simulator: Option<PathBuf>,
    /// A drive of your simulator, where it is closed: another track or driver will do. What differs from the simulator to the car (BAG); what
    /// the simulator itself has that the model lacks is no difference.
    #[arg(long, value_name = "SIM", conflicts_with_all = ["bag2", "later", "pacejka", "extended_model", "simulator"])]
    simulator_bag: Option<PathBuf>,
    /// Leave an effect out of the library. May be repeated.
    #[arg(long, value_name = "EFFECT", value_parser = effects(), hide_possible_values = true)]
    pub(crate) without: Vec<String>,
    /// Consider only this effect. May be repeated.
    #[arg(long, value_name = "EFFECT", value_parser = effects(), hide_possible_values = true, conflicts_with = "without")]
    only: Vec<String>,
    /// A file that maps names to topics, such as `odom: /car_state/odom`; without it topics are found by type.
    #[arg(long, value_name = "FILE")]
    pub(crate) topics: Option<PathBuf>,
    /// Where the files go; made if it is not there.
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Write the bag that is explained once more, with the predictions beside its topics: /gripsight/nominal/odom of the model as it came,
    /// /gripsight/extended/odom of the model with the effects found (open-loop rollouts of half a second, each from the recorded pose on).
    #[arg(long, value_name = "BAG")]
    predictions: Option<PathBuf>,
}

impl DiagnoseArgs {
    /// Ends the program as wrong usage does where options do not go together that would with another one.
    fn check(&self) {
        let given = [
            ("--pacejka", &self.pacejka),
            ("--posterior", &self.posterior),
            ("--extended-model", &self.extended_model),
        ];
        let given = given.iter().find(|(_, file)| file.is_some()).map(|(name, _)| name);
        if let (Some(name), Some(_), false) = (given, &self.bag2, self.same_state) {
            let says = format!(
                "{name} cannot be used with [BAG2], which is compared with BAG, without --same-state"
            );
            Self::augment_args(Command::new("gripsight diagnose"))
                .error(ErrorKind::ArgumentConflict, says)
                .exit();
        }
    }
}

fn effects() -> PossibleValuesParser {
    PossibleValuesParser::new(EffectId::candidates().map(EffectId::name))
}

fn names() -> String {
    let effects: Vec<&str> = EffectId::candidates().map(EffectId::name).collect();
    format!("Effects: {}", effects.join(", "))
}

/// What DIR receives; the model last, which is left out where the data cannot tell.
const FILES: [&str; 4] = ["gap.json", "report.html", "timing.json", MODEL_FILE];
const MODEL_FILE: &str = "extended_model.yaml";

/// gap.json: the diagnosis, and what it rests on.
#[derive(Serialize)]
struct GapFile<'a> {
    #[serde(flatten)]
    diagnosis: &'a Diagnosis,
    /// The car.
    vehicle: &'a VehicleParameters,
    /// The topics used.
    topics: Vec<TopicUse<'a>>,
    /// What reading the data met, in sentences.
    data_notes: &'a [String],
    /// Each signal against each other.
    checks: &'a [Check],
    /// What nothing checks, bad samples, and what was estimated.
    signals: SignalsOf<'a>,
}

#[derive(Serialize)]
pub(crate) struct Timing {
    pub(crate) reading_s: f64,
    pub(crate) diagnosing_s: f64,
    pub(crate) total_s: f64,
    /// In the user's simulator.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) simulator_s: Option<f64>,
}

/// Runs the subcommand.
pub(crate) fn run(args: &DiagnoseArgs) -> anyhow::Result<Outcome> {
    if let Some(file) = &args.simulator {
        return crate::simulator::run(args, file);
    }
    args.check();
    let start = Instant::now();
    // The drive that is explained is the later one or the car's, from the model of the earlier one or the simulator's.
    let together: Vec<&PathBuf> =
        if args.same_state { args.bag2.iter().chain(&args.more).collect() } else { Vec::new() };
    let later = args.later.as_ref().or(args.bag2.as_ref().filter(|_| !args.same_state));
    let (subject, other) = match (later, &args.simulator_bag) {
        (Some(later), _) => (later, Some(&args.bag)),
        (None, simulator) => (&args.bag, simulator.as_ref()),
    };
    let bags = [Some(subject), other, args.heldout.as_ref()].into_iter().flatten();
    let bags: Vec<&Path> = bags.chain(together.iter().copied()).map(PathBuf::as_path).collect();
    outputs::check(&args.out, &FILES, args.predictions.as_deref(), &bags)?;
    let topics = args.topics.as_deref().map(TopicMap::read).transpose()?.unwrap_or_default();
    let vehicle = vehicle(args.vehicle.as_deref())?;
    let tires = args.pacejka.as_deref().map(tires).transpose()?;
    let posterior = args.posterior.as_deref().map(posterior).transpose()?;
    let model = args.extended_model.as_deref().map(extended_model).transpose()?;
    let usable = |path: &Path| -> anyhow::Result<_> {
        let (sequence, report) = read(path, &topics)?;
        let (sequence, recorded) = for_diagnosis(&sequence, &vehicle)
            .with_context(|| format!("cannot diagnose {}", path.display()))?;
        Ok((sequence, report, recorded))
    };
    let (mut sequence, report, recorded) = usable(subject)?;
    let beside = together.iter().map(|path| usable(path)).collect::<anyhow::Result<Vec<_>>>()?;
    let alone: Vec<StateSequence> =
        std::iter::once(&sequence).chain(beside.iter().map(|b| &b.0)).cloned().collect();
    let joined = Joined::of(&alone).context("these bags cannot be explained together")?;
    if args.same_state {
        sequence = joined.sequence;
        // Drives begin at places of their own: where they were says nothing of all of them.
        sequence.x_m.clear();
        sequence.y_m.clear();
    }
    let first = other.map(|path| usable(path)).transpose()?;
    let held_out = args.heldout.as_deref().map(usable).transpose()?;
    let reading_s = start.elapsed().as_secs_f64();
    let spinner =
        ProgressBar::new_spinner().with_style(ProgressStyle::with_template("{spinner} {msg} {elapsed}")?);
    let mut progress = |stage: &str| {
        spinner.set_message(stage.to_owned());
        spinner.tick();
        tracing::debug!("{stage}");
    };
    let of = |sequence| Request {
        tires,
        posterior: posterior.as_ref(),
        model: model.as_ref(),
        without: &args.without,
        only: &args.only,
        ..Request::new(sequence, &vehicle)
    };
    let earlier = first.as_ref().map(|first| Earlier::diagnosed(&of(&first.0), &mut progress));
    let earlier = earlier
        .transpose()
        .with_context(|| format!("cannot diagnose {}", other.unwrap_or(subject).display()))?;
    let request = Request {
        held_out: held_out.as_ref().map(|h| &h.0),
        earlier: earlier.as_ref(),
        together: args.same_state.then_some(Together { alone: &alone, spans_s: &joined.spans_s }),
        ..of(&sequence)
    };
    let mut result = diagnose(&request, &mut progress)
        .with_context(|| format!("cannot diagnose {}", subject.display()))?;
    for (drive, path) in result.drives.iter_mut().zip(std::iter::once(&subject).chain(&together)) {
        drive.name = file_name(path);
    }
    spinner.finish_and_clear();
    let diagnosing_s = start.elapsed().as_secs_f64() - reading_s;
    let mut header = header(subject, &vehicle, &sequence);
    together.iter().for_each(|path| header.bag = format!("{}, {}", header.bag, file_name(path)));
    let compared_with = other.map(|path| file_name(path));
    let before = compared_with.as_deref().map(|name| match args.simulator_bag {
        Some(_) => Before::Simulator(name),
        None => Before::Drive(name),
    });
    let mut notes = [read_notes(&report), signal_notes(&recorded)].concat();
    let others = other.zip(first.as_ref()).into_iter().chain(args.heldout.as_ref().zip(held_out.as_ref()));
    for (path, (_, report, recorded)) in others.chain(together.iter().copied().zip(&beside)) {
        let all = [read_notes(report), signal_notes(recorded)].concat();
        notes.extend(all.iter().map(|note| format!("{}: {note}", file_name(path))));
    }
    let page = gap_page(&GapInput {
        diagnosis: &result,
        header: &header,
        before,
        topics: &report.topics,
        data_notes: &notes,
    })?;
    let gap_file = GapFile {
        diagnosis: &result,
        vehicle: &vehicle,
        topics: topic_uses(&report.topics),
        data_notes: &notes,
        checks: &recorded.checks.checks,
        signals: SignalsOf::new(&recorded),
    };
    let timing =
        Timing { reading_s, diagnosing_s, total_s: start.elapsed().as_secs_f64(), simulator_s: None };
    let texts = [
        serde_json::to_string_pretty(&gap_file)? + "\n",
        page,
        serde_json::to_string_pretty(&timing)? + "\n",
    ];
    let mut files: Vec<(&str, String)> = FILES.into_iter().zip(texts).collect();
    if result.verdict != Verdict::NotIdentifiable {
        files.push((MODEL_FILE, result.extended_model.to_yaml()?));
    }
    for (name, text) in &files {
        let path = args.out.join(name);
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    if let Some(before) = &compared_with {
        println!("compared   {} with {before}", file_name(subject));
    }
    print!("{}", gap_text(&result, before, &notes));
    let names: Vec<&str> = files.iter().map(|f| f.0).collect();
    println!("files      {} ({})", args.out.display(), names.join(", "));
    if let Some(path) = &args.predictions {
        let said = write_predictions(subject, &report, path, &sequence, &result)
            .with_context(|| format!("cannot write {}", path.display()))?;
        println!("predicted  {said}");
    }
    Ok(outcome(&result))
}

/// Writes the predictions, and says what was written.
fn write_predictions(
    bag: &Path,
    report: &ReadReport,
    out: &Path,
    sequence: &StateSequence,
    result: &Diagnosis,
) -> anyhow::Result<String> {
    if result.series.predictions.is_empty() {
        return Ok("nothing: no model was fitted".to_owned());
    }
    let topic = report.streams.topic(Role::Odom);
    let written = predictions::write(bag, topic, out, sequence, &result.series.predictions)?;
    Ok(match written {
        Written::WithPoses => out.display().to_string(),
        Written::WithoutPoses => {
            format!("{} (velocities only: no pose is recorded to begin at)", out.display())
        }
    })
}

fn outcome(result: &Diagnosis) -> Outcome {
    if result.verdict == Verdict::NotIdentifiable { Outcome::NotAccepted } else { Outcome::Done }
}

/// The car of a parameter file.
pub(crate) fn vehicle(path: Option<&Path>) -> anyhow::Result<VehicleParameters> {
    let Some(path) = path else {
        tracing::warn!("no --vehicle: taking the values of an F1TENTH-class 1:10 car");
        return Ok(VehicleParameters::f1tenth());
    };
    let text = read_text(path).with_context(|| format!("cannot read {}", path.display()))?;
    VehicleParameters::from_ros_yaml(&text).with_context(|| format!("cannot use {}", path.display()))
}

/// The tires of a file.
pub(crate) fn tires(path: &Path) -> anyhow::Result<gripsight_vehicle::PacejkaParameters> {
    let text = read_text(path).with_context(|| format!("cannot read {}", path.display()))?;
    read_tires(&text).with_context(|| format!("cannot use {}", path.display()))
}

/// The car's own tires of a file.
pub(crate) fn posterior(path: &Path) -> anyhow::Result<TirePosterior> {
    let text = read_text(path).with_context(|| format!("cannot read {}", path.display()))?;
    let posterior: TirePosterior =
        serde_json::from_str(&text).with_context(|| format!("cannot use {}", path.display()))?;
    posterior.checked().with_context(|| format!("cannot use {}", path.display()))
}

/// The extended model of a file.
pub(crate) fn extended_model(path: &Path) -> anyhow::Result<ExtendedModelFile> {
    let text = read_text(path).with_context(|| format!("cannot read {}", path.display()))?;
    ExtendedModelFile::from_yaml(&text).with_context(|| format!("cannot use {}", path.display()))
}

/// The longest recorded sequence, or everything in one.
pub(crate) fn read(path: &Path, topics: &TopicMap) -> anyhow::Result<(StateSequence, ReadReport)> {
    let whole = WindowConfig { length_s: f64::INFINITY, hop_s: f64::INFINITY };
    let (sequences, report) =
        read_sequences(path, topics, whole).with_context(|| format!("cannot read {}", path.display()))?;
    let longest = sequences.into_iter().max_by(|a, b| a.duration_s().total_cmp(&b.duration_s()));
    match longest {
        Some(sequence) => Ok((sequence, report)),
        None => bail!("{}: no state sequence", path.display()),
    }
}

pub(crate) fn header(bag: &Path, vehicle: &VehicleParameters, sequence: &StateSequence) -> Header {
    let stem = || bag.file_stem().map(|s| s.to_string_lossy().into_owned());
    Header {
        car: vehicle.name.clone().or_else(stem).unwrap_or_else(|| "car".into()),
        bag: file_name(bag),
        data_stamp: stamp_text(sequence.start_stamp_ns),
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        vehicle_hash: vehicle_hash(vehicle),
        seed: None,
        command: invocation(std::env::args()),
    }
}
