//! Every effect of the library on the reference car, one after the other: what the diagnosis says of it.
//!
//!     cargo run --release -p gripsight_diagnosis --example effect_table -- [--car NAME] --out FOLDER [EFFECT...]
//!
//! Puts the rows of the effects asked for (all of them, and `none`) into FOLDER/effects_CAR.csv, in place of what stood there, and writes
//! FOLDER/effects_CAR.md from it. Each effect is driven at twice its typical size and at its typical size, both halved until the driver holds
//! the car on the track, and compared with a reference drive without it. No threshold was set on these seeds.

#[path = "../tests/common/mod.rs"]
mod common;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::Context;
use common::{drive_at, nominal};
use gripsight_diagnosis::{Diagnosis, Earlier, EffectParameter, Request, Verdict, diagnose};
use gripsight_model::EffectId;
use gripsight_reference_car::{CarParameters, effect_spec};
use gripsight_signals::StateSequence;

const DURATION_S: f64 = 60.0;
const PACE: f64 = 0.8;
/// Seeds of the reference and of the drives.
const SEEDS: [u64; 2] = [93, 94];
const HEAD: &str = "car,effect,share,true_size,verdict,named,confused_with,parameter,size,low,high,answer,closed,nominal,retuned,after,ceiling,s4_residual,noise,confidence,time_s";
/// With the tires free in one drive these are other tires (knowledge of the method, not of a case).
const OTHER_TIRES: [&str; 4] = ["grip_scale", "grip_balance", "low_grip_patch", "tire_wear"];
/// Sizes that are tried, as shares of the typical one: the two largest that the driver holds are driven.
const SHARES: [f64; 5] = [2.0, 1.0, 0.5, 0.25, 0.125];
const SIZES: usize = 2;
/// Error over that without the effect up to which there is nothing to be seen of it: of the model of the reference drive, and with its tires retuned.
const UNSEEN: f64 = 1.3;

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
    let order: Vec<&str> =
        std::iter::once("none").chain(EffectId::candidates().map(EffectId::name)).collect();
    if names.is_empty() {
        names = order.iter().map(|n| (*n).to_owned()).collect();
    }
    fs::create_dir_all(&out)?;
    let path = out.join(format!("effects_{car_name}.csv"));
    let mut rows: BTreeMap<(usize, usize), String> = BTreeMap::new();
    let place =
        |name: &str| order.iter().position(|n| *n == name).with_context(|| format!("no effect {name}"));
    for line in fs::read_to_string(&path).unwrap_or_default().lines().skip(1) {
        let effect = place(line.split(',').nth(1).unwrap_or_default())?;
        if names.iter().all(|name| *name != order[effect]) {
            let number = rows.range((effect, 0)..(effect + 1, 0)).count();
            rows.insert((effect, number), line.to_owned());
        }
    }
    let car = CarParameters::by_name(&car_name)?;
    let vehicle = nominal(&car);
    let [reference, quiet] = SEEDS.map(|seed| drive_at(&car, &[], PACE, DURATION_S, seed));
    let (reference, quiet) = (reference?, quiet?);
    let earlier = Earlier::diagnosed(&Request::new(&reference, &vehicle), &mut |_| {})?;
    let diagnosed = |recording: &StateSequence| {
        let request = Request { earlier: Some(&earlier), ..Request::new(recording, &vehicle) };
        diagnose(&request, &mut |_| {})
    };
    let without = diagnosed(&quiet)?;
    for name in &names {
        let drives = driven(&car, name, &quiet);
        if drives.is_empty() {
            println!("{name}: the driver holds the car at none of the sizes");
        }
        for (number, (share, true_size, recording)) in drives.iter().enumerate() {
            let started = Instant::now();
            let d = diagnosed(recording).with_context(|| name.clone())?;
            let time_s = started.elapsed().as_secs_f64();
            let line = row(&car, name, [*share, *true_size], &d, &without, time_s);
            println!("{line}");
            rows.insert((place(name)?, number), line);
            let csv = rows.values().fold(format!("{HEAD}\n"), |csv, row| csv + row + "\n");
            fs::write(&path, &csv)?;
            fs::write(out.join(format!("effects_{car_name}.md")), markdown(&car_name, &csv))?;
        }
    }
    Ok(())
}

/// The drives with an effect, the largest sizes that the driver holds: share of the typical size, size, recording.
fn driven(car: &CarParameters, name: &str, quiet: &StateSequence) -> Vec<(f64, f64, StateSequence)> {
    let Ok(spec) = effect_spec(name) else { return vec![(0.0, 0.0, quiet.clone())] };
    let p = &spec.parameters[0];
    let typical = if car.wheelbase_m() < 1.0 { p.typical_small } else { p.typical };
    let of = |share: f64| {
        // More use of the grip than all of it there is not.
        if name == "combined_slip" && share > 1.0 {
            return None;
        }
        let size = match p.null {
            Some(null) if null.is_finite() => null + share * (typical - null),
            _ => typical / share,
        };
        let recording = drive_at(car, &[&format!("{name}={size}")], PACE, DURATION_S, SEEDS[1]).ok()?;
        Some((share, size, recording))
    };
    SHARES.into_iter().filter_map(of).take(SIZES).collect()
}

fn row(
    car: &CarParameters,
    name: &str,
    [share, true_size]: [f64; 2],
    d: &Diagnosis,
    without: &Diagnosis,
    time_s: f64,
) -> String {
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
        "{},{name},{share},{true_size},{},{},{confused},{sizing},{:.5},{:.5},{:.5},{},{:.3},{:.2},{:.2},{:.2},{:.2},{:.2},{:.2},{:.2},{time_s:.1}",
        car.name,
        d.verdict.name(),
        named.join(" "),
        p.value,
        p.low,
        p.high,
        answer(name, true_size, d, without, p),
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
fn answer(name: &str, true_size: f64, d: &Diagnosis, without: &Diagnosis, p: &EffectParameter) -> String {
    let accepted: Vec<_> = d.effects.iter().filter(|e| e.accepted).collect();
    let no_gap = matches!(d.verdict, Verdict::NoGap | Verdict::TireRetuneOnly);
    // What the reference drive shows of an effect may be the plant's own, or something else that the effect takes the place of.
    let null = effect_spec(name).ok().and_then(|s| s.parameters[0].null).unwrap_or_default();
    let on_top = true_size + p.before.map_or(0.0, |before| before - null);
    let told = [true_size, on_top].iter().any(|size| (p.low..=p.high).contains(size));
    let inside = if told { "inside" } else { "outside" };
    let only = if accepted.len() > 1 { " and more" } else { "" };
    let no_more = |of: fn(&Diagnosis) -> f64| of(d) < UNSEEN * of(without);
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
        None if accepted.is_empty() && no_gap && no_more(|d| d.gap.nominal.value) => {
            "none: leaves no more than a drive without it".into()
        }
        None if accepted.is_empty() && no_gap && no_more(|d| d.gap.retuned.value) => {
            "none: other tires do the same".into()
        }
        None if accepted.is_empty() => "not seen".into(),
        None => "wrong name".into(),
    }
}

fn markdown(car: &str, csv: &str) -> String {
    let mut out = format!(
        "# Every effect on the {car}\n\nReference car, club track, {DURATION_S} s, pace {PACE}, steering dither; the two largest of so many times the typical size that the driver holds (twice, once, a half and less); compared with a reference drive without the effect.\nSeeds {SEEDS:?} (reference, drive): no threshold was set on them. Command and role: README.md.\n\n"
    );
    for (i, line) in csv.lines().enumerate() {
        let _ = writeln!(out, "| {} |", line.replace(',', " | "));
        if i == 0 {
            let _ = writeln!(out, "|{}", " --- |".repeat(line.matches(',').count() + 1));
        }
    }
    out
}
