//! `gripsight identify`: a bag in, tires out.

mod floors;
mod posterior;
pub(crate) mod previous;
mod progress;
mod summary;
mod together;
mod truth;
mod windows;

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use gripsight_bag::{ReadReport, TopicMap, read_sequences};
use gripsight_diagnosis::{ExtendedModelFile, without_effects};
use gripsight_identification::export::{Provenance, TireFiles, read_text};
use gripsight_identification::{
    self as identification, Config, FrictionPrior, Method, OnOneFloor, ResidualKind, Status, ValidWithin,
};
use gripsight_report::{Header, IdentificationInput, identification_page};
use gripsight_signals::{NS_PER_S, StateSequence, WindowConfig};
use gripsight_vehicle::VehicleParameters;

use crate::Outcome;
use crate::camera::{CameraArgs, Seen, pictures_of_bags};
use crate::data::{notes as signal_notes, with_checks};
use crate::diagnose::extended_model;
use crate::invocation::{file_name, invocation};
use crate::notes::read_notes;
use progress::{Progress, Timing};
use windows::Windows;

/// Identify the tires of the car in a bag.
///
/// DIR receives identification.json, report.html, timing.json and the files that other stacks read: pacejka.yaml (MPC),
/// <car>_pacejka.txt and <car>_lookup_table.csv (steering-lookup controllers). They promise no force beyond what the drive has
/// shown, and say up to which slips and forces they are valid (status accepted, or accepted_within where the peak was not reached).
/// posterior.json holds the car's own tires with their uncertainty, for `diagnose --posterior`.
/// Where the result is rejected, those three are named *.rejected.* instead, what lies there already stays as it is, and the
/// exit code is 3. A friction prior never replaces what the data show: it adds a second set, *.provisional.*.
///
/// A bag of odometry and drive commands is taken as one stretch. A bag of recorded state sequences is worked through in
/// their order, as the nodes do live, each starting from the set accepted last; the files describe the last one. So is a bag
/// of odometry with --window; windows.csv then holds every window, and when a change of the grip was noticed.
///
/// Where the grip changes within a drive, each floor is identified by itself: the files describe the last one, which the car is on now; those before it are in
/// DIR/floor_1 and on, and windows.csv holds a line each. A floor_N that an earlier run left, and this one has not, is moved to floor_N.earlier_1.
///
/// Several bags of one car give more slip and tighter intervals; where one of them alone says something else than all together, that is said.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gripsight identify laps.mcap --vehicle car.yaml --out result
  gripsight identify laps.mcap --vehicle car.yaml --prior-mu 1.0 --out result
  gripsight identify morning.mcap noon.mcap --vehicle car.yaml --out result
  gripsight identify laps.mcap --vehicle car.yaml --window 20 --hop 5 --out result
  gripsight identify laps.mcap --vehicle car.yaml --camera --method paper --seed 3 --out result")]
pub(crate) struct IdentifyArgs {
    /// An .mcap file or a rosbag2 folder; several of one car are identified together.
    #[arg(required = true, value_name = "BAG")]
    bags: Vec<PathBuf>,
    /// The car, as a ROS 2 parameter file; without it, an F1TENTH-class 1:10 car.
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,
    /// What is believed of the peak friction: D's soft bound in a second, provisional set where the peak is not reached.
    #[arg(long, value_name = "MU", conflicts_with = "camera", value_parser = positive)]
    prior_mu: Option<f64>,
    /// Standard deviation of that belief.
    #[arg(long, value_name = "SIGMA", default_value_t = 0.1, requires = "prior_mu", value_parser = positive)]
    prior_sigma: f64,
    /// Take that belief from the camera pictures of the bags.
    #[arg(long)]
    camera: bool,
    /// How tires are found: as the paper does, or the most robust way known.
    #[arg(long, value_enum, default_value_t = MethodName::Robust)]
    method: MethodName,
    /// Which network learns what the model leaves over.
    #[arg(long, value_enum, default_value_t = ResidualName::S4)]
    residual: ResidualName,
    /// Epochs of training at most, each turn of the outer loop; fewer leave more for the next turn [default: 60, with --method paper 10].
    #[arg(long, value_name = "N")]
    epochs: Option<usize>,
    /// Seed of everything random.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// A file that maps names to topics, such as `odom: /car_state/odom`; without it topics are found by type.
    #[arg(long, value_name = "FILE")]
    topics: Option<PathBuf>,
    /// An accepted identification.json of the same car: where this run starts, and what it has to beat.
    #[arg(long, value_name = "FILE")]
    previous: Option<PathBuf>,
    /// extended_model.yaml of a diagnosis: its effects are taken out of the signals before the tires are identified.
    #[arg(long, value_name = "FILE")]
    extended_model: Option<PathBuf>,
    /// Identify again and again from a moving window of this length.
    #[arg(long, value_name = "S", value_parser = positive)]
    window: Option<f64>,
    /// How far the window moves.
    #[arg(long, value_name = "S", default_value_t = 10.0, requires = "window", value_parser = positive)]
    hop: f64,
    /// Only the recorded state sequence with this id.
    #[arg(long, value_name = "ID")]
    sequence: Option<u64>,
    /// True lateral forces by stamp (stamp_s, f_y_front_n, f_y_rear_n, ... as `gripsight simulate` writes), for the report only.
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// Name of the surface, for the MPC's file.
    #[arg(long, value_name = "NAME", default_value = "unknown")]
    floor: String,
    /// Where the files go; made if it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    pictures: CameraArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum MethodName {
    Paper,
    Robust,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ResidualName {
    S4,
    Mlp,
    Rnn,
    None,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        Ok(_) => Err("must be positive and finite".into()),
        Err(error) => Err(error.to_string()),
    }
}

impl IdentifyArgs {
    fn config(&self) -> Config {
        Config {
            method: match self.method {
                MethodName::Paper => Method::Paper,
                MethodName::Robust => Method::Robust,
            },
            residual: match self.residual {
                ResidualName::S4 => ResidualKind::S4,
                ResidualName::Mlp => ResidualKind::Mlp,
                ResidualName::Rnn => ResidualKind::Rnn,
                ResidualName::None => ResidualKind::None,
            },
            seed: self.seed,
            epochs: self.epochs,
            ..Config::default()
        }
    }

    fn vehicle(&self) -> anyhow::Result<VehicleParameters> {
        let Some(path) = &self.vehicle else {
            tracing::warn!("no --vehicle: taking the values of an F1TENTH-class 1:10 car");
            return Ok(VehicleParameters::f1tenth());
        };
        let text = read_text(path).with_context(|| format!("cannot read {}", path.display()))?;
        VehicleParameters::from_ros_yaml(&text).with_context(|| format!("cannot use {}", path.display()))
    }

    fn belief(&self, topics: &TopicMap, sequences: &[StateSequence]) -> Belief {
        if !self.camera {
            return Belief::Stated(self.prior_mu.map(|mu| FrictionPrior { mu, sigma: self.prior_sigma }));
        }
        // The data alone are judged first: a prior is one set more, and its lack is no reason to lose the other.
        match pictures_of_bags(&self.bags, topics, &self.pictures) {
            Ok(seen) => {
                let ends_ns = sequences.iter().map(end_ns).max().unwrap_or_default();
                let starts_ns = sequences.iter().map(|s| s.start_stamp_ns).min().unwrap_or_default();
                Belief::Seen(seen.beside(starts_ns, ends_ns))
            }
            Err(error) => {
                tracing::warn!("no friction prior: {error:#}; identified without one");
                Belief::Stated(None)
            }
        }
    }

    /// What to identify from, in order.
    fn sequences(&self, topics: &TopicMap) -> anyhow::Result<(Vec<StateSequence>, ReadReport)> {
        // One window over all there is where none is asked for: identification gets better with every corner.
        let window = match self.window {
            Some(length_s) => WindowConfig { length_s, hop_s: self.hop },
            None => WindowConfig { length_s: f64::INFINITY, hop_s: f64::INFINITY },
        };
        let (mut sequences, report) = read_sequences(self.bag(), topics, window)?;
        if let Some(id) = self.sequence {
            let ids: Vec<String> = sequences.iter().map(|s| s.sequence_id.to_string()).collect();
            sequences.retain(|s| s.sequence_id == id);
            if sequences.is_empty() {
                bail!("no state sequence {id} in {} (there are: {})", self.bag().display(), ids.join(", "));
            }
        }
        Ok((sequences, report))
    }

    /// The bag, the first of several.
    fn bag(&self) -> &Path {
        self.bags.first().map_or(Path::new(""), PathBuf::as_path)
    }
}

/// When a drive ends, ns.
fn end_ns(sequence: &StateSequence) -> i64 {
    sequence.start_stamp_ns + (sequence.duration_s() * NS_PER_S) as i64
}

/// What is believed of the friction before the tires tell.
enum Belief {
    /// The same all along.
    Stated(Option<FrictionPrior>),
    /// What pictures say, each of its place.
    Seen(Seen),
}

impl Belief {
    /// Of the floor that a drive, or a part of one, is on.
    fn of(&self, sequence: &StateSequence) -> Option<FrictionPrior> {
        let seen = match self {
            Self::Stated(prior) => return *prior,
            Self::Seen(seen) => seen,
        };
        match seen.between(sequence.start_stamp_ns, end_ns(sequence)) {
            Ok(prior) => Some(prior),
            Err(error) => {
                tracing::warn!("no friction prior: {error:#}; identified without one");
                None
            }
        }
    }
}

pub(crate) fn run(args: &IdentifyArgs) -> anyhow::Result<Outcome> {
    let mut timing = Timing::default();
    let start = Instant::now();
    together::check(args)?;
    let topics = args.topics.as_deref().map(TopicMap::read).transpose()?.unwrap_or_default();
    let vehicle = args.vehicle()?;
    let mut previous = args.previous.as_deref().map(previous::read).transpose()?;
    let model = args.extended_model.as_deref().map(extended_model).transpose()?;
    let (mut sequences, report) = args.sequences(&topics)?;
    let mut alone = Vec::new();
    if args.bags.len() > 1 {
        (sequences, alone) = together::read(args, &topics, sequences)?;
    }
    if let Some(model) = &model {
        for sequence in &mut sequences {
            *sequence = without_effects(sequence, &vehicle, model)
                .with_context(|| format!("cannot take the effects out of {}", args.bag().display()))?;
        }
    }
    let data = data_notes(&report, model.as_ref());
    timing.reading_s = start.elapsed().as_secs_f64();
    let belief = args.belief(&topics, &sequences);
    timing.camera_s = start.elapsed().as_secs_f64() - timing.reading_s;
    fs::create_dir_all(&args.out).with_context(|| format!("cannot make {}", args.out.display()))?;
    let config = args.config();
    let progress = Progress::new();
    let mut last = None;
    let mut windows = Windows::default();
    for drive in &sequences {
        let mut stages = progress.run(&config);
        let whole = args.bags.len() == 1 && sequences.len() == 1;
        let found = floors::identified(
            (drive, whole),
            &vehicle,
            &|part| belief.of(part),
            previous.as_ref(),
            &config,
            &mut |stage| stages.enter(stage),
        )
        .with_context(|| format!("cannot identify the tires from {}", args.bag().display()))?;
        timing.add(&stages.finish());
        windows.add_changes(&found.changes);
        let parts = found.parts.len();
        floors::set_aside(&args.out, parts)?;
        for (k, OnOneFloor { sequence, mut outcome }) in found.parts.into_iter().enumerate() {
            together::compare(args, &alone, &vehicle, &mut outcome)?;
            let writing = Instant::now();
            let notes: Vec<String> = data.iter().cloned().chain(signal_notes(&outcome.recorded)).collect();
            let out = floors::folder(&args.out, k, parts)?;
            let files = write(args, &out, &vehicle, &notes, &sequence, &outcome)?;
            timing.writing_s += writing.elapsed().as_secs_f64();
            windows.add(&sequence, &outcome, previous.as_ref());
            if k + 1 < parts {
                posterior::write(&out, &vehicle, &sequence, &outcome)?;
                windows.note(&floors::line(drive, &sequence, &outcome, &out));
            } else {
                if outcome.replaces(previous.as_ref()) {
                    previous = outcome.accepted_set().or(previous);
                }
                last = Some((sequence, outcome, notes, files));
                break;
            }
        }
    }
    let Some((sequence, result, notes, mut files)) = last else {
        bail!("{}: no state sequence", args.bag().display())
    };
    let before = start.elapsed().as_secs_f64();
    files.extend(posterior::write(&args.out, &vehicle, &sequence, &result)?);
    timing.total_s = start.elapsed().as_secs_f64();
    timing.posterior_s = timing.total_s - before;
    if windows.len() > 1 {
        files.push(windows.write(&args.out)?);
    } else {
        remove_old(&args.out.join(windows::FILE))?;
    }
    let timing_file = args.out.join("timing.json");
    fs::write(&timing_file, serde_json::to_string_pretty(&timing)? + "\n")
        .with_context(|| format!("cannot write {}", timing_file.display()))?;
    print!("{}", windows.notices());
    print!("{}", summary::summary(&car_name(args, &vehicle), &result, &notes, &files, &timing));
    Ok(if result.accepted { Outcome::Done } else { Outcome::NotAccepted })
}

/// Removes what an earlier run left, where this one has nothing to put in its place.
fn remove_old(path: &Path) -> anyhow::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(error).with_context(|| format!("cannot remove the old {}", path.display()))
        }
        _ => Ok(()),
    }
}

/// The car's name: the vehicle file's, else the bag's.
fn car_name(args: &IdentifyArgs, vehicle: &VehicleParameters) -> String {
    let stem = || args.bag().file_stem().map(|s| s.to_string_lossy().into_owned());
    vehicle.name.clone().or_else(stem).unwrap_or_else(|| "car".into())
}

/// Everything but the times, which are not the result's.
fn write(
    args: &IdentifyArgs,
    out: &Path,
    vehicle: &VehicleParameters,
    notes: &[String],
    sequence: &StateSequence,
    result: &identification::Outcome,
) -> anyhow::Result<Vec<PathBuf>> {
    let provenance = Provenance {
        car: car_name(args, vehicle),
        bag: args.bags.iter().map(|bag| file_name(bag)).collect::<Vec<_>>().join(" + "),
        data_stamp_ns: sequence.start_stamp_ns,
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        vehicle_hash: result.key.vehicle_hash.clone(),
        seed: args.seed,
        command: invocation(std::env::args()),
        status: result.status,
        valid_within: result.valid_within,
        notes: result.reasons.clone(),
    };
    let header = Header {
        car: provenance.car.clone(),
        bag: provenance.bag.clone(),
        data_stamp: provenance.stamp(),
        tool_version: provenance.tool_version.clone(),
        vehicle_hash: provenance.vehicle_hash.clone(),
        seed: Some(args.seed),
        command: provenance.command.clone(),
    };
    let truth =
        args.truth.as_deref().map(|path| truth::curves(path, sequence, vehicle, result)).transpose()?;
    let page = identification_page(&IdentificationInput {
        outcome: result,
        header: &header,
        truth: truth.as_ref(),
        data_notes: notes,
    })?;
    let texts = [
        ("identification.json", serde_json::to_string_pretty(&with_checks(result)?)? + "\n"),
        ("report.html", page),
    ];
    let mut files = Vec::new();
    for (name, text) in texts {
        let path = out.join(name);
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
        files.push(path);
    }
    let tire_files = TireFiles {
        tires: &result.phi_p,
        vehicle,
        provenance: &provenance,
        floor: &args.floor,
        driven_mps: result.v_x_range_mps.high,
    };
    files.extend(tire_files.write(out)?);
    if let Some(set) = result.provisional.filter(|_| result.status != Status::Provisional) {
        let provenance = Provenance {
            status: Status::Provisional,
            valid_within: ValidWithin::NOWHERE,
            notes: vec!["D rests on a friction prior".to_owned()],
            ..provenance.clone()
        };
        let provisional = TireFiles { tires: &set.phi_p, provenance: &provenance, ..tire_files };
        files.extend(provisional.write(out)?);
    }
    Ok(files)
}

/// What reading the bag met, in sentences.
fn data_notes(report: &ReadReport, model: Option<&ExtendedModelFile>) -> Vec<String> {
    let corrected = model.map(|m| {
        let names: Vec<&str> = m.effects.keys().map(String::as_str).collect();
        format!("taken out of the signals before the tires were identified: {}", names.join(", "))
    });
    read_notes(report).into_iter().chain(corrected).collect()
}
