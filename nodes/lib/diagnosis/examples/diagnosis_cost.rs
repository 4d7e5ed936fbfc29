//! What a diagnosis costs: time and memory over the length of the bag, the number of candidates, and the number of effects that are there.
//!
//!     cargo run --release -p gripsight_diagnosis --example diagnosis_cost -- FOLDER
//!
//! Writes FOLDER/cost.csv, cost_length.svg, cost_candidates.svg and cost_effects.svg. Every case runs in a process of its own, three times over; the time is the median, the
//! memory the peak of that process, which also simulates the drive.

#[path = "../tests/common/mod.rs"]
mod common;

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, bail};
use common::{drive, nominal};
use gripsight_diagnosis::{Request, diagnose};
use gripsight_model::EffectId;
use gripsight_reference_car::CarParameters;
use gripsight_report::{Axis, Chart, Layer, Role};

const LENGTHS_S: [f64; 6] = [10.0, 20.0, 30.0, 60.0, 90.0, 120.0];
const CANDIDATES: [usize; 6] = [1, 2, 4, 8, 16, 34];
/// Length of the bag whose time is promised, and the promise.
const LENGTH_S: f64 = 60.0;
const PROMISED_S: f64 = 5.0;
const REPEATS: usize = 3;
/// Effects of the curves over length and candidates, and those of the curve over their number: the first so many.
const ONE: &[&str] = &["tire_relaxation=0.08"];
const SEVERAL: [&str; 3] = ["steering_delay=0.04", "v_y_bias=0.1", "gyro_scale=0.05"];
const HEAD: &str = "curve,length_s,candidates,effects,time_s,fastest_s,peak_mb,verdict";

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [folder] => all(Path::new(folder)),
        ["case", length_s, candidates, ref effects @ ..] => {
            case(length_s.parse()?, candidates.parse()?, effects)
        }
        _ => bail!("usage: diagnosis_cost FOLDER"),
    }
}

/// One case: prints its row.
fn case(length_s: f64, candidates: usize, effects: &[&str]) -> anyhow::Result<()> {
    let car = CarParameters::by_name("f1tenth")?;
    let vehicle = nominal(&car);
    let recording = drive(&car, effects, length_s, 31)?;
    let only: Vec<String> = EffectId::candidates().take(candidates).map(|e| e.name().to_owned()).collect();
    let request = Request { only: &only, ..Request::new(&recording, &vehicle) };
    let mut times_s = Vec::new();
    let mut verdict = "";
    for _ in 0..REPEATS {
        let start = Instant::now();
        verdict = diagnose(&request, &mut |_| {})?.verdict.name();
        times_s.push(start.elapsed().as_secs_f64());
    }
    times_s.sort_by(f64::total_cmp);
    let status = fs::read_to_string("/proc/self/status")?;
    let peak = status.lines().find_map(|l| l.strip_prefix("VmHWM:")).context("no VmHWM")?;
    let peak_kb: f64 = peak.trim().trim_end_matches(" kB").parse()?;
    println!(
        "{length_s},{candidates},{},{:.2},{:.2},{:.0},{verdict}",
        effects.len(),
        times_s[REPEATS / 2],
        times_s[0],
        peak_kb / 1e3
    );
    Ok(())
}

fn all(folder: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(folder)?;
    let all = EffectId::candidates().count();
    let lengths = LENGTHS_S.map(|length_s| ("length", length_s, length_s, all, ONE));
    let candidates = CANDIDATES.map(|count| ("candidates", count as f64, LENGTH_S, count, ONE));
    let several =
        (0..=SEVERAL.len()).map(|count| ("effects", count as f64, LENGTH_S, all, &SEVERAL[..count]));
    let mut csv = format!("{HEAD}\n");
    let mut points: Vec<(&str, f64, f64)> = Vec::new();
    for (curve, place, length_s, candidates, effects) in lengths.into_iter().chain(candidates).chain(several)
    {
        let output = Command::new(std::env::current_exe()?)
            .args(["case", &length_s.to_string(), &candidates.to_string()])
            .args(effects)
            .output()?;
        if !output.status.success() {
            bail!(
                "{length_s} s, {candidates} candidates, {effects:?}: {}",
                String::from_utf8_lossy(&output.stderr)
            );
        }
        let row = String::from_utf8(output.stdout)?;
        print!("{curve},{row}");
        csv.push_str(&format!("{curve},{row}"));
        let time_s: f64 = row.split(',').nth(3).context("no time")?.parse()?;
        points.push((curve, place, time_s));
    }
    fs::write(folder.join("cost.csv"), csv)?;
    let labels = [
        ("length", "length of the bag at 100 Hz / s"),
        ("candidates", "candidate effects"),
        ("effects", "effects in the drive"),
    ];
    for (curve, label) in labels {
        let own = points.iter().filter(|p| p.0 == curve).map(|p| (p.1, p.2)).collect();
        let chart = Chart::new("cost", Axis::new(label).from_zero(), Axis::new("diagnosis / s").from_zero())
            .sized(460, 260)
            .with(Layer::Line { role: Role::Identified, name: "median of three".into(), points: own })
            .with(Layer::Level { role: Role::Measured, name: "wanted for 60 s".into(), y: PROMISED_S });
        fs::write(folder.join(format!("cost_{curve}.svg")), chart.svg()?)?;
    }
    Ok(())
}
