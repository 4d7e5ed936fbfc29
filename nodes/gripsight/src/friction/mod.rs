//! `gripsight friction`: what pictures on disk say about the road, and what a track teaches.

pub(crate) mod calibrate;

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use gripsight_bag::TopicMap;
use gripsight_friction::{Basis, Estimate, Frame, FrameData, read_picture};
use serde_json::{Map, Value, json};

use crate::Outcome;
use crate::camera::{CameraArgs, each_picture};
use calibrate::CalibrateArgs;

/// Estimate the friction of the road in pictures, each on its own; or learn a track.
///
/// A picture that cannot be used (dark, blurred, unlike the ones trained on) is no failure: it is `valid: false` with its
/// reason, and carries the uninformative prior.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "\
Examples:
  gripsight friction road.jpg
  gripsight friction --json *.png | jq '.[] | select(.valid) | .mu_hat'
  gripsight friction --calibration lab.json --region 0.2,0.5,0.8,0.9 laps.mcap"
)]
pub(crate) struct FrictionArgs {
    #[command(subcommand)]
    command: Option<FrictionCommand>,
    /// JPEG or PNG files, or bags with pictures.
    #[arg(value_name = "IMAGE", required = true)]
    images: Vec<PathBuf>,
    /// Print JSON: a list with mu_hat, sigma, p, valid and reason of each picture.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    camera: CameraArgs,
}

#[derive(Debug, Subcommand)]
enum FrictionCommand {
    Calibrate(Box<CalibrateArgs>),
}

/// Whether a path is a bag: a folder, or a file with a bag's ending.
pub(crate) fn is_bag(path: &Path) -> bool {
    path.is_dir() || path.extension().is_some_and(|end| end == "mcap" || end == "db3")
}

pub(crate) fn run(args: &FrictionArgs) -> anyhow::Result<Outcome> {
    if let Some(FrictionCommand::Calibrate(args)) = &args.command {
        return calibrate::run(args);
    }
    let mut estimator = args.camera.estimator()?;
    let mut list = Vec::new();
    let mut say = |name: &str, estimate: &Estimate, basis: &Basis| {
        if args.json {
            list.push(to_json(name, estimate, basis));
        } else {
            println!("{}", line(name, estimate, basis));
        }
    };
    for path in &args.images {
        if is_bag(path) {
            let stem = path.display();
            each_picture(path, &TopicMap::default(), &args.camera, |shot| {
                let frame = Frame { stamp_ns: shot.stamp_ns, data: shot.data };
                let estimate = estimator.update(&frame, shot.stamp_ns, &shot.motion);
                say(&format!("{stem}@{}", shot.stamp_ns), &estimate, estimator.basis());
                Ok(())
            })?;
            continue;
        }
        let bytes = read_picture(path)?;
        let estimate = estimator.read_single(&Frame { stamp_ns: 0, data: FrameData::Compressed(&bytes) });
        say(&path.display().to_string(), &estimate, estimator.basis());
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&list)?);
    }
    Ok(Outcome::Done)
}

fn to_json(name: &str, estimate: &Estimate, basis: &Basis) -> Value {
    let p: Map<String, Value> =
        basis.classes.iter().zip(&estimate.probability).map(|(c, p)| (c.name.clone(), json!(p))).collect();
    json!({
        "image": name,
        "mu_hat": estimate.mu,
        "sigma": estimate.sigma,
        "p": p,
        "valid": estimate.valid(),
        "reason": estimate.reason.map(|r| r.as_str()),
        "detail": estimate.detail,
        "entropy": estimate.entropy,
        "network_mu": estimate.network_mu,
        "new_floor": estimate.known.map(|_| estimate.new_floor()),
    })
}

fn line(name: &str, estimate: &Estimate, basis: &Basis) -> String {
    if let Some(reason) = estimate.reason {
        let detail = estimate.detail.as_ref().map(|d| format!(" ({d})")).unwrap_or_default();
        return format!("{name}: not usable: {}{detail}", reason.as_str());
    }
    let p: Vec<String> = basis
        .classes
        .iter()
        .zip(&estimate.probability)
        .map(|(class, p)| format!("{} {:.0} %", class.name, 100.0 * p))
        .collect();
    let floor = match estimate.known {
        None => "",
        Some(_) if estimate.new_floor() => "; a new floor",
        Some(_) => "; as the track taught",
    };
    format!("{name}: mu {:.2} +- {:.2} ({}){floor}", estimate.mu, estimate.sigma, p.join(", "))
}
