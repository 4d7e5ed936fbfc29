//! The pictures of a diagnosis.

use gripsight_diagnosis::{Diagnosis, Place, Prediction};
use maud::{Markup, html};

use crate::chart::heat as heat_color;
use crate::text::significant;
use crate::{Axis, Chart, Layer, Role};

/// The diagnosis sorts errors into so many cells from 0 to the largest value on either axis; the last is never empty.
const GRID: f64 = 8.0;

/// Force over slip without and with the effects, front and rear.
pub(super) fn tire_curves(d: &Diagnosis) -> [Chart; 2] {
    let axle = |title: &str, k: usize| {
        let points = &d.series.tire_curves[k];
        let driven_deg = d.series.slip_driven_rad[k].to_degrees();
        let end_deg = points.last().map_or(1.0, |p| p[0].to_degrees());
        let line = |role: Role, name: &str, column: usize| Layer::Line {
            role,
            name: name.into(),
            points: points.iter().map(|p| (p[0].to_degrees(), p[column])).collect(),
        };
        let chart = Chart::new(title, Axis::new("slip angle / °").with_range(0.0, end_deg), force_axis())
            .sized(460, 230)
            .with(Layer::Unvisited { name: "slip not driven".into(), from: driven_deg, to: end_deg })
            .with(line(Role::Nominal, "fitted without effects", 1));
        if super::names_effects(d) {
            chart.with(line(Role::Identified, "with the effects named", 2))
        } else {
            chart
        }
    };
    [axle("front tires", 0), axle("rear tires", 1)]
}

/// What the fitted model holds.
fn fitted(d: &Diagnosis) -> &'static str {
    if super::names_effects(d) { "tires and effects fitted" } else { "tires fitted" }
}

fn force_axis() -> Axis {
    Axis::new("lateral force / load").from_zero()
}

/// Lateral velocity and yaw rate over the worst seconds.
pub(super) fn worst_seconds(d: &Diagnosis) -> [Chart; 2] {
    let picture = |title: &str, unit: &str, of: fn(&Prediction) -> [f64; 3]| {
        let line = |role: Role, name: &str, which: usize| Layer::Line {
            role,
            name: name.into(),
            points: d.series.worst.iter().map(|p| (p.time_s, of(p)[which])).collect(),
        };
        Chart::new(title, Axis::new("time / s"), Axis::new(unit))
            .sized(460, 220)
            .with(line(Role::Nominal, "model as it came", 1))
            .with(line(Role::Measured, "measured", 0))
            .with(line(Role::Identified, fitted(d), 2))
    };
    [
        picture("lateral velocity", "v_y / (m/s)", |p| p.v_y_mps),
        picture("yaw rate", "yaw rate / (rad/s)", |p| p.yaw_rate_radps),
    ]
}

/// Error over speed and lateral acceleration, and its scale.
pub(super) fn heat(d: &Diagnosis) -> (Chart, Markup) {
    let cells = &d.series.heat;
    let half = |k: usize| cells.iter().map(|c| c[k]).fold(0.0, f64::max) / (GRID - 0.5) / 2.0;
    let (half_v, half_a) = (half(0), half(1));
    let finite = || cells.iter().map(|c| c[2]).filter(|c| c.is_finite());
    let least = finite().fold(f64::INFINITY, f64::min).clamp(1.0, f64::MAX);
    let most = finite().fold(2.0 * least, f64::max);
    // By the logarithm: a regime ten times as bad must not hide one three times as bad. The lowest colour is not quite white.
    let share = |chi2: f64| 0.08 + 0.92 * ((chi2.max(least) / least).ln() / (most / least).ln()).min(1.0);
    let cells = cells
        .iter()
        .map(|c| (c[0] - half_v, c[0] + half_v, c[1] - half_a, c[1] + half_a, share(c[2])))
        .collect();
    let chart = Chart::new(
        "error over speed and lateral acceleration",
        Axis::new("speed / (m/s)").from_zero(),
        Axis::new("|lateral acceleration| / (m/s²)").from_zero(),
    )
    .sized(460, 230)
    .with(Layer::Cells { cells });
    let stops: Vec<String> = (0..=4)
        .map(|k| heat_color(0.08 + 0.92 * f64::from(k) / 4.0))
        .map(|c| format!("#{:02x}{:02x}{:02x}", c.0, c.1, c.2))
        .collect();
    let gradient = format!("background:linear-gradient(to right,{})", stops.join(","));
    let scale = html! {
        figcaption {
            (significant(least, 2)) span.scale style=(gradient) {} (significant(most, 2))
            " times the variance of the noise; white: not driven"
        }
    };
    (chart, scale)
}

/// Whether there are laps to place errors on.
pub(super) fn along_title(d: &Diagnosis) -> &'static str {
    if d.places.track_position.is_empty() { "Error over time" } else { "Error along the lap" }
}

/// Error along the lap, or over time without laps.
pub(super) fn along(d: &Diagnosis) -> Chart {
    let (places, axis) = if d.places.track_position.is_empty() {
        (&d.places.time, "time / s")
    } else {
        (&d.places.track_position, "distance along the lap / m")
    };
    let mut bins: Vec<&Place> = places.iter().filter(|p| p.channel == "all").collect();
    bins.sort_by(|a, b| a.low.total_cmp(&b.low));
    let steps = bins.iter().flat_map(|p| [(p.low, p.chi2_per_dof), (p.high, p.chi2_per_dof)]).collect();
    Chart::new("error along the drive", Axis::new(axis), Axis::new("squared error / noise").from_zero())
        .sized(460, 230)
        .with(Layer::Line { role: Role::Nominal, name: "model as it came".into(), points: steps })
        .with(Layer::Level { role: Role::Measured, name: "noise".into(), y: 1.0 })
}

/// Error of rollouts over their length.
pub(super) fn horizon(d: &Diagnosis) -> Chart {
    let line = |role: Role, name: &str, column: usize| Layer::Line {
        role,
        name: name.into(),
        points: d.series.horizon.iter().map(|p| (p[0], p[column].sqrt())).collect(),
    };
    Chart::new(
        "error over horizon",
        Axis::new("length of the rollouts / s").from_zero(),
        Axis::new("root mean square error / noise").from_zero(),
    )
    .sized(460, 230)
    .with(line(Role::Nominal, "model as it came", 1))
    .with(line(Role::Identified, fitted(d), 3))
    .with(Layer::Level { role: Role::Measured, name: "noise".into(), y: 1.0 })
}

/// The g-g diagram of the drive.
pub(super) fn accelerations(d: &Diagnosis) -> Chart {
    let points = d.series.g_g.iter().map(|p| (p[1], p[0])).collect();
    Chart::new(
        "lateral and forward acceleration",
        Axis::new("lateral, left positive / (m/s²)"),
        Axis::new("forward / (m/s²)"),
    )
    .sized(460, 230)
    .with(Layer::Cloud { role: Role::Measured, name: "driven".into(), points })
}
