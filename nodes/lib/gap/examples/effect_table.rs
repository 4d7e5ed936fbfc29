//! Every effect of the library on the reference car, one after the other: what the diagnosis says of it.
//!
//!     cargo run --release -p gripsight_gap --example effect_table -- [--car NAME] [--out FOLDER] [EFFECT...]
//!
//! Writes FOLDER/effects_CAR.csv and FOLDER/effects_CAR.md. The tires are taken from a reference drive without the effect. No threshold
//! was set on these seeds.

#[path = "../tests/common/mod.rs"]
mod common;

use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;
use common::{drive, nominal};
use gripsight_gap::{Diagnosis, EffectId, Request, diagnose};
use gripsight_reference_car::CarParameters;

const DURATION_S: f64 = 60.0;
/// Sizes below the typical ones, so that the driver can hold the car on the track.
const SIZES: [&str; 8] = [
    "grip_scale=-0.05",
    "grip_balance=0.01",
    "low_grip_patch=0.1",
    "steering_lag=0.04",
    "steering_delay=0.025",
    "steering_rate_limit=0.7",
    "yaw_inertia_error=0.8",
    "road_slope=0.02",
];

fn main() -> anyhow::Result<()> {
    let mut car_name = "formula_student".to_owned();
    let mut out: Option<PathBuf> = None;
    let mut names: Vec<String> = Vec::new();
    let mut arguments = std::env::args().skip(1);
    while let Some(a) = arguments.next() {
        match a.as_str() {
            "--car" => car_name = arguments.next().context("--car needs a name")?,
            "--out" => out = Some(arguments.next().context("--out needs a folder")?.into()),
            _ => names.push(a),
        }
    }
    if names.is_empty() {
        names.push("none".to_owned());
        let sized = |name: &str| SIZES.iter().find(|s| s.split('=').next() == Some(name)).copied();
        names.extend(EffectId::ALL.iter().map(|e| sized(e.name()).unwrap_or(e.name()).to_owned()));
    }
    let car = CarParameters::by_name(&car_name)?;
    let reference = drive(&car, &[], DURATION_S, 51)?;
    let vehicle = nominal(&car);
    let mut csv = String::from(
        "car,effect,true_size,verdict,named,confused_with,size,low,high,closed,nominal,retuned,after,ceiling,confidence,time_s\n",
    );
    for name in &names {
        let effects: &[&str] = if name == "none" { &[] } else { &[name] };
        let recording = match drive(&car, effects, DURATION_S, 52) {
            Ok(r) => r,
            Err(e) => {
                println!("{name}: {e}");
                continue;
            }
        };
        let started = Instant::now();
        let request = Request { reference: Some(&reference), ..Request::new(&recording, &vehicle) };
        match diagnose(&request, &mut |_| {}) {
            Ok(d) => {
                let line = row(&car, name, &d, started.elapsed().as_secs_f64());
                print!("{line}");
                csv.push_str(&line);
            }
            Err(e) => println!("{name}: {e}"),
        }
    }
    if let Some(folder) = out {
        std::fs::create_dir_all(&folder)?;
        std::fs::write(folder.join(format!("effects_{car_name}.csv")), &csv)?;
        std::fs::write(folder.join(format!("effects_{car_name}.md")), markdown(&car_name, &csv))?;
    }
    Ok(())
}

fn row(car: &CarParameters, text: &str, d: &Diagnosis, time_s: f64) -> String {
    let name = text.split('=').next().unwrap_or(text);
    let truth = gripsight_reference_car::effect_spec(name)
        .map(|spec| {
            let p = &spec.parameters[0];
            let typical = if car.wheelbase_m() < 1.0 { p.typical_small } else { p.typical };
            text.split_once('=').and_then(|(_, v)| v.parse().ok()).unwrap_or(typical)
        })
        .unwrap_or(0.0);
    let named: Vec<&str> = d.effects.iter().filter(|e| e.accepted).map(|e| e.name).collect();
    let own = d.effects.iter().find(|e| e.name == name).or(d.effects.first());
    let first = own.and_then(|e| {
        let preferred = gripsight_reference_car::effect_spec(name).ok().map(|s| s.parameters[0].name);
        preferred.and_then(|n| e.parameters.get(n)).or(e.parameters.values().next())
    });
    let (size, low, high) = first.map_or((f64::NAN, f64::NAN, f64::NAN), |p| (p.value, p.low, p.high));
    let confused = d.effects.first().map(|e| e.confused_with.join(" ")).unwrap_or_default();
    let mut line = String::new();
    let _ = writeln!(
        line,
        "{},{text},{truth},{},{},{confused},{size:.5},{low:.5},{high:.5},{:.3},{:.2},{:.2},{:.2},{:.2},{:.2},{time_s:.1}",
        car.name,
        d.verdict.name(),
        named.join(" "),
        d.gap_closed_fraction.value,
        d.gap.nominal.value,
        d.gap.retuned.value,
        d.gap.after.value,
        d.gap.unstructured_ceiling.value,
        d.effects.first().map_or(0.0, |e| e.confidence)
    );
    line
}

fn markdown(car: &str, csv: &str) -> String {
    let mut out = format!(
        "# Every effect on the {car}\n\nReference car, club track, {DURATION_S} s, steering dither, typical size; tires from a reference drive. One row per effect.\n\n"
    );
    for (i, line) in csv.lines().enumerate() {
        let _ = writeln!(out, "| {} |", line.replace(',', " | "));
        if i == 0 {
            let _ = writeln!(out, "|{}", " --- |".repeat(line.matches(',').count() + 1));
        }
    }
    out
}
