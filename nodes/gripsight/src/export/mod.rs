//! `gripsight export`: the car that was found, for others' simulators.

mod car;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, Subcommand, ValueEnum};
use gripsight_fmu::{LIBRARY, Version, write};
use gripsight_model::CarFile;
use gripsight_simulator::{Target, export};

use crate::Outcome;
pub(crate) use car::car;

/// Write the car that was found for another simulator.
///
/// RESULT is the folder of an identification (the car's own tires of its posterior.json; without one the tires found, with what was taken out of the
/// signals) or of a diagnosis (the extended model).
/// What a simulator has no term for is said.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gripsight export fmu result --out car.fmu              then: fmpy validate car.fmu
  gripsight export fmu result --out car.fmu --fmi 2
  gripsight export slipx result --out car                then: slipx.load_car(\"car\")
  gripsight export commonroad result --out car           then: setup_vehicle_parameters(1, Path(\"car\"))
  gripsight export ocd result --out vehicle.json         then: set_parameters_from_dict(json.load(open(\"vehicle.json\")))")]
pub(crate) struct ExportArgs {
    #[command(subcommand)]
    target: TargetArgs,
}

#[derive(Debug, Subcommand)]
enum TargetArgs {
    /// A co-simulation unit (FMI 3.0 or 2.0, linux-x86_64): the whole model, with every effect.
    ///
    /// Inputs are the steering and the commanded acceleration, held over a step unless their rates say otherwise, or the motion along the car,
    /// imposed; outputs are the motion of the centre of gravity and what the car's sensors report of it. Tires, figures of the car and sizes of
    /// the effects are parameters of the unit. Steps have one length.
    Fmu(FmuArgs),
    /// A car folder of slipx.
    Slipx(FilesArgs),
    /// A folder of CommonRoad's vehicle models; they have one tire for both axles.
    Commonroad(FilesArgs),
    /// A parameter file of Open-Car-Dynamics (single track, MF_SIMPLE tires).
    Ocd(FilesArgs),
}

#[derive(Debug, Args)]
struct FmuArgs {
    /// The folder of an identification or a diagnosis.
    result: PathBuf,
    /// The unit.
    #[arg(long, value_name = "FILE.fmu")]
    out: PathBuf,
    /// Version of the interface.
    #[arg(long, value_enum, default_value = "3")]
    fmi: Fmi,
    /// The unit's shared object; without it, the one beside this command.
    #[arg(long, value_name = "FILE")]
    library: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Fmi {
    #[value(name = "2")]
    Two,
    #[value(name = "3")]
    Three,
}

#[derive(Debug, Args)]
struct FilesArgs {
    /// The folder of an identification or a diagnosis.
    result: PathBuf,
    /// Where it goes; a folder is made if it is not there.
    #[arg(long, value_name = "PATH")]
    out: PathBuf,
}

pub(crate) fn run(args: &ExportArgs) -> anyhow::Result<Outcome> {
    match &args.target {
        TargetArgs::Fmu(args) => unit(args),
        TargetArgs::Slipx(args) => files(args, Target::Slipx),
        TargetArgs::Commonroad(args) => files(args, Target::Commonroad),
        TargetArgs::Ocd(args) => files(args, Target::OpenCarDynamics),
    }
}

fn unit(args: &FmuArgs) -> anyhow::Result<Outcome> {
    let (car, own) = car(&args.result)?;
    let library = args.library.clone().map_or_else(library_beside, Ok)?;
    let version = match args.fmi {
        Fmi::Two => Version::Two,
        Fmi::Three => Version::Three,
    };
    write(&args.out, version, &car, &library)
        .with_context(|| format!("cannot write {}", args.out.display()))?;
    said(&car, own);
    println!("unit       {}", args.out.display());
    Ok(Outcome::Done)
}

/// The unit's shared object, where it is built or installed with the command.
fn library_beside() -> anyhow::Result<PathBuf> {
    let command = std::env::current_exe().context("cannot tell where this command is")?;
    let folder = command.parent().unwrap_or(Path::new("."));
    let places = [folder.join(LIBRARY), folder.join("deps").join(LIBRARY)];
    let found = places.into_iter().find(|place| place.is_file());
    found.with_context(|| {
        format!(
            "{LIBRARY} is not beside {} (cargo build -p gripsight_fmu makes it); --library names it",
            command.display()
        )
    })
}

fn files(args: &FilesArgs, target: Target) -> anyhow::Result<Outcome> {
    let (car, own) = car(&args.result)?;
    let exported = export(target, &car)?;
    said(&car, own);
    for (name, text) in &exported.files {
        let path = if name.is_empty() { args.out.clone() } else { args.out.join(name) };
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        }
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    if exported.axles_share_a_tire {
        println!("note       one tire serves both axles there: the mean of both, by the loads they carry");
    }
    if !exported.left_out.is_empty() {
        let names: Vec<&str> = exported.left_out.iter().map(|e| e.name()).collect();
        println!("left out   {} (no term for it there)", names.join(", "));
    }
    println!("files      {}", args.out.display());
    Ok(Outcome::Done)
}

fn said(car: &CarFile, own: bool) {
    let axle = |t: &gripsight_vehicle::MagicFormula| format!("{:.3} {:.3} {:.3} {:.3}", t.b, t.c, t.d, t.e);
    println!("tires      front {}, rear {} (B C D E)", axle(&car.tires.front), axle(&car.tires.rear));
    let names: Vec<&str> = car.effects.keys().map(String::as_str).collect();
    println!("effects    {}", if names.is_empty() { "none".to_owned() } else { names.join(", ") });
    if own {
        println!(
            "note       the car's own tires, fitted to the signals as recorded: delay, gain and lever arm are in them"
        );
    }
}
