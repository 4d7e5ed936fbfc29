//! `gripsight simulate`: drives the reference car and writes its bag, its truth and its vehicle file.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use gripsight_bag::{BagWriter, encode};
use gripsight_reference_car::{
    CAR_NAMES, CarParameters, Course, DriverKind, EFFECTS, EffectSetting, Exposure, Friction,
    MANOEUVRE_NAMES, Recording, RoadCamera, Scenario, Simulation, TRACK_NAMES, write_truth_csv,
};
use gripsight_signals::Measurement;
use indicatif::{ProgressBar, ProgressStyle};

use crate::Outcome;

/// The first stamp of every simulated bag, since 1970.
const START_NS: i64 = 1_700_000_000_000_000_000;

/// Drive the reference car and record a bag.
///
/// Beside BAG lie `<stem>.truth.csv` (true forces, slips, loads at every odometry stamp) and `<stem>.vehicle.yaml` (the
/// nominal car). A run that the car ends itself (spin, rollover, standstill, off the track) leaves both up to that moment
/// and exits with 1.
#[derive(Debug, Args)]
#[command(after_help = names())]
pub(crate) struct SimulateArgs {
    /// Which car.
    #[arg(long, value_name = "NAME", default_value = "f1tenth")]
    car: String,
    /// Which track or manoeuvre.
    #[arg(long, value_name = "NAME", default_value = "club")]
    track: String,
    /// Drive the track, or steer the manoeuvre, the other way round.
    #[arg(long)]
    reverse: bool,
    /// Friction of the road.
    #[arg(long, value_name = "MU", default_value_t = 0.9)]
    mu: f64,
    /// Friction after half of the run, where it changes.
    #[arg(long, value_name = "MU")]
    mu_after: Option<f64>,
    /// An effect: NAME (typical size), NAME=VALUE or NAME=PARAMETER:VALUE,PARAMETER:VALUE. May be repeated.
    #[arg(long = "effect", value_name = "NAME[=VALUE]")]
    effects: Vec<String>,
    /// All load transfers, relaxation, combined slip, drag and rolling resistance at the car's own size, beneath the
    /// effects asked for.
    #[arg(long)]
    realistic: bool,
    /// Who drives.
    #[arg(long, value_name = "NAME", default_value = "pure_pursuit", value_parser = ["pure_pursuit", "profile"])]
    driver: String,
    /// Share of the grip that the driver plans to use.
    #[arg(long, value_name = "SHARE", default_value_t = 0.8)]
    pace: f64,
    /// Amplitude of a small broad-band steering movement on top.
    #[arg(long, value_name = "RAD", default_value_t = 0.0)]
    dither: f64,
    /// Sensor noise over its usual size.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    noise: f64,
    /// Share of the samples that are lost.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    dropped: f64,
    /// Standard deviation of the sampling instants.
    #[arg(long, value_name = "S", default_value_t = 0.0)]
    jitter: f64,
    /// Record pictures of the road ahead, whose looks follow its friction, HZ of them a second (2 by default).
    #[arg(long, value_name = "HZ", num_args = 0..=1, default_missing_value = "2")]
    camera: Option<f64>,
    /// Friction that the road looks like, where its looks lie: wet asphalt that grips, ice that looks dry.
    #[arg(long, value_name = "MU", requires = "camera")]
    looks_like: Option<f64>,
    /// Seed of the road's looks, for several drives on one road [default: --seed].
    #[arg(long, value_name = "N", requires = "camera")]
    road: Option<u64>,
    /// Length of the run in seconds.
    #[arg(long, value_name = "S", default_value_t = 30.0)]
    duration: f64,
    /// Seed of noise, gusts, dither and the road's looks.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// The bag to write: an .mcap file, or a rosbag2 folder.
    #[arg(long, value_name = "BAG")]
    out: PathBuf,
}

fn names() -> String {
    let effects: Vec<&str> = EFFECTS.iter().map(|e| e.name).collect();
    format!(
        "Examples:
  gripsight simulate --car race_car --track club --mu 1.1 --realistic --out laps.mcap
  gripsight simulate --effect steering_delay=0.04 --pace 0.9 --seed 7 --out late.mcap
  gripsight simulate --mu 0.4 --camera --out wet.mcap

Cars: {}\nTracks: {}\nManoeuvres: {}\nEffects: {}",
        CAR_NAMES.join(", "),
        TRACK_NAMES.join(", "),
        MANOEUVRE_NAMES.join(", "),
        effects.join(", ")
    )
}

/// Runs the subcommand.
pub(crate) fn run(args: &SimulateArgs) -> anyhow::Result<Outcome> {
    let scenario = scenario(args)?;
    let car = scenario.car.clone();
    let bar = ProgressBar::new(100).with_style(ProgressStyle::with_template("{bar:40} {percent} % {eta}")?);
    let recording = Simulation::new(scenario)?.run(|share| bar.set_position((100.0 * share) as u64));
    bar.finish_and_clear();
    let truth_path = beside(&args.out, "truth.csv");
    let vehicle_path = beside(&args.out, "vehicle.yaml");
    let messages = write_bag(args, &recording)?;
    let file =
        File::create(&truth_path).with_context(|| format!("cannot create {}", truth_path.display()))?;
    write_truth_csv(BufWriter::new(file), &recording.truth, START_NS as f64 * 1e-9)?;
    std::fs::write(&vehicle_path, car.vehicle_file(&car.name))
        .with_context(|| format!("cannot write {}", vehicle_path.display()))?;
    println!("{}: {messages} messages", args.out.display());
    println!("{}: {} rows", truth_path.display(), recording.truth.len());
    println!("{}: the nominal {}", vehicle_path.display(), car.name);
    if !recording.end.is_completed() {
        bail!("{}; bag and truth hold the run up to then", recording.end);
    }
    Ok(Outcome::Done)
}

fn scenario(args: &SimulateArgs) -> anyhow::Result<Scenario> {
    let car = CarParameters::by_name(&args.car)?;
    let course = Course::by_name(&args.track, &car, args.reverse)?;
    let kind = if args.driver == "profile" { DriverKind::Profile } else { DriverKind::PurePursuit };
    let friction = match args.mu_after {
        Some(mu_after) => Friction::Changing {
            mu: args.mu,
            mu_after,
            at_s: args.duration / 2.0,
            over_s: args.duration / 20.0,
        },
        None => Friction::Uniform { mu: args.mu },
    };
    let asked = args.effects.iter().map(|text| EffectSetting::parse(text)).collect::<Result<Vec<_>, _>>()?;
    let background = if args.realistic { car.own_effects(args.mu) } else { Vec::new() };
    let mut scenario = Scenario::new(car)
        .course(course)
        .driver(kind, args.pace)
        .dither(args.dither)
        .friction(friction)
        .duration(args.duration)
        .seed(args.seed);
    scenario.effects =
        background.into_iter().filter(|own| asked.iter().all(|a| a.name != own.name)).collect();
    scenario.effects.extend(asked);
    let mut sensors = scenario.sensors.scaled(args.noise);
    for sampling in [&mut sensors.odometry, &mut sensors.imu, &mut sensors.wheels] {
        sampling.dropped = args.dropped;
        sampling.jitter_s = args.jitter;
    }
    sensors.drive_dropped = args.dropped;
    sensors.camera_rate_hz = args.camera.unwrap_or(0.0);
    Ok(scenario.sensors(sensors))
}

/// `<stem>.<ending>` in the bag's folder.
fn beside(bag: &Path, ending: &str) -> PathBuf {
    let stem = bag.file_stem().unwrap_or_default().to_string_lossy();
    bag.with_file_name(format!("{stem}.{ending}"))
}

fn write_bag(args: &SimulateArgs, recording: &Recording) -> anyhow::Result<usize> {
    let mut bag = BagWriter::create(&args.out)?;
    let camera = RoadCamera::new(args.road.unwrap_or(args.seed));
    let looks = |e: &Exposure| Exposure { mu: args.looks_like.unwrap_or(e.mu), ..*e };
    let exposures: Vec<Exposure> = recording.exposures.iter().map(looks).collect();
    let mut exposures = exposures.iter().peekable();
    for sample in &recording.samples {
        while let Some(exposure) = exposures.next_if(|e| e.stamp_s <= sample.stamp_s()) {
            write_picture(&mut bag, &camera, exposure)?;
        }
        let measurement = sample.measurement(START_NS);
        let stamp_ns = measurement.stamp_ns();
        match measurement {
            Measurement::Odometry(m) => bag.write("/car_state/odom", stamp_ns, &encode::odometry(&m))?,
            Measurement::Drive(m) => bag.write("/drive", stamp_ns, &encode::drive(&m))?,
            Measurement::Imu(m) => bag.write("/imu/data", stamp_ns, &encode::imu(&m))?,
            Measurement::Wheels(m) => bag.write("/wheel_speeds", stamp_ns, &encode::wheels(&m))?,
            Measurement::Mapped(_) => {}
        }
    }
    for exposure in exposures {
        write_picture(&mut bag, &camera, exposure)?;
    }
    bag.finish()?;
    Ok(recording.samples.len() + recording.exposures.len())
}

fn write_picture(bag: &mut BagWriter, camera: &RoadCamera, exposure: &Exposure) -> anyhow::Result<()> {
    let stamp_ns = exposure.stamp_ns(START_NS);
    let picture = encode::jpeg(stamp_ns, camera.expose(exposure)?);
    Ok(bag.write("/camera/image/compressed", stamp_ns, &picture)?)
}
