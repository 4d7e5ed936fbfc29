//! Prints as CSV what a whole identification costs over the length of the drive and the width of the network, and draws it.
//!
//! ```text
//! RAYON_NUM_THREADS=1 cargo run --release -p gripsight_identification --example identification_cost -- cost.svg > cost.csv
//! ```
//!
//! Times are the smallest of a few, of the processor alone (Linux): what a shared machine adds is left out.
#[allow(dead_code)]
#[path = "../tests/identification/support.rs"]
mod support;

use std::fs;

use anyhow::{Context, Result};
use gripsight_identification::{Config, identify};
use plotters::coord::Shift;
use plotters::prelude::*;
use support::{drive, scenario, with_background};

const DURATIONS_S: [f64; 6] = [10.0, 15.0, 30.0, 60.0, 120.0, 240.0];
const WIDTHS: [usize; 5] = [4, 8, 16, 32, 64];
const REPEATS: usize = 3;
/// A clock tick of the kernel's accounts.
const TICK_S: f64 = 0.01;

/// Processor time that this process has used.
fn processor_s() -> Result<f64> {
    let stat = fs::read_to_string("/proc/self/stat")?;
    let fields = stat.rsplit_once(')').context("no name in /proc/self/stat")?.1;
    let ticks = fields.split_whitespace().skip(11).take(2).map(str::parse::<f64>);
    Ok(ticks.sum::<Result<f64, _>>()? * TICK_S)
}

/// Identifies a drive some times; prints the line and gives the point of the curve.
fn measure(curve: &str, duration_s: f64, d_model: usize) -> Result<f64> {
    let (_, sequence, vehicle) =
        drive(with_background(scenario("f1tenth", "club", 0.9, 0.9, 3)).duration(duration_s));
    let config = Config { d_model, ..Config::default() };
    let (mut least_s, mut turns) = (f64::INFINITY, 0);
    for _ in 0..REPEATS {
        let begin_s = processor_s()?;
        turns = identify(&sequence, &vehicle, None, None, &config, &mut |_| {})?.iterations;
        least_s = least_s.min(processor_s()? - begin_s);
    }
    println!("{curve},{duration_s},{d_model},{turns},{least_s:.2}");
    Ok(least_s)
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

fn draw(area: &Area<'_>, points: &[(f64, f64)], label: &str) -> Result<()> {
    let most = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).fold(0.0, f64::max);
    let mut chart = ChartBuilder::on(area)
        .margin(15)
        .x_label_area_size(40)
        .y_label_area_size(55)
        .build_cartesian_2d(0.0..1.05 * most(|p| p.0), 0.0..1.1 * most(|p| p.1))?;
    chart.configure_mesh().x_desc(label).y_desc("processor time [s]").draw()?;
    chart.draw_series(LineSeries::new(points.iter().copied(), BLUE.stroke_width(2)).point_size(3))?;
    Ok(())
}

fn main() -> Result<()> {
    let path = std::env::args().nth(1).context("usage: identification_cost PICTURE.svg")?;
    println!("curve,duration_s,d_model,turns,processor_s");
    let mut lengths = Vec::new();
    for duration_s in DURATIONS_S {
        lengths.push((duration_s, measure("duration", duration_s, Config::default().d_model)?));
    }
    let mut widths = Vec::new();
    for d_model in WIDTHS {
        widths.push((d_model as f64, measure("d_model", 30.0, d_model)?));
    }
    let area = SVGBackend::new(&path, (1000, 420)).into_drawing_area();
    area.fill(&WHITE)?;
    let (left, right) = area.split_horizontally(500);
    draw(&left, &lengths, "drive [s] (d_model 16)")?;
    draw(&right, &widths, "d_model (30 s)")?;
    area.present()?;
    Ok(())
}
