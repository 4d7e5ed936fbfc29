//! `gripsight friction calibrate`: a track's floors from labelled pictures or identified drives.

use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{Context, bail};
use clap::Args;
use gripsight_bag::TopicMap;
use gripsight_friction::{
    Calibration, Estimate, Example, FloorFriction, Frame, FrameData, FrictionEstimator, floor_friction,
    read_picture,
};
use gripsight_identification::export::read_text;
use gripsight_report::{CalibrationInput, CalibrationPicture, calibration_page};
use serde_json::Value;

use crate::Outcome;
use crate::camera::{CameraArgs, each_picture};
use crate::invocation::invocation;

/// Spread of a floor's friction that is stated without one.
const LABEL_SIGMA: f64 = 0.05;
/// Parts of a source: pictures of one part follow each other.
const PARTS: u32 = 10;
/// Pictures of a drive that are looked at, at most.
const PICTURES_A_DRIVE: usize = 120;
/// Pictures of each source on the page.
const SHOWN: usize = 6;

/// Learn what a track's floors are worth: from folders of pictures, or from drives with pictures that were identified.
///
/// The camera is then believed on these floors as far as pictures left out were read right, and only there: another floor is said to be new, and
/// another track needs its own file. Ten pictures a floor do. FILE holds figures of the pictures, not the pictures; FILE's report shows some.
///
/// A drive teaches where its set may be used and the peak of one axle at least was reached, resting on no prior, or the camera would learn from itself.
/// Drives that teach nothing are said and left out. MU is what the car's tires reach on the floor (D), which an identification reports.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gripsight friction calibrate --label carpet=pictures/carpet:0.9 --label tiles=pictures/tiles:0.55 --out lab.json
  gripsight friction calibrate --results out/monday=monday.mcap --results out/tuesday=tuesday.mcap --out lab.json
  gripsight identify laps.mcap --camera --calibration lab.json --out result")]
pub(crate) struct CalibrateArgs {
    /// A floor, a folder of pictures of it, and its peak friction: NAME=FOLDER:MU, or NAME=FOLDER:MU:SIGMA.
    #[arg(long = "label", value_name = "NAME=FOLDER:MU")]
    labels: Vec<Label>,
    /// A folder that `gripsight identify` wrote, and the bag with the drive's pictures.
    #[arg(long, value_name = "DIR=BAG")]
    results: Vec<Drive>,
    /// The track's name.
    #[arg(long, value_name = "NAME", default_value = "track")]
    track: String,
    /// The calibration; the report lies beside it as .html.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    camera: CameraArgs,
}

#[derive(Debug, Clone, PartialEq)]
struct Label {
    name: String,
    folder: PathBuf,
    friction: FloorFriction,
}

impl FromStr for Label {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text:?}: expected NAME=FOLDER:MU or NAME=FOLDER:MU:SIGMA");
        let (name, rest) = text.split_once('=').ok_or_else(wrong)?;
        let number = |text: &str| text.parse::<f64>().ok().filter(|x| *x > 0.0 && *x <= 3.0);
        let (before, last) = rest.rsplit_once(':').ok_or_else(wrong)?;
        let last = number(last).ok_or_else(wrong)?;
        let (folder, mu, sigma) = match before.rsplit_once(':').map(|(folder, mu)| (folder, number(mu))) {
            Some((folder, Some(mu))) => (folder, mu, last),
            _ => (before, last, LABEL_SIGMA),
        };
        if name.is_empty() || folder.is_empty() {
            return Err(wrong());
        }
        Ok(Self { name: name.to_owned(), folder: folder.into(), friction: FloorFriction { mu, sigma } })
    }
}

#[derive(Debug, Clone, PartialEq)]
struct Drive {
    results: PathBuf,
    bag: PathBuf,
}

impl FromStr for Drive {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=') {
            Some((results, bag)) if !results.is_empty() && !bag.is_empty() => {
                Ok(Self { results: results.into(), bag: bag.into() })
            }
            _ => Err(format!("{text:?}: expected DIR=BAG")),
        }
    }
}

/// A picture that was looked at.
struct Shown {
    example: Example,
    region_jpeg: Vec<u8>,
}

pub(crate) fn run(args: &CalibrateArgs) -> anyhow::Result<Outcome> {
    if args.labels.is_empty() && args.results.is_empty() {
        bail!("nothing to learn from: give --label NAME=FOLDER:MU or --results DIR=BAG");
    }
    let mut estimator = args.camera.estimator()?;
    let mut seen = Vec::new();
    for label in &args.labels {
        seen.extend(of_folder(label, &mut estimator)?);
    }
    for drive in &args.results {
        seen.extend(of_drive(drive, args, &mut estimator)?);
    }
    if seen.is_empty() {
        bail!("no drive teaches anything: corner harder, until the tires of one axle slide");
    }
    let examples: Vec<Example> = seen.iter().map(|s| s.example.clone()).collect();
    let calibration = Calibration::learn(&args.track, &examples)?;
    calibration.write_file(&args.out)?;
    let page = page(args, &calibration, &seen)?;
    let report = args.out.with_extension("html");
    fs::write(&report, page).with_context(|| format!("cannot write {}", report.display()))?;
    let errors = calibration.errors();
    println!(
        "{}: {} pictures; left out part by part they are read with an error of {:.2}, the network's is {:.2}; {} and {}",
        args.track,
        calibration.examples().len(),
        errors.known,
        errors.network,
        args.out.display(),
        report.display()
    );
    Ok(Outcome::Done)
}

/// What was read of a picture, as an example; says why it is none.
fn example(
    estimate: &Estimate,
    name: &str,
    source: &str,
    part: u32,
    friction: FloorFriction,
) -> Option<Example> {
    let quality = estimate.reason.filter(|r| r.is_of_the_picture());
    match (&estimate.appearance, quality) {
        (Some(appearance), None) => Some(Example {
            appearance: appearance.clone(),
            mu: friction.mu,
            sigma: friction.sigma,
            source: source.to_owned(),
            part,
            network_mu: estimate.network_mu,
        }),
        _ => {
            let why = estimate.reason.map_or("unreadable", |r| r.as_str());
            tracing::warn!("{name} left out: {why}");
            None
        }
    }
}

/// The region that was read, for the page.
fn seen_jpeg(estimator: &FrictionEstimator) -> Vec<u8> {
    let mut out = Vec::new();
    if let Some(picture) = estimator.last_input() {
        let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut out, 70);
        if let Err(error) =
            encoder.encode(&picture.data, picture.width, picture.height, image::ExtendedColorType::Rgb8)
        {
            tracing::warn!("a picture is missing on the page: {error}");
        }
    }
    out
}

fn of_folder(label: &Label, estimator: &mut FrictionEstimator) -> anyhow::Result<Vec<Shown>> {
    let folder = label.folder.display();
    let entries = fs::read_dir(&label.folder).with_context(|| format!("cannot read {folder}"))?;
    let mut files = entries.map(|e| e.map(|e| e.path())).collect::<Result<Vec<_>, _>>()?;
    files.retain(|f| f.is_file());
    files.sort();
    let count = files.len() as u32;
    let mut seen = Vec::new();
    for (k, file) in files.iter().enumerate() {
        let bytes = read_picture(file)?;
        let estimate = estimator.read_single(&Frame { stamp_ns: 0, data: FrameData::Compressed(&bytes) });
        let part = k as u32 * PARTS.min(count) / count;
        let name = file.display().to_string();
        if let Some(example) = example(&estimate, &name, &label.name, part, label.friction) {
            seen.push(Shown { example, region_jpeg: seen_jpeg(estimator) });
        }
    }
    if seen.is_empty() {
        bail!("{folder}: no picture can be used (JPEG and PNG are read)");
    }
    Ok(seen)
}

fn of_drive(
    drive: &Drive,
    args: &CalibrateArgs,
    estimator: &mut FrictionEstimator,
) -> anyhow::Result<Vec<Shown>> {
    let Some(friction) = friction_found(&drive.results)? else { return Ok(Vec::new()) };
    let source = drive.results.display().to_string();
    let mut stamps = Vec::new();
    each_picture(&drive.bag, &TopicMap::default(), &args.camera, |shot| {
        stamps.push(shot.stamp_ns);
        Ok(())
    })?;
    let stride = stamps.len().div_ceil(PICTURES_A_DRIVE).max(1);
    let (mut seen, mut at) = (Vec::new(), 0usize);
    estimator.reset();
    each_picture(&drive.bag, &TopicMap::default(), &args.camera, |shot| {
        if at.is_multiple_of(stride) {
            let estimate = estimator.update(
                &Frame { stamp_ns: shot.stamp_ns, data: shot.data },
                shot.stamp_ns,
                &shot.motion,
            );
            let part = (at as u32).saturating_mul(PARTS) / stamps.len().max(1) as u32;
            if let Some(example) = example(&estimate, &shot.stamp_ns.to_string(), &source, part, friction) {
                seen.push(Shown { example, region_jpeg: seen_jpeg(estimator) });
            }
        }
        at += 1;
        Ok(())
    })?;
    if seen.is_empty() {
        bail!("{}: no picture can be used", drive.bag.display());
    }
    Ok(seen)
}

/// What an identification found of the floor, by the axles whose peak was reached and rests on no prior; none where there is nothing to learn from it,
/// which is said.
pub(crate) fn friction_found(results: &Path) -> anyhow::Result<Option<FloorFriction>> {
    let path = results.join("identification.json");
    let text = read_text(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let found: Value =
        serde_json::from_str(&text).with_context(|| format!("cannot use {}", path.display()))?;
    if found["accepted"] != true {
        tracing::warn!("{} was not accepted: it teaches nothing", path.display());
        return Ok(None);
    }
    let peaks: Vec<[f64; 3]> = ["front", "rear"]
        .iter()
        .map(|axle| &found["peak_friction"][axle])
        .filter(|peak| peak["reached"] == true && peak["from_prior"] != true)
        .filter_map(|peak| Some([peak["value"].as_f64()?, peak["low"].as_f64()?, peak["high"].as_f64()?]))
        .collect();
    let friction = floor_friction(&peaks);
    if friction.is_none() {
        tracing::warn!(
            "{}: neither axle's peak was reached; the drive shows what the floor holds at least, and teaches nothing",
            path.display()
        );
    }
    Ok(friction)
}

fn page(args: &CalibrateArgs, calibration: &Calibration, seen: &[Shown]) -> anyhow::Result<String> {
    let mut pictures: Vec<CalibrationPicture> = Vec::new();
    let mut sources: Vec<&str> = seen.iter().map(|s| s.example.source.as_str()).collect();
    sources.dedup();
    for source in sources {
        let own: Vec<&Shown> = seen.iter().filter(|s| s.example.source == source).collect();
        let stride = own.len().div_ceil(SHOWN).max(1);
        for shown in own.iter().step_by(stride) {
            let known = calibration.read(&shown.example.appearance);
            pictures.push(CalibrationPicture {
                source: source.to_owned(),
                jpeg: shown.region_jpeg.clone(),
                label: shown.example.mu,
                mu: known.mu,
                sigma: known.sigma,
                network_mu: shown.example.network_mu,
            });
        }
    }
    let command = invocation(std::env::args());
    let hash = calibration.hash();
    let version = env!("CARGO_PKG_VERSION");
    Ok(calibration_page(&CalibrationInput {
        track: &args.track,
        hash: &hash,
        tool_version: version,
        command: &command,
        known_error: calibration.errors().known,
        network_error: calibration.errors().network,
        new_source_error: calibration.errors().new_source,
        within_sigma: calibration.errors().within_sigma,
        count: calibration.examples().len(),
        pictures: &pictures,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_is_a_name_a_folder_and_a_friction() {
        let plain: Label = "tiles=some/folder:0.55".parse().unwrap();
        assert_eq!((plain.name.as_str(), plain.folder.to_str()), ("tiles", Some("some/folder")));
        assert_eq!(plain.friction, FloorFriction { mu: 0.55, sigma: LABEL_SIGMA });
        let known: Label = "tiles=c:/pictures:0.55:0.1".parse().unwrap();
        assert_eq!(known.folder.to_str(), Some("c:/pictures"));
        assert_eq!(known.friction, FloorFriction { mu: 0.55, sigma: 0.1 });
        for wrong in ["tiles", "tiles=folder", "=folder:0.5", "tiles=folder:-1", "tiles=folder:wet"] {
            assert!(wrong.parse::<Label>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_drive_teaches_only_where_its_peak_was_reached() {
        let folder = tempfile::tempdir().unwrap();
        let written = |accepted: bool, reached: bool| {
            let peak = serde_json::json!({"value": 0.8, "low": 0.76, "high": 0.84, "reached": reached, "from_prior": false});
            let found =
                serde_json::json!({"accepted": accepted, "peak_friction": {"front": peak, "rear": peak}});
            fs::write(folder.path().join("identification.json"), found.to_string()).unwrap();
            friction_found(folder.path())
        };
        let got = written(true, true).unwrap();
        let got = got.unwrap();
        assert!((got.mu - 0.8).abs() < 1e-9 && got.sigma > 0.02, "{got:?}");
        assert_eq!((written(true, false).unwrap(), written(false, true).unwrap()), (None, None));
    }
}
