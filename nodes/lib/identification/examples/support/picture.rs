//! One picture for all tables of methods: a line a method, a dot a drive.

use std::path::Path;

use anyhow::{Context, Result};
use plotters::prelude::*;

/// A method's RMSE of F_y/F_z, front and rear, drive by drive.
pub(crate) struct Line {
    pub(crate) name: String,
    pub(crate) rmse: Vec<[f64; 2]>,
}

/// Adds a drive to the line of a name, which is made where there is none.
pub(crate) fn add(lines: &mut Vec<Line>, name: String, rmse: [f64; 2]) {
    match lines.iter_mut().find(|line| line.name == name) {
        Some(line) => line.rmse.push(rmse),
        None => lines.push(Line { name, rmse: vec![rmse] }),
    }
}

const HEIGHT: u32 = 26;
const MARGIN: u32 = 96;
/// Ends of the axis of errors.
const RANGE: (f64, f64) = (0.008, 0.5);

/// Draws the lines from top to bottom, errors to the right (logarithmic); `floor`: the best that four parameters can do.
pub(crate) fn draw(title: &str, lines: &[Line], floor: [f64; 2], path: &Path) -> Result<()> {
    let count = lines.len() as f64;
    let root = SVGBackend::new(path, (900, HEIGHT * lines.len() as u32 + MARGIN)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(12)
        .caption(title, ("sans-serif", 17))
        .x_label_area_size(36)
        .y_label_area_size(210)
        .build_cartesian_2d((RANGE.0..RANGE.1).log_scale(), 0.0..count)?;
    chart
        .configure_mesh()
        .disable_y_mesh()
        .disable_y_axis()
        .x_label_formatter(&|x| format!("{x:.2}"))
        .x_desc("RMSE of F_y/F_z; blue front, orange rear; dashes: floor; one dot a drive")
        .draw()?;
    let colors = [RGBColor(31, 90, 180), RGBColor(214, 110, 20)];
    for (axle, color) in colors.iter().enumerate() {
        let dashes = (0..4 * lines.len()).step_by(2).map(|k| {
            let at = |k: usize| (floor[axle], k as f64 * count / (4 * lines.len()) as f64);
            PathElement::new(vec![at(k), at(k + 1)], color.mix(0.6))
        });
        chart.draw_series(dashes)?;
        for (k, line) in lines.iter().enumerate() {
            let y = count - k as f64 - 0.35 - 0.3 * axle as f64;
            chart.draw_series(
                line.rmse
                    .iter()
                    .map(|e| Circle::new((e[axle].clamp(RANGE.0, RANGE.1), y), 3, color.mix(0.7).filled())),
            )?;
        }
    }
    for (k, line) in lines.iter().enumerate() {
        let (_, y) = chart.backend_coord(&(RANGE.0, count - k as f64 - 0.5));
        root.draw(&Text::new(line.name.clone(), (14, y - 7), ("sans-serif", 14)))?;
    }
    root.present().context("picture")
}
