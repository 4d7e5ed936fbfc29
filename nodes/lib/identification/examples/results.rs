//! Scores the identification against true forces and writes tests/results/identification/.
//!
//! ```text
//! cargo run --release -p gripsight_identification --example results [-- FOREIGN_BAGS]
//! ```
//!
//! FOREIGN_BAGS: a folder of bag folders with `truth_axle_forces.csv` (slipx, CommonRoad). Reference-car seeds 31 and up are test seeds:
//! nothing was chosen on them (settings were chosen by looking at seeds 21 to 24).
#[allow(dead_code)]
mod support;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Result;
use gripsight_identification::{Config, FrictionPrior, Method, Outcome, ResidualKind, identify};
use plotters::prelude::*;
use support::{Run, floor, read_with_truth, reference_run, score};

/// Sets of the reference car that are scored: car, track, friction, pace, seed.
const DRIVES: [(&str, &str, f64, f64, u64); 12] = [
    ("f1tenth", "club", 0.9, 0.9, 31),
    ("f1tenth", "esses", 0.7, 0.95, 32),
    ("f1tenth", "bean", 1.1, 0.95, 33),
    ("formula_student", "club", 0.9, 0.9, 34),
    ("formula_student", "clover", 0.7, 0.95, 35),
    ("formula_student", "esses", 1.1, 0.95, 36),
    ("race_car", "club", 0.9, 0.95, 37),
    ("race_car", "clover", 0.8, 0.95, 38),
    ("race_car", "esses", 0.7, 0.95, 39),
    ("passenger_car", "club", 0.9, 0.95, 40),
    ("passenger_car", "clover", 0.7, 0.95, 41),
    ("passenger_car", "esses", 0.8, 0.95, 42),
];

struct Scored {
    run: String,
    method: &'static str,
    rmse: [f64; 2],
    floor: [f64; 2],
    iterations: u32,
    seconds: f64,
    accepted: bool,
}

fn identify_timed(run: &Run, prior: Option<f64>, config: &Config) -> Result<(Outcome, f64)> {
    let prior = prior.map(|mu| FrictionPrior { mu, sigma: 0.1 });
    let begin = Instant::now();
    let outcome = identify(&run.sequence, &run.vehicle, prior, None, config, &mut |_| {})?;
    Ok((outcome, begin.elapsed().as_secs_f64()))
}

fn scored(run: &Run, method: &'static str, prior: Option<f64>, config: &Config) -> Result<Scored> {
    let (outcome, seconds) = identify_timed(run, prior, config)?;
    let floor = [floor(&run.truth.front)?.1, floor(&run.truth.rear)?.1];
    let rmse = score(&outcome.phi_p, &run.truth);
    let row = Scored {
        run: run.name.clone(),
        method,
        rmse,
        floor,
        iterations: outcome.iterations,
        seconds,
        accepted: outcome.accepted,
    };
    eprintln!("{method}: {} {:.3} {:.3}", row.run, row.rmse[0] / floor[0], row.rmse[1] / floor[1]);
    Ok(row)
}

fn table(rows: &[Scored]) -> String {
    let mut text = String::from(
        "| run | method | RMSE front | rear | ratio to the floor, front | rear | iterations | s | accepted |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for r in rows {
        let _ = writeln!(
            text,
            "| {} | {} | {:.4} | {:.4} | {:.2} | {:.2} | {} | {:.2} | {} |",
            r.run,
            r.method,
            r.rmse[0],
            r.rmse[1],
            r.rmse[0] / r.floor[0],
            r.rmse[1] / r.floor[1],
            r.iterations,
            r.seconds,
            if r.accepted { "yes" } else { "no" }
        );
    }
    for axle in 0..2 {
        let mut ratios: Vec<f64> = rows.iter().map(|r| r.rmse[axle] / r.floor[axle]).collect();
        ratios.sort_by(f64::total_cmp);
        let middle = ratios.get(ratios.len() / 2).copied().unwrap_or(f64::NAN);
        let _ = writeln!(text, "\nMedian ratio {}: {middle:.2}", ["front", "rear"][axle]);
    }
    text
}

/// Mean over the runs, one row a method.
fn means(rows: &[Scored]) -> String {
    let mut methods: Vec<&str> = rows.iter().map(|r| r.method).collect();
    methods.dedup();
    let mut text =
        String::from("| method | RMSE front | rear | iterations | s |\n| --- | --- | --- | --- | --- |\n");
    for method in methods {
        let of: Vec<&Scored> = rows.iter().filter(|r| r.method == method).collect();
        let mean = |f: &dyn Fn(&Scored) -> f64| of.iter().map(|r| f(r)).sum::<f64>() / of.len() as f64;
        let _ = writeln!(
            text,
            "| {method} | {:.3} | {:.3} | {:.1} | {:.2} |",
            mean(&|r| r.rmse[0]),
            mean(&|r| r.rmse[1]),
            mean(&|r| f64::from(r.iterations)),
            mean(&|r| r.seconds)
        );
    }
    text
}

/// Bars of the ratios, front and rear.
fn bars(rows: &[Scored], path: &Path) -> Result<()> {
    let root = SVGBackend::new(path, (900, 420)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(12)
        .caption("RMSE of F_y/F_z as a ratio to the floor (blue front, grey rear)", ("sans-serif", 18))
        .x_label_area_size(24)
        .y_label_area_size(40)
        .build_cartesian_2d(0.0..rows.len() as f64, 0.0..4.0)?;
    chart.configure_mesh().disable_x_mesh().x_labels(0).draw()?;
    for axle in 0..2 {
        let color = [BLUE, RGBColor(140, 140, 140)][axle];
        chart.draw_series(rows.iter().enumerate().map(|(i, r)| {
            let left = i as f64 + 0.1 + 0.4 * axle as f64;
            let height = (r.rmse[axle] / r.floor[axle]).min(4.0);
            Rectangle::new([(left, 0.0), (left + 0.35, height)], color.filled())
        }))?;
    }
    root.present()?;
    Ok(())
}

fn csv_of(rows: &[Scored]) -> String {
    let mut text =
        String::from("run,method,rmse_front,rmse_rear,floor_front,floor_rear,iterations,seconds,accepted\n");
    for r in rows {
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{},{}",
            r.run,
            r.method,
            r.rmse[0],
            r.rmse[1],
            r.floor[0],
            r.floor[1],
            r.iterations,
            r.seconds,
            r.accepted
        );
    }
    text
}

fn main() -> Result<()> {
    let root = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../.."));
    let out = root.join("tests/results/identification");
    std::fs::create_dir_all(&out)?;
    let robust = Config::default();

    let mut plants: Vec<Run> = DRIVES
        .iter()
        .map(|&(car, track, mu, pace, seed)| reference_run(car, track, mu, pace, seed, true))
        .collect();
    let mut folders = vec![root.join("../shared/bags/carmaker_experiment3")];
    if let Some(foreign) = std::env::args().nth(1) {
        let mut found: Vec<PathBuf> =
            std::fs::read_dir(foreign)?.map(|e| e.map(|e| e.path())).collect::<Result<_, _>>()?;
        found.sort();
        folders.extend(found);
    }
    for folder in folders.iter().filter(|f| f.join("truth_axle_forces.csv").exists()) {
        plants.push(read_with_truth(folder, f64::INFINITY)?);
    }
    let plants_rows =
        plants.iter().map(|run| scored(run, "robust, S4", None, &robust)).collect::<Result<Vec<_>>>()?;

    // The paper's setting: one car, one surface, 30 s; four drives, two of which end in a spin after 4.42 s and are refused.
    let paper_runs: Vec<Run> =
        [50, 51, 52, 53].map(|seed| reference_run("f1tenth", "club", 0.8, 0.95, seed, true)).into();
    let paper = |residual| Config { method: Method::Paper, residual, ..Config::default() };
    let loop_only = |residual| Config { residual, direct_start: false, ..Config::default() };
    let with = |residual| Config { residual, ..Config::default() };
    let series = |cases: &[(&'static str, Option<f64>, Config)]| -> Result<Vec<Scored>> {
        let mut rows = Vec::new();
        for (name, prior, config) in cases {
            for run in &paper_runs {
                rows.push(scored(run, name, *prior, config)?);
            }
        }
        Ok(rows)
    };
    let vision = series(&[
        ("paper, no vision, mu0 0.51", None, paper(ResidualKind::S4)),
        ("paper, vision 0.80", Some(0.8), paper(ResidualKind::S4)),
        ("robust, no vision, mu0 0.51", None, with(ResidualKind::S4)),
        ("robust, vision 0.80", Some(0.8), with(ResidualKind::S4)),
    ])?;
    let residuals = series(&[
        ("paper, MLP", Some(0.8), paper(ResidualKind::Mlp)),
        ("paper, RNN", Some(0.8), paper(ResidualKind::Rnn)),
        ("paper, S4", Some(0.8), paper(ResidualKind::S4)),
        ("least squares alone", None, with(ResidualKind::None)),
        ("least squares + MLP", None, with(ResidualKind::Mlp)),
        ("least squares + RNN", None, with(ResidualKind::Rnn)),
        ("least squares + S4", None, with(ResidualKind::S4)),
        ("S4 alone, robust sweep, no vision", None, loop_only(ResidualKind::S4)),
        ("S4 alone, robust sweep, vision", Some(0.8), loop_only(ResidualKind::S4)),
        ("MLP alone, robust sweep, vision", Some(0.8), loop_only(ResidualKind::Mlp)),
        ("RNN alone, robust sweep, vision", Some(0.8), loop_only(ResidualKind::Rnn)),
    ])?;

    let text = format!(
        "# Identification against true forces\n\n\
         Command: `cargo run --release -p gripsight_identification --example results -- FOREIGN_BAGS`\n\
         Machine: {} {}, {} threads, shared with other work: times are upper bounds.\n\n\
         RMSE of F_y/F_z over the whole run, at the plant's own slip angles; the floor is the four-parameter Magic Formula fitted to the plant's true \
         forces. Reference car: load transfer, relaxation and combined slip on; seeds 31-42 and 50-53; settings chosen on seeds 21-24, but the foreign bags and CarMaker were looked at with their scores while revising: development data. \
         CarMaker: normalised by the static loads of 2033 kg. No truth is read by the product.\n\n\
         ## Plants\n\n{}\n![ratios](plants.svg)\n\n\
         ## The paper's Table II: vision prior (mean of 4 drives, 1:10 car, mu 0.8)\n\n{}\n\
         Paper: 0.219/0.073 and 7 iterations without, 0.076/0.046 and 2 with the vision prior.\n\n\
         ## The paper's Table III: residual networks (the same drives)\n\n{}\n\
         Paper: MLP 0.234/0.071, RNN 0.097/0.084, S4 0.051/0.033.\n",
        std::env::consts::ARCH,
        std::env::consts::OS,
        std::thread::available_parallelism()?,
        table(&plants_rows),
        means(&vision),
        means(&residuals)
    );
    std::fs::write(out.join("README.md"), text)?;
    std::fs::write(out.join("plants.csv"), csv_of(&plants_rows))?;
    std::fs::write(out.join("table2.csv"), csv_of(&vision))?;
    std::fs::write(out.join("table3.csv"), csv_of(&residuals))?;
    bars(&plants_rows, &out.join("plants.svg"))
}
