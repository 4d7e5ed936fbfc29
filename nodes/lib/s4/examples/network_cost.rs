//! Prints as CSV what training and streaming cost over sequence length, width and states, and draws the epochs.
//!
//!     cargo run --release -p gripsight_s4 --example network_cost -- cost.svg > cost.csv
//!
//! Times are the smallest of many on one core: what a shared machine adds is left out.

use anyhow::{Context, Result};
use gripsight_s4::{
    Architecture, Error, NetworkConfig, Normalization, ResidualNetwork, Sequence, TrainingConfig,
    TrainingSet, train,
};
use plotters::prelude::*;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

const EPOCHS: usize = 60;
const STEPS: u32 = 1000;
const ARCHITECTURES: [(Architecture, RGBColor); 3] =
    [(Architecture::S4, BLUE), (Architecture::Mlp, RED), (Architecture::Rnn, BLACK)];

/// Two sequences of `length` samples of sines.
fn training_set(length: usize) -> Result<TrainingSet, Error> {
    let wave = |count: usize, frequency: f64| (0..count).map(|k| (frequency * k as f64).sin()).collect();
    let sequence = |frequency: f64| Sequence {
        inputs: wave(4 * length, frequency),
        targets: wave(2 * length, 1.7 * frequency),
        weights: vec![1.0; length],
    };
    TrainingSet::new(4, 2, &[sequence(0.11), sequence(0.17)])
}

/// Smallest time of an epoch: forward, backward and update, without validation.
fn epoch(network: &ResidualNetwork, set: &TrainingSet) -> Result<Duration, Error> {
    let settings = TrainingConfig { epochs_max: EPOCHS, patience: EPOCHS, ..TrainingConfig::default() };
    let mut smallest = Duration::MAX;
    let mut last = Instant::now();
    train(network, set, None, &settings, &mut |_| {
        smallest = smallest.min(last.elapsed());
        last = Instant::now();
        ControlFlow::Continue(())
    })?;
    Ok(smallest)
}

/// Mean time of a streaming step, the smallest of many means.
fn step(network: &ResidualNetwork) -> Result<Duration, Error> {
    let mut state = network.stream_state();
    let mut output = [0.0; 2];
    let mut smallest = Duration::MAX;
    for _ in 0..20 {
        let start = Instant::now();
        for k in 0..STEPS {
            network.step(&mut state, &[3.0, 0.1, 0.5, 0.01 * f64::from(k % 7)], &mut output)?;
        }
        smallest = smallest.min(start.elapsed() / STEPS);
    }
    Ok(smallest)
}

/// One measured network.
struct Row {
    curve: &'static str,
    samples: usize,
    config: NetworkConfig,
    epoch_ms: f64,
}

/// Measures a network on two sequences of `length` samples and prints its line.
fn measure(curve: &'static str, length: usize, config: NetworkConfig) -> Result<Row, Error> {
    let set = training_set(length)?;
    let network = ResidualNetwork::new(config, Normalization::fit(&set), 0)?;
    let epoch_ms = epoch(&network, &set)?.as_secs_f64() * 1e3;
    let step_us = step(&network)?.as_secs_f64() * 1e6;
    let config = network.config().clone();
    let NetworkConfig { architecture, d_model, d_state, layers, .. } = config;
    let (samples, weights) = (set.total_length(), network.weights().len());
    println!(
        "{curve},{architecture:?},{samples},{d_model},{d_state},{layers},{weights},{epoch_ms:.3},{step_us:.3}"
    );
    Ok(Row { curve, samples, config, epoch_ms })
}

/// Draws epoch time over `position`, doubly logarithmic, one line per architecture.
fn draw<'a>(
    area: &DrawingArea<SVGBackend<'a>, plotters::coord::Shift>,
    rows: &[&Row],
    label: &str,
    position: impl Fn(&Row) -> f64,
) -> Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>> {
    let range = |values: &mut dyn Iterator<Item = f64>| {
        values.fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(value), high.max(value)))
    };
    let (left, right) = range(&mut rows.iter().map(|row| position(row)));
    let (low, high) = range(&mut rows.iter().map(|row| row.epoch_ms));
    let mut chart = ChartBuilder::on(area)
        .margin(15)
        .x_label_area_size(40)
        .y_label_area_size(55)
        .build_cartesian_2d((left..right).log_scale(), (low / 1.3..high * 1.3).log_scale())?;
    chart
        .configure_mesh()
        .x_labels(4)
        .x_label_formatter(&|value| format!("{value:.0}"))
        .x_desc(label)
        .y_desc("epoch [ms]")
        .draw()?;
    for (architecture, colour) in ARCHITECTURES {
        let line = rows.iter().filter(|row| row.config.architecture == architecture);
        chart
            .draw_series(LineSeries::new(
                line.map(|row| (position(row), row.epoch_ms)),
                colour.stroke_width(2),
            ))?
            .label(format!("{architecture:?}"))
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], colour));
    }
    chart.configure_series_labels().position(SeriesLabelPosition::UpperLeft).border_style(BLACK).draw()
}

fn main() -> Result<()> {
    let path = std::env::args().nth(1).context("usage: network_cost PICTURE.svg")?;
    println!("curve,architecture,samples,d_model,d_state,layers,weights,epoch_ms,step_us");
    let mut rows = Vec::new();
    for (architecture, _) in ARCHITECTURES {
        let base = NetworkConfig { architecture, ..NetworkConfig::default() };
        for length in [250, 500, 1000, 1500, 2000, 4000, 8000] {
            rows.push(measure("length", length, base.clone())?);
        }
        for d_model in [4, 8, 16, 32, 64] {
            rows.push(measure("d_model", 1500, NetworkConfig { d_model, ..base.clone() })?);
        }
    }
    for d_state in [4, 8, 16, 32, 64] {
        rows.push(measure("d_state", 1500, NetworkConfig { d_state, ..NetworkConfig::default() })?);
    }
    let area = SVGBackend::new(&path, (1000, 420)).into_drawing_area();
    area.fill(&WHITE)?;
    let (left, right) = area.split_horizontally(500);
    let of = |curve: &str| -> Vec<&Row> { rows.iter().filter(|row| row.curve == curve).collect() };
    draw(&left, &of("length"), "samples (d_model 16)", |row| row.samples as f64)?;
    draw(&right, &of("d_model"), "d_model (3000 samples)", |row| row.config.d_model as f64)?;
    area.present()?;
    Ok(())
}
