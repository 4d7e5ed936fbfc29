//! Drawing of the layers.

use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use super::axis::tick;
use super::geometry::Frame;
use super::{Chart, DENSITY, HATCH, INK, Layer, SCALE, heat};
use crate::Role;

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;
type Context<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
type Outcome = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// Room for the numbers and names of the axes, and around the frame, in units of the page.
const BELOW: f64 = 40.0;
const LEFT: f64 = 54.0;
const AROUND: f64 = 8.0;
const TEXT: f64 = 14.0;
const LINE: f64 = 1.6;
/// Share of the frame's height that the strip of visits takes at most.
const STRIP: f64 = 0.13;

fn units(length: f64) -> u32 {
    (length * SCALE) as u32
}

pub(super) fn draw<'b>(chart: &Chart, area: &Area<'b>) -> Outcome {
    let frame = frame(chart);
    let mut context = ChartBuilder::on(area)
        .margin(units(AROUND))
        .x_label_area_size(units(BELOW))
        .y_label_area_size(units(LEFT))
        .build_cartesian_2d(frame.x.0..frame.x.1, frame.y.0..frame.y.1)?;
    let behind = |layer: &&Layer| {
        matches!(layer, Layer::Cells { .. } | Layer::Unvisited { .. } | Layer::Density { .. })
    };
    for layer in chart.layers.iter().filter(behind) {
        draw_layer(&mut context, &frame, layer)?;
    }
    let (x_span, y_span) = (frame.x.1 - frame.x.0, frame.y.1 - frame.y.0);
    let text = ("sans-serif", TEXT * SCALE).into_font().color(&INK);
    context
        .configure_mesh()
        .x_desc(&chart.x.label)
        .y_desc(&chart.y.label)
        .x_labels((chart.width / 60) as usize)
        .y_labels((chart.height / 40) as usize)
        .max_light_lines(0)
        .bold_line_style(BLACK.mix(0.09).stroke_width(units(0.7)))
        .axis_style(INK.stroke_width(units(0.8)))
        .x_label_formatter(&|v| tick(*v, x_span))
        .y_label_formatter(&|v| tick(*v, y_span))
        .label_style(text.clone())
        .axis_desc_style(text)
        .set_all_tick_mark_size(units(3.0))
        .draw()?;
    for layer in chart.layers.iter().filter(|layer| !behind(layer)) {
        draw_layer(&mut context, &frame, layer)?;
    }
    Ok(())
}

/// Ends of both axes; where scales are equal, the shorter axis is widened about its middle.
fn frame(chart: &Chart) -> Frame {
    let points: Vec<(f64, f64)> = chart.layers.iter().flat_map(extent).collect();
    let x = chart.x.ends(points.iter().map(|p| p.0));
    let y = chart.y.ends(points.iter().map(|p| p.1));
    if !chart.equal_scales {
        return Frame { x, y };
    }
    let width = f64::from(chart.width) - LEFT - 2.0 * AROUND;
    let height = f64::from(chart.height) - BELOW - 2.0 * AROUND;
    let per_unit = ((x.1 - x.0) / width).max((y.1 - y.0) / height);
    let widened = |(low, high): (f64, f64), room: f64| {
        let (middle, half) = ((low + high) / 2.0, per_unit * room / 2.0);
        (middle - half, middle + half)
    };
    Frame { x: widened(x, width), y: widened(y, height) }
}

/// Points that a layer wants to be seen; NaN where it does not care.
fn extent(layer: &Layer) -> Vec<(f64, f64)> {
    match layer {
        Layer::Line { points, .. } | Layer::Cloud { points, .. } => points.clone(),
        Layer::Band { points, .. } => points.iter().flat_map(|&(x, a, b)| [(x, a), (x, b)]).collect(),
        Layer::ErrorBars { points, .. } => points.iter().flat_map(|&(x, _, a, b)| [(x, a), (x, b)]).collect(),
        Layer::Density { bins, .. } => bins.iter().flat_map(|b| [(b.0, f64::NAN), (b.1, f64::NAN)]).collect(),
        Layer::Unvisited { .. } => Vec::new(),
        Layer::Cells { cells } => cells.iter().flat_map(|c| [(c.0, c.2), (c.1, c.3)]).collect(),
        Layer::Level { y, .. } => vec![(f64::NAN, *y)],
    }
}

fn draw_layer(context: &mut Context<'_, '_>, frame: &Frame, layer: &Layer) -> Outcome {
    match layer {
        Layer::Line { role, points, .. } => line(context, frame, *role, points, LINE),
        Layer::Level { role, y, .. } => line(context, frame, *role, &[(frame.x.0, *y), (frame.x.1, *y)], 1.0),
        Layer::Band { role, points, .. } => band(context, frame, *role, points),
        Layer::Cloud { role, points, .. } => cloud(context, frame, *role, points),
        Layer::ErrorBars { role, points, .. } => error_bars(context, frame, *role, points),
        Layer::Density { bins, .. } => strip(context, frame, bins),
        Layer::Unvisited { from, to, .. } => hatch(context, frame, *from, *to),
        Layer::Cells { cells } => {
            for &(x0, x1, y0, y1, share) in cells {
                let corners =
                    [(frame.clamp_x(x0), frame.clamp_y(y0)), (frame.clamp_x(x1), frame.clamp_y(y1))];
                context.plotting_area().draw(&Rectangle::new(corners, heat(share).filled()))?;
            }
            Ok(())
        }
    }
}

fn line(
    context: &mut Context<'_, '_>,
    frame: &Frame,
    role: Role,
    points: &[(f64, f64)],
    width: f64,
) -> Outcome {
    let style = role.color().stroke_width(units(width));
    for piece in frame.pieces(points) {
        if role.is_dashed() {
            context.draw_series(DashedLineSeries::new(piece, units(5.0), units(3.5), style))?;
        } else {
            context.plotting_area().draw(&PathElement::new(piece, style))?;
        }
    }
    Ok(())
}

fn band(context: &mut Context<'_, '_>, frame: &Frame, role: Role, points: &[(f64, f64, f64)]) -> Outcome {
    let finite = |p: &&(f64, f64, f64)| p.0.is_finite() && p.1.is_finite() && p.2.is_finite();
    let seen: Vec<_> =
        points.iter().filter(finite).filter(|p| (frame.x.0..=frame.x.1).contains(&p.0)).collect();
    let low = seen.iter().map(|p| (p.0, frame.clamp_y(p.1)));
    let high = seen.iter().rev().map(|p| (p.0, frame.clamp_y(p.2)));
    let outline: Vec<(f64, f64)> = low.chain(high).collect();
    if outline.len() > 2 {
        context.plotting_area().draw(&Polygon::new(outline, role.color().mix(0.18)))?;
    }
    Ok(())
}

/// Samples as a grid of cells about 2 units wide, darker where more of them lie.
fn cloud(context: &mut Context<'_, '_>, frame: &Frame, role: Role, points: &[(f64, f64)]) -> Outcome {
    const COLUMNS: usize = 160;
    const ROWS: usize = 100;
    let cell = |(low, high): (f64, f64), v: f64, n: usize| {
        (((v - low) / (high - low) * n as f64) as usize).min(n - 1)
    };
    let mut counts = vec![0_u32; COLUMNS * ROWS];
    for &(x, y) in points.iter().filter(|p| frame.holds(**p)) {
        counts[cell(frame.y, y, ROWS) * COLUMNS + cell(frame.x, x, COLUMNS)] += 1;
    }
    let most = f64::from(counts.iter().copied().max().unwrap_or(0)).max(1.0);
    let edge = |(low, high): (f64, f64), k: usize, n: usize| low + (high - low) * k as f64 / n as f64;
    for (place, &count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
        let (row, column) = (place / COLUMNS, place % COLUMNS);
        let share = 0.25 + 0.6 * (1.0 + f64::from(count)).ln() / (1.0 + most).ln();
        let corners = [
            (edge(frame.x, column, COLUMNS), edge(frame.y, row, ROWS)),
            (edge(frame.x, column + 1, COLUMNS), edge(frame.y, row + 1, ROWS)),
        ];
        context.plotting_area().draw(&Rectangle::new(corners, role.color().mix(share).filled()))?;
    }
    Ok(())
}

fn error_bars(
    context: &mut Context<'_, '_>,
    frame: &Frame,
    role: Role,
    points: &[(f64, f64, f64, f64)],
) -> Outcome {
    let style = role.color().stroke_width(units(1.2));
    for &(x, value, low, high) in points.iter().filter(|p| frame.holds((p.0, p.1))) {
        if low.is_finite() && high.is_finite() {
            let ends = vec![(x, frame.clamp_y(low)), (x, frame.clamp_y(high))];
            context.plotting_area().draw(&PathElement::new(ends, style))?;
        }
        context.plotting_area().draw(&Circle::new((x, value), units(2.4), role.color().filled()))?;
    }
    Ok(())
}

fn strip(context: &mut Context<'_, '_>, frame: &Frame, bins: &[(f64, f64, f64)]) -> Outcome {
    let most = bins.iter().map(|b| b.2).filter(|c| c.is_finite()).fold(0.0, f64::max);
    if most <= 0.0 {
        return Ok(());
    }
    let height = STRIP * (frame.y.1 - frame.y.0);
    // One outline instead of a box for each: no gaps where boxes meet. The root shows rare visits too.
    let top = |count: f64| frame.y.0 + height * (count.max(0.0) / most).sqrt();
    let steps = bins.iter().flat_map(|&(from, to, count)| [(from, top(count)), (to, top(count))]);
    let mut outline: Vec<(f64, f64)> = steps.map(|(x, y)| (frame.clamp_x(x), y)).collect();
    if let (Some(first), Some(last)) = (outline.first().copied(), outline.last().copied()) {
        outline.extend([(last.0, frame.y.0), (first.0, frame.y.0)]);
        context.plotting_area().draw(&Polygon::new(outline, DENSITY))?;
    }
    Ok(())
}

/// Slanted lines over a range of x, over the whole height.
fn hatch(context: &mut Context<'_, '_>, frame: &Frame, from: f64, to: f64) -> Outcome {
    let (from, to) = (frame.clamp_x(from), frame.clamp_x(to));
    if from.is_nan() || to.is_nan() || from >= to {
        return Ok(());
    }
    let area = context.plotting_area();
    let (left, top) = context.backend_coord(&(from, frame.y.1));
    let (right, bottom) = context.backend_coord(&(to, frame.y.0));
    let pixels = Frame { x: (left.into(), right.into()), y: (top.into(), bottom.into()) };
    let data = |(x, y): (f64, f64)| {
        let share = |v: f64, (a, b): (f64, f64)| (v - a) / (b - a).max(1.0);
        (from + (to - from) * share(x, pixels.x), frame.y.1 + (frame.y.0 - frame.y.1) * share(y, pixels.y))
    };
    let height = pixels.y.1 - pixels.y.0;
    let step = 7.0 * SCALE;
    let mut start = pixels.x.0 - height;
    while start < pixels.x.1 {
        if let Some(ends) = pixels.cut((start, pixels.y.1), (start + height, pixels.y.0)) {
            area.draw(&PathElement::new(ends.map(data).to_vec(), HATCH.stroke_width(units(0.8))))?;
        }
        start += step;
    }
    Ok(())
}
