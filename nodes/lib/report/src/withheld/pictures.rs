//! Pictures of a score.

use gripsight_withheld_score::{Rate, SEVERITY_BANDS, Scores};

use crate::{Axis, Chart, Layer, Role};

pub(super) const SEVERITY_REMARK: &str = "Severity: size over the detection limit of the generator's own fit. Bands: below 1, 1 to 2, 2 to 5, above. 95 % intervals.";

/// A rate as a point with its interval, in percent.
fn point(x: f64, rate: &Rate) -> (f64, f64, f64, f64) {
    (x, 100.0 * rate.value(), 100.0 * rate.low, 100.0 * rate.high)
}

pub(super) fn severity(scores: &Scores) -> Chart {
    let points = (0..SEVERITY_BANDS.len() - 1)
        .map(|band| {
            let own = scores.effects.iter().filter_map(|e| e.by_severity.get(band));
            let (hits, of) = own.fold((0, 0), |(hits, of), rate| (hits + rate.hits, of + rate.of));
            point(band as f64 + 1.0, &Rate::new(hits, of))
        })
        .filter(|p| p.1.is_finite())
        .collect();
    Chart::new(
        "Share named over severity",
        Axis::new("band of severity").with_range(0.5, 4.5),
        percent("named / %"),
    )
    .with(Layer::ErrorBars { role: Role::Identified, name: String::new(), points })
}

fn percent(label: &str) -> Axis {
    Axis::new(label).with_range(0.0, 100.0)
}

pub(super) fn confidence(scores: &Scores) -> Chart {
    let mut chart = Chart::new("Right over stated confidence", percent("stated / %"), percent("right / %"))
        .with(Layer::Line {
            role: Role::Truth,
            name: "as stated".into(),
            points: vec![(0.0, 0.0), (100.0, 100.0)],
        });
    let roles = [Role::Identified, Role::Prior, Role::Nominal];
    for (family, role) in scores.families.iter().zip(roles) {
        let points = family.calibration.bins.iter().map(|b| point(100.0 * b.stated, &b.right)).collect();
        chart = chart.with(Layer::ErrorBars { role, name: family.family.name().to_owned(), points });
    }
    chart
}

pub(super) fn sizes(scores: &Scores) -> Chart {
    let mut checks: Vec<_> = scores.sizes.iter().collect();
    checks.sort_by(|a, b| a.effect.cmp(&b.effect));
    let points =
        checks.iter().enumerate().map(|(k, s)| (k as f64, (s.value / s.truth).clamp(-1.0, 3.0))).collect();
    Chart::new(
        "Stated size over true size",
        Axis::new("case"),
        Axis::new("stated / true").with_range(-1.0, 3.0),
    )
    .with(Layer::Level { role: Role::Truth, name: "true".into(), y: 1.0 })
    .with(Layer::Cloud { role: Role::Identified, name: "stated".into(), points })
}

pub(super) fn shrinkage(scores: &Scores) -> Chart {
    let share = |v: f64| (100.0 * v).clamp(-50.0, 100.0);
    let points = scores.shrinkage.iter().map(|[oracle, blind]| (share(*oracle), share(*blind))).collect();
    let axis = |label: &str| Axis::new(label).with_range(-50.0, 100.0);
    Chart::new("Shrinkage, blind over oracle", axis("oracle / %"), axis("blind / %"))
        .with(Layer::Line {
            role: Role::Truth,
            name: "equal".into(),
            points: vec![(-50.0, -50.0), (100.0, 100.0)],
        })
        .with(Layer::Cloud { role: Role::Identified, name: "case".into(), points })
}
