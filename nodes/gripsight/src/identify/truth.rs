//! True tire curves for the report, from the forces that a simulator recorded.

use std::path::Path;

use anyhow::Context;
use gripsight_identification::{Outcome, PerAxle};
use gripsight_signals::{NS_PER_S, StateSequence};
use gripsight_vehicle::VehicleParameters;

/// Samples by slip, in this many steps.
const BINS: usize = 40;
/// A step with fewer samples says nothing.
const FEWEST: usize = 5;
/// A force belongs to a sample this near.
const NEAR_S: f64 = 0.02;

/// One row of the truth.
struct Truth {
    time_s: f64,
    /// F_y/F_z of each axle.
    force: PerAxle<f64>,
}

/// The median of |F_y|/F_z over the absolute slip of the identification.
///
/// Forces are divided by the vertical loads where the file has them (`f_z_front_n`, `f_z_rear_n`), else by the static ones.
pub(super) fn curves(
    path: &Path,
    sequence: &StateSequence,
    vehicle: &VehicleParameters,
    result: &Outcome,
) -> anyhow::Result<PerAxle<Vec<(f64, f64)>>> {
    let rows =
        read(path, sequence, vehicle).with_context(|| format!("cannot use the truth {}", path.display()))?;
    let trace = &result.trace;
    let at = |time_s: f64| {
        let after = rows.partition_point(|r| r.time_s < time_s);
        let near = |r: &&Truth| (r.time_s - time_s).abs() <= NEAR_S;
        let distance = |r: &&Truth| (r.time_s - time_s).abs();
        rows[after.saturating_sub(1)..rows.len().min(after + 1)]
            .iter()
            .filter(near)
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
    };
    let axle = |slips: &[f64], force: fn(&PerAxle<f64>) -> f64| {
        let samples = trace.time_s.iter().zip(slips).filter_map(|(time_s, slip)| {
            let truth = at(*time_s)?;
            // The sign of the slip counts the force's: noise around zero does not turn into grip.
            Some((slip.abs(), force(&truth.force) * slip.signum()))
        });
        medians(samples.filter(|(s, f)| s.is_finite() && f.is_finite()).collect())
    };
    Ok(PerAxle {
        front: axle(&trace.slip_rad.front, |f| f.front),
        rear: axle(&trace.slip_rad.rear, |f| f.rear),
    })
}

fn read(path: &Path, sequence: &StateSequence, vehicle: &VehicleParameters) -> anyhow::Result<Vec<Truth>> {
    let mut reader = csv::Reader::from_path(path)?;
    let head = reader.headers()?.clone();
    let column = |name: &str| head.iter().position(|h| h == name);
    let needed = |name: &str| column(name).with_context(|| format!("no column {name}"));
    let (stamp, front, rear) = (needed("stamp_s")?, needed("f_y_front_n")?, needed("f_y_rear_n")?);
    let loads = column("f_z_front_n").zip(column("f_z_rear_n"));
    let start_s = sequence.start_stamp_ns as f64 / NS_PER_S;
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record?;
        let number =
            |k: usize| -> anyhow::Result<f64> { Ok(record.get(k).unwrap_or_default().trim().parse()?) };
        let (load_front, load_rear) = match loads {
            Some((f, r)) => (number(f)?, number(r)?),
            None => (vehicle.static_load_front_n(), vehicle.static_load_rear_n()),
        };
        let force = PerAxle { front: number(front)? / load_front, rear: number(rear)? / load_rear };
        rows.push(Truth { time_s: number(stamp)? - start_s, force });
    }
    rows.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    Ok(rows)
}

/// Medians by steps of slip, from the origin.
fn medians(samples: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let most = samples.iter().map(|s| s.0).fold(0.0, f64::max);
    if most <= 0.0 {
        return Vec::new();
    }
    let mut bins = vec![Vec::new(); BINS];
    for (slip_rad, force) in samples {
        bins[((slip_rad / most * BINS as f64) as usize).min(BINS - 1)].push(force);
    }
    let median = |(k, mut forces): (usize, Vec<f64>)| {
        forces.sort_by(f64::total_cmp);
        (forces.len() >= FEWEST).then(|| (most * (k as f64 + 0.5) / BINS as f64, forces[forces.len() / 2]))
    };
    std::iter::once((0.0, 0.0)).chain(bins.into_iter().enumerate().filter_map(median)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_follow_the_curve_and_ignore_outliers() {
        let mut samples: Vec<(f64, f64)> =
            (0..4000).map(|k| f64::from(k) * 1e-4).map(|s| (s, 2.0 * s)).collect();
        samples.extend([(0.2, 1e6), (0.3, -1e6)]);
        for (slip_rad, force) in medians(samples) {
            assert!((force - 2.0 * slip_rad).abs() < 0.01, "{slip_rad} {force}");
        }
        assert!(medians(Vec::new()).is_empty());
    }
}
