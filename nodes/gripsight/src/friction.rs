//! `gripsight friction`: what pictures on disk say about the road.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use gripsight_friction::{Basis, Estimate, Frame, FrameData};
use serde_json::{Map, Value, json};

use crate::Outcome;
use crate::camera::{NetworkArgs, estimator};

/// Estimate the friction of the road in pictures, each on its own.
///
/// A picture that cannot be used (dark, blurred, unlike the ones trained on) is no failure: it is `valid: false` with its
/// reason, and carries the uninformative prior.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  gripsight friction road.jpg
  gripsight friction --json *.png | jq '.[] | select(.valid) | .mu_hat'")]
pub(crate) struct FrictionArgs {
    /// JPEG or PNG files.
    #[arg(value_name = "IMAGE", required = true)]
    images: Vec<PathBuf>,
    /// Print JSON: a list with mu_hat, sigma, p, valid and reason of each picture.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    network: NetworkArgs,
}

pub(crate) fn run(args: &FrictionArgs) -> anyhow::Result<Outcome> {
    let pictures = args
        .images
        .iter()
        .map(|path| {
            let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
            Ok((path.display().to_string(), bytes))
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    let mut estimator = estimator(&args.network)?;
    let mut list = Vec::new();
    for (name, bytes) in &pictures {
        let estimate = estimator.read_single(&Frame { stamp_ns: 0, data: FrameData::Compressed(bytes) });
        if args.json {
            list.push(to_json(name, &estimate, estimator.basis()));
        } else {
            println!("{}", line(name, &estimate, estimator.basis()));
        }
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
    format!("{name}: mu {:.2} +- {:.2} ({})", estimate.mu, estimate.sigma, p.join(", "))
}
