//! Every effect of the library on the reference car, one after the other: what the diagnosis says of it.
//!
//!     cargo run --release -p gripsight_gap --example effect_table -- [--car NAME] --out FOLDER [EFFECT...]
//!
//! Puts the rows of the effects asked for (all of them, and `none`) into FOLDER/effects_CAR.csv, in place of what stood there, and writes
//! FOLDER/effects_CAR.md from it. Each effect has its typical size, halved until the driver holds the car on the track. The tires are taken from
//! a reference drive without the effect. No threshold was set on these seeds.

#[path = "../tests/common/mod.rs"]
mod common;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;
use common::{drive, nominal};
use gripsight_gap::{Diagnosis, EffectId, EffectParameter, Request, Verdict, diagnose};
use gripsight_reference_car::{CarParameters, effect_spec};
use gripsight_signals::StateSequence;

const DURATION_S: f64 = 60.0;
const HEAD: &str = "car,effect,true_size,verdict,named,confused_with,parameter,size,low,high,answer,closed,nominal,retuned,after,ceiling,s4_residual,noise,confidence,time_s";
/// With the tires free in one drive these are other tires (knowledge of the method, not of a case).
const OTHER_TIRES: [&str; 4] = ["grip_scale", "grip_balance", "low_grip_patch", "tire_wear"];
/// Times that a size is halved.
const HALVINGS: i32 = 3;

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
    let out = out.context("--out FOLDER is needed")?;
    let order: Vec<&str> = std::iter::once("none").chain(EffectId::ALL.iter().map(|e| e.name())).collect();
    if names.is_empty() {
        names = order.iter().map(|n| (*n).to_owned()).collect();
    }
    fs::create_dir_all(&out)?;
    let path = out.join(format!("effects_{car_name}.csv"));
    let mut rows: BTreeMap<usize, String> = BTreeMap::new();
    let place =
        |name: &str| order.iter().position(|n| *n == name).with_context(|| format!("no effect {name}"));
    for line in fs::read_to_string(&path).unwrap_or_default().lines().skip(1) {
        rows.insert(place(line.split(',').nth(1).unwrap_or_default())?, line.to_owned());
    }
    let car = CarParameters::by_name(&car_name)?;
    let reference = drive(&car, &[], DURATION_S, 51)?;
    let vehicle = nominal(&car);
    for name in &names {
        let (recording, true_size) = match driven(&car, name) {
            Ok(driven) => driven,
            Err(error) => {
                println!("{error:#}");
                continue;
            }
        };
        let started = Instant::now();
        let request = Request { reference: Some(&reference), ..Request::new(&recording, &vehicle) };
        let d = diagnose(&request, &mut |_| {}).with_context(|| name.clone())?;
        let line = row(&car, name, true_size, &d, started.elapsed().as_secs_f64());
        println!("{line}");
        rows.insert(place(name)?, line);
        let csv = rows.values().fold(format!("{HEAD}\n"), |csv, row| csv + row + "\n");
        fs::write(&path, &csv)?;
        fs::write(out.join(format!("effects_{car_name}.md")), markdown(&car_name, &csv))?;
    }
    Ok(())
}

/// A drive with an effect, and its size: the typical one, or as much of it as the driver can hold.
fn driven(car: &CarParameters, name: &str) -> anyhow::Result<(StateSequence, f64)> {
    if name == "none" {
        return Ok((drive(car, &[], DURATION_S, 52)?, 0.0));
    }
    let p = &effect_spec(name)?.parameters[0];
    let typical = if car.wheelbase_m() < 1.0 { p.typical_small } else { p.typical };
    let mut last = Err(anyhow::anyhow!("no size tried"));
    for share in (0..=HALVINGS).map(|k| 0.5_f64.powi(k)) {
        let size = match p.null {
            Some(null) if null.is_finite() => null + share * (typical - null),
            _ => typical / share,
        };
        last = drive(car, &[&format!("{name}={size}")], DURATION_S, 52).map(|recording| (recording, size));
        if last.is_ok() {
            break;
        }
    }
    last.with_context(|| format!("{name}: the driver holds the car at none of the sizes"))
}

fn row(car: &CarParameters, name: &str, true_size: f64, d: &Diagnosis, time_s: f64) -> String {
    let accepted = || d.effects.iter().filter(|e| e.accepted);
    let named: Vec<&str> = accepted().map(|e| e.name).collect();
    let confused = accepted().next().map(|e| e.confused_with.join(" ")).unwrap_or_default();
    let own = d.effects.iter().find(|e| e.name == name);
    let sizing = effect_spec(name).ok().map_or("", |s| s.parameters[0].name);
    let size = own.and_then(|e| e.parameters.get(sizing).or(e.parameters.values().next()));
    let unknown = EffectParameter { value: f64::NAN, low: f64::NAN, high: f64::NAN, unit: "1", before: None };
    let p = size.unwrap_or(&unknown);
    let gap = &d.gap;
    let mut line = String::new();
    let _ = write!(
        line,
        "{},{name},{true_size},{},{},{confused},{sizing},{:.5},{:.5},{:.5},{},{:.3},{:.2},{:.2},{:.2},{:.2},{:.2},{:.2},{:.2},{time_s:.1}",
        car.name,
        d.verdict.name(),
        named.join(" "),
        p.value,
        p.low,
        p.high,
        answer(name, true_size, d, p),
        d.gap_closed_fraction.value,
        gap.nominal.value,
        gap.retuned.value,
        gap.after.value,
        gap.unstructured_ceiling.value,
        gap.s4_residual.value,
        gap.noise_floor.value,
        accepted().next().map_or(0.0, |e| e.confidence)
    );
    line
}

/// The answer in words.
fn answer(name: &str, true_size: f64, d: &Diagnosis, p: &EffectParameter) -> String {
    let accepted: Vec<_> = d.effects.iter().filter(|e| e.accepted).collect();
    let no_gap = matches!(d.verdict, Verdict::NoGap | Verdict::TireRetuneOnly);
    let inside = if p.low <= true_size && true_size <= p.high { "inside" } else { "outside" };
    let only = if accepted.len() > 1 { " and more" } else { "" };
    match accepted.iter().position(|e| e.name == name) {
        Some(0) => format!("named first{only}; size {inside}"),
        Some(_) => format!("named later; size {inside}"),
        None if accepted.iter().any(|e| e.confused_with.contains(&name)) => "in the group named".into(),
        None if d.invisible.iter().any(|i| i.name == name) => "invisible".into(),
        None if name == "none" && no_gap => "right".into(),
        None if name == "none" && !accepted.is_empty() => "false alarm".into(),
        None if OTHER_TIRES.contains(&name) && d.verdict == Verdict::TireRetuneOnly => {
            "tire retune only: as documented".into()
        }
        None if accepted.is_empty() => "not seen".into(),
        None => "wrong name".into(),
    }
}

fn markdown(car: &str, csv: &str) -> String {
    let mut out = format!(
        "# Every effect on the {car}\n\nReference car, club track, {DURATION_S} s, steering dither; typical size, halved until the driver holds the car; tires from a reference drive without the effect.\nSeeds 51 (reference) and 52: no threshold was set on them. Command and role: README.md.\n\n"
    );
    for (i, line) in csv.lines().enumerate() {
        let _ = writeln!(out, "| {} |", line.replace(',', " | "));
        if i == 0 {
            let _ = writeln!(out, "|{}", " --- |".repeat(line.matches(',').count() + 1));
        }
    }
    out
}
