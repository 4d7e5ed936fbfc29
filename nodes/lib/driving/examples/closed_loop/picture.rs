//! A picture of a run: lap by lap where on the track how much of the grip was used, above the grip that was planned with.

use std::path::Path;

use anyhow::{Context, Result, anyhow};
use gripsight_driving::TireSet;
use gripsight_reference_car::CarParameters;
use plotters::prelude::*;

use crate::drive::Loop;
use crate::run::{Case, Variant};
use crate::{Arguments, plant};

/// Laps drawn.
const LAPS: usize = 5;
/// Looks from one point to the next.
const EVERY: usize = 5;
const SIZE: (u32, u32) = (1200, 470);
/// Height of the laps' row.
const ROW: u32 = 240;
const FONT: &str = "sans-serif";

/// A moment.
struct Point {
    lap: usize,
    /// Laps since the start.
    along: f64,
    x_m: f64,
    y_m: f64,
    used: f64,
    planned: f64,
}

/// Drives the first case asked for and draws it; says where.
pub(crate) fn experiment(arguments: &Arguments) -> Result<String> {
    let car = CarParameters::by_name(arguments.cars.first().context("no car")?)?;
    let mu = *arguments.frictions.first().context("no friction")?;
    let track = arguments.tracks.first().context("no track")?.clone();
    let tires = plant::projection(&car, mu)?;
    let case = Case {
        car,
        track,
        mu,
        seed: arguments.from_seed,
        laps: LAPS,
        tires,
        controller: arguments.controller,
    };
    let mut run = Loop::new(&case, TireSet::start(), arguments.verbose)?;
    run.learn(Variant::NoPrior.prior(mu, case.seed));
    let grip = tires.grip();
    let length_m = run.driver.track().length_m();
    let longest_s = 4.0 * LAPS as f64 * run.referee.fastest_lap_s();
    let (mut points, mut looks) = (Vec::new(), 0_usize);
    while run.referee.laps.len() < LAPS && run.sim.time_s() < longest_s {
        if let Some(wreck) = run.look()? {
            eprintln!("the run ended early: {wreck}");
            break;
        }
        looks += 1;
        if !looks.is_multiple_of(EVERY) {
            continue;
        }
        let Some(now) = run.sim.now() else { continue };
        let m = &now.motion;
        points.push(Point {
            lap: run.referee.laps.len(),
            along: run.referee.along_m() / length_m,
            x_m: m.x_m,
            y_m: m.y_m,
            used: m.specific_x_mps2.hypot(m.specific_y_mps2) / (grip * gripsight_vehicle::GRAVITY_MPS2),
            planned: run.driver.grip(),
        });
    }
    let times: Vec<f64> = run.referee.laps.iter().map(|lap| lap.time_s).collect();
    let path = arguments.out.join("laps.svg");
    draw(&path, &points, &times, grip).map_err(|error| anyhow!("{}: {error}", path.display()))?;
    Ok(format!("{}\n", path.display()))
}

/// Little used blue, all of it red.
fn colour(used: f64) -> RGBColor {
    const STOPS: [[f64; 3]; 4] =
        [[49.0, 54.0, 149.0], [116.0, 173.0, 209.0], [253.0, 174.0, 97.0], [200.0, 0.0, 38.0]];
    let place = used.clamp(0.0, 0.999) * (STOPS.len() - 1) as f64;
    let (k, share) = (place.floor() as usize, place.fract());
    let [r, g, b] = [0, 1, 2].map(|c| (STOPS[k][c] + share * (STOPS[k + 1][c] - STOPS[k][c])) as u8);
    RGBColor(r, g, b)
}

type Drawn = Result<(), Box<dyn std::error::Error>>;

fn draw(path: &Path, points: &[Point], times: &[f64], grip: f64) -> Drawn {
    let root = SVGBackend::new(path, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let (row, below) = root.split_vertically(ROW);
    let ends = |of: fn(&Point) -> f64| {
        points.iter().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
    };
    let (x, y) = (ends(|p| p.x_m), ends(|p| p.y_m));
    for (lap, area) in row.split_evenly((1, LAPS)).iter().enumerate() {
        let (width, height) = area.dim_in_pixel();
        let scale = (f64::from(width) - 24.0) / (x.1 - x.0);
        let scale = scale.min((f64::from(height) - 50.0) / (y.1 - y.0));
        let middle = (0.5 * (x.0 + x.1), 0.5 * (y.0 + y.1));
        let at = |p: &Point| {
            let px = 0.5 * f64::from(width) + scale * (p.x_m - middle.0);
            let py = 0.5 * f64::from(height) + 16.0 - scale * (p.y_m - middle.1);
            (px.round() as i32, py.round() as i32)
        };
        let title = match times.get(lap) {
            Some(time_s) => format!("lap {}: {time_s:.2} s", lap + 1),
            None => format!("lap {}", lap + 1),
        };
        area.draw(&Text::new(title, (12, 8), (FONT, 18).into_font()))?;
        for pair in points.windows(2).filter(|pair| pair[0].lap == lap && pair[1].lap == lap) {
            let line = vec![at(&pair[0]), at(&pair[1])];
            area.draw(&PathElement::new(line, colour(pair[1].used).stroke_width(5)))?;
        }
    }
    let (chart_area, legend) = below.split_horizontally(1050);
    let mut chart = ChartBuilder::on(&chart_area)
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(60)
        .build_cartesian_2d(0.0..LAPS as f64, 0.0..1.2 * grip)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .label_style((FONT, 15))
        .x_desc("laps driven")
        .y_desc("grip (acceleration / g)")
        .draw()?;
    chart.draw_series(LineSeries::new([(0.0, grip), (LAPS as f64, grip)], BLACK.stroke_width(2)))?;
    chart.draw_series(LineSeries::new(points.iter().map(|p| (p.along, p.planned)), RED.stroke_width(3)))?;
    let label = |text: &str, at: (f64, f64), colour: &RGBColor| {
        Text::new(text.to_owned(), at, (FONT, 16).into_font().color(colour))
    };
    chart.draw_series([label("what the road gives", (0.05, 1.12 * grip), &BLACK)])?;
    chart.draw_series([label("what the driver plans with", (0.55, 0.45 * grip), &RED)])?;
    legend.draw(&Text::new("share of the grip used", (0, 20), (FONT, 14).into_font()))?;
    for k in 0..=20 {
        let (used, top) = (1.0 - f64::from(k) / 20.0, 40 + 7 * k);
        legend.draw(&Rectangle::new([(10, top), (30, top + 7)], colour(used).filled()))?;
        if k % 10 == 0 {
            legend.draw(&Text::new(
                format!("{:.0} %", 100.0 * used),
                (36, top - 3),
                (FONT, 14).into_font(),
            ))?;
        }
    }
    root.present()?;
    Ok(())
}
