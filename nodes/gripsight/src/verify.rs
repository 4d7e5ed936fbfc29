//! `gripsight verify`: a set tried on another drive, before it is raced with.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use gripsight_bag::{TopicMap, read_sequences};
use gripsight_identification::export::{checked_tires, read_text, read_tires, read_valid_within};
use gripsight_identification::{AxleCheck, Config, ResidualKind, Status, ValidWithin, identify, verify};
use gripsight_report::text::{fixed, percent};
use gripsight_signals::WindowConfig;
use gripsight_vehicle::{PacejkaParameters, VehicleParameters};
use serde::Deserialize;

use crate::Outcome;

/// Try a set of tires on another drive of the same car.
///
/// The drive is identified by itself, without any prior, and the set's curves are laid over what it shows. The set must not be used, and the
/// exit code is 3, where it promises more than a tenth of the largest force too much, beyond what the drive leaves open, where the car would be
/// unstable with it at the speeds driven, or where the drive shows too little to judge by. What a set promises too little is said, and is no reason.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gripsight verify result/pacejka.yaml warmup.mcap --vehicle car.yaml
  gripsight verify result/identification.json warmup.mcap --vehicle car.yaml
  gripsight verify car_pacejka.txt warmup.mcap --vehicle car.yaml --topics params/stacks/forzaeth.yaml")]
pub(crate) struct VerifyArgs {
    /// The set: the MPC's pacejka.yaml, a controller's <car>_pacejka.txt, or an identification.json.
    set: PathBuf,
    /// An .mcap file or a rosbag2 folder.
    bag: PathBuf,
    /// The car, as a ROS 2 parameter file.
    #[arg(long, value_name = "FILE")]
    vehicle: PathBuf,
    /// A file that maps names to topics, such as `odom: /car_state/odom`; without it topics are found by type.
    #[arg(long, value_name = "FILE")]
    topics: Option<PathBuf>,
}

/// The part of identification.json that tells the set.
#[derive(Deserialize)]
struct Identified {
    phi_p: PacejkaParameters,
    valid_within: Option<Limits>,
}

/// Limits that may be missing.
#[derive(Deserialize)]
struct Limits {
    slip_rad: gripsight_identification::PerAxle<Option<f64>>,
    force_n: gripsight_identification::PerAxle<Option<f64>>,
}

pub(crate) fn read_set(path: &Path) -> anyhow::Result<(PacejkaParameters, Option<ValidWithin>)> {
    let text = read_text(path).with_context(|| format!("cannot read {}", path.display()))?;
    if text.trim_start().starts_with('{') {
        let file: Identified = serde_json::from_str(&text)
            .with_context(|| format!("{} is not an identification.json", path.display()))?;
        let known = |v: gripsight_identification::PerAxle<Option<f64>>| v.map(|v| v.unwrap_or(f64::NAN));
        let limits =
            file.valid_within.map(|l| ValidWithin { slip_rad: known(l.slip_rad), force_n: known(l.force_n) });
        let tires = checked_tires(file.phi_p).with_context(|| format!("cannot use {}", path.display()))?;
        return Ok((tires, limits));
    }
    let tires = read_tires(&text).with_context(|| format!("cannot use {}", path.display()))?;
    Ok((tires, read_valid_within(&text)))
}

pub(crate) fn run(args: &VerifyArgs) -> anyhow::Result<Outcome> {
    let (set, valid) = read_set(&args.set)?;
    let topics = args.topics.as_deref().map(TopicMap::read).transpose()?.unwrap_or_default();
    let text = read_text(&args.vehicle).with_context(|| format!("cannot read {}", args.vehicle.display()))?;
    let vehicle = VehicleParameters::from_ros_yaml(&text)
        .with_context(|| format!("cannot use {}", args.vehicle.display()))?;
    let window = WindowConfig { length_s: f64::INFINITY, hop_s: f64::INFINITY };
    let (sequences, _) = read_sequences(&args.bag, &topics, window)?;
    let Some(sequence) = sequences.last() else { bail!("{}: no state sequence", args.bag.display()) };
    let config = Config { residual: ResidualKind::None, ..Config::default() };
    let drive = identify(sequence, &vehicle, None, None, &config, &mut |_| {})
        .with_context(|| format!("cannot identify the tires from {}", args.bag.display()))?;
    let checked = verify(&set, valid.as_ref(), &drive);
    let usable = checked.against.is_empty();
    let bag = crate::invocation::file_name(&args.bag);
    println!("{}: {}", args.set.display(), if usable { "may be used" } else { "must not be used" });
    checked.against.iter().for_each(|reason| println!("  - {reason}"));
    if drive.status != Status::Rejected {
        let limit = |v: Option<f64>| match v.filter(|v| v.is_finite()) {
            Some(v) => fixed(v.to_degrees(), 1),
            None => "not stated".to_owned(),
        };
        let row = |name: &str, of: &dyn Fn(&AxleCheck) -> String| {
            println!("{name:<44}{:<14}{}", of(&checked.axles.front), of(&checked.axles.rear));
        };
        println!("\n{:<44}{:<14}rear", format!("against {bag}"), "front");
        row("compared up to a slip of, deg", &|c| fixed(c.slip_rad.to_degrees(), 1));
        row("force error over these slips", &|c| percent(c.error));
        row("largest promise above what was shown", &|c| percent(c.above.max(0.0)));
        row("largest force promised too little", &|c| percent(c.below.max(0.0)));
        println!(
            "{:<44}{:<14}{}",
            "the set is valid up to, deg",
            limit(valid.map(|v| v.slip_rad.front)),
            limit(valid.map(|v| v.slip_rad.rear))
        );
    }
    Ok(if usable { Outcome::Done } else { Outcome::NotAccepted })
}
