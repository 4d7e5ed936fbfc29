//! The pictures of an identification.

use gripsight_identification::{Change, HorizonError, Outcome, Range, TireCurve, Trace};
use gripsight_vehicle::MagicFormula;

use super::IdentificationInput;
use crate::{Axis, Chart, Layer, Role};

/// Length of the closest look.
pub(super) const WORST_S: f64 = 5.0;
/// Slip axes show this many times the slip that was visited.
const BEYOND: f64 = 2.0;
/// Points along the drive at which errors are averaged.
const BINS: usize = 150;

/// Force over slip, front and rear.
pub(super) fn tire_curves(input: &IdentificationInput<'_>) -> [Chart; 2] {
    let o = input.outcome;
    let truth = input.truth;
    [
        tire_curve(
            o,
            "front tires",
            &o.curves.front,
            &o.slip_range_rad.front,
            &o.phi_p.front,
            truth.map(|t| t.front.as_slice()),
        ),
        tire_curve(
            o,
            "rear tires",
            &o.curves.rear,
            &o.slip_range_rad.rear,
            &o.phi_p.rear,
            truth.map(|t| t.rear.as_slice()),
        ),
    ]
}

fn tire_curve(
    outcome: &Outcome,
    title: &str,
    curve: &TireCurve,
    range: &Range,
    set: &MagicFormula,
    truth: Option<&[(f64, f64)]>,
) -> Chart {
    let last_deg = curve.slip_rad.last().map_or(1.0, |s| s.to_degrees());
    let visited_deg = range.low.abs().max(range.high.abs()).to_degrees();
    let end_deg = if visited_deg > 0.0 { (BEYOND * visited_deg).min(last_deg) } else { last_deg };
    let over = |values: &[f64]| -> Vec<(f64, f64)> {
        curve.slip_rad.iter().map(|s| s.to_degrees()).zip(values.iter().copied()).collect()
    };
    let band = curve
        .slip_rad
        .iter()
        .zip(curve.low.iter().zip(&curve.high))
        .map(|(s, (l, h))| (s.to_degrees(), *l, *h))
        .collect();
    let bins = curve
        .slip_rad
        .windows(2)
        .zip(&curve.density)
        .map(|(w, n)| (w[0].to_degrees(), w[1].to_degrees(), f64::from(*n) / (w[1] - w[0])))
        .collect();
    let in_view =
        |values: &[f64]| over(values).into_iter().filter(|p| p.0 <= end_deg).map(|p| p.1).fold(0.0, f64::max);
    let top =
        in_view(&curve.identified).max(in_view(&curve.initial)).max(outcome.prior.map_or(0.0, |p| p.mu));
    let top = truth
        .unwrap_or_default()
        .iter()
        .filter(|p| p.0.to_degrees() <= end_deg)
        .map(|p| p.1)
        .fold(top, f64::max);
    let promised: Vec<f64> = curve.slip_rad.iter().map(|&slip| set.normalized_force(slip)).collect();
    let mut chart = Chart::new(
        title,
        Axis::new("slip angle / °").with_range(0.0, end_deg),
        Axis::new("lateral force / load").with_range(0.0, 1.15 * top.max(0.05)),
    )
    .with(Layer::Unvisited { name: "slip not driven".into(), from: visited_deg, to: end_deg })
    .with(Layer::Density { name: "samples".into(), bins })
    .with(Layer::Band { role: Role::Identified, name: "90 %".into(), points: band });
    if let Some(prior) = outcome.prior {
        chart = chart.with(Layer::Level { role: Role::Prior, name: "prior".into(), y: prior.mu });
    }
    chart = chart
        .with(Layer::Line { role: Role::Nominal, name: "start".into(), points: over(&curve.initial) })
        .with(Layer::Line {
            role: Role::Identified,
            name: if outcome.accepted { "to use" } else { "identified" }.into(),
            points: over(&if outcome.accepted { promised } else { curve.identified.clone() }),
        });
    if let Some(truth) = truth {
        let points = truth.iter().map(|&(s, f)| (s.to_degrees(), f)).collect();
        chart = chart.with(Layer::Line { role: Role::Truth, name: "truth".into(), points });
    }
    chart
}

/// Lateral velocity and yaw rate over the worst seconds.
pub(super) fn worst_seconds(outcome: &Outcome) -> [Chart; 2] {
    let t = &outcome.trace;
    let (from_s, to_s) = worst(t, outcome.rmse.noise);
    let picture = |title: &str, unit: &str, measured: &[f64], before: &[f64], after: &[f64]| {
        let line = |role: Role, name: &str, values: &[f64]| Layer::Line {
            role,
            name: name.into(),
            points: within(t, values, from_s, to_s),
        };
        Chart::new(title, Axis::new("time / s").with_range(from_s, to_s), Axis::new(unit))
            .sized(460, 230)
            .with(line(Role::Nominal, "model before", before))
            .with(line(Role::Measured, "measured", measured))
            .with(line(Role::Identified, "model with the tires found", after))
    };
    [
        picture("lateral velocity", "v_y / (m/s)", &t.v_y_mps, &t.v_y_before_mps, &t.v_y_after_mps),
        picture(
            "yaw rate",
            "yaw rate / (rad/s)",
            &t.yaw_rate_radps,
            &t.yaw_rate_before_radps,
            &t.yaw_rate_after_radps,
        ),
    ]
}

/// Points of a series between two times, interrupted where samples are missing.
fn within(trace: &Trace, values: &[f64], from_s: f64, to_s: f64) -> Vec<(f64, f64)> {
    let mut steps: Vec<f64> = trace.time_s.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    let pause_s = 2.5 * steps.get(steps.len() / 2).copied().unwrap_or(f64::INFINITY);
    let mut points: Vec<(f64, f64)> = Vec::new();
    for (&time_s, &value) in trace.time_s.iter().zip(values).filter(|(t, _)| (from_s..=to_s).contains(*t)) {
        if points.last().is_some_and(|last| time_s - last.0 > pause_s) {
            points.push((f64::NAN, f64::NAN));
        }
        points.push((time_s, value));
    }
    points
}

/// The stretch of [`WORST_S`] with the largest error of the identified model, both channels over their noise.
fn worst(trace: &Trace, noise: [f64; 2]) -> (f64, f64) {
    let time_s = &trace.time_s;
    let (Some(&first), Some(&last)) = (time_s.first(), time_s.last()) else { return (0.0, WORST_S) };
    let squares: Vec<f64> = (0..time_s.len())
        .map(|k| {
            let v_y = (trace.v_y_after_mps[k] - trace.v_y_mps[k]) / noise[0];
            let yaw_rate = (trace.yaw_rate_after_radps[k] - trace.yaw_rate_radps[k]) / noise[1];
            let square = v_y * v_y + yaw_rate * yaw_rate;
            if square.is_finite() { square } else { 0.0 }
        })
        .collect();
    let (mut start, mut sum, mut most, mut at_s) = (0, 0.0, -1.0, first);
    for k in 0..time_s.len() {
        sum += squares[k];
        while time_s[k] - time_s[start] > WORST_S {
            sum -= squares[start];
            start += 1;
        }
        if sum > most {
            (most, at_s) = (sum, time_s[start]);
        }
    }
    let at_s = at_s.min(last - WORST_S).max(first);
    (at_s, at_s + WORST_S)
}

/// Error of both channels along the drive, before and after.
pub(super) fn residuals(outcome: &Outcome) -> [Chart; 2] {
    let t = &outcome.trace;
    let picture = |title: &str, unit: &str, measured: &[f64], before: &[f64], after: &[f64]| {
        let line = |role: Role, name: &str, values: &[f64]| Layer::Line {
            role,
            name: name.into(),
            points: binned(&t.time_s, measured, values),
        };
        Chart::new(title, Axis::new("time / s"), Axis::new(unit).from_zero())
            .sized(460, 190)
            .with(line(Role::Nominal, "before", before))
            .with(line(Role::Identified, "with the tires found", after))
    };
    [
        picture(
            "error of the lateral velocity",
            "RMS error of v_y / (m/s)",
            &t.v_y_mps,
            &t.v_y_before_mps,
            &t.v_y_after_mps,
        ),
        picture(
            "error of the yaw rate",
            "RMS error / (rad/s)",
            &t.yaw_rate_radps,
            &t.yaw_rate_before_radps,
            &t.yaw_rate_after_radps,
        ),
    ]
}

/// Root mean square error by stretches of the drive.
fn binned(time_s: &[f64], measured: &[f64], model: &[f64]) -> Vec<(f64, f64)> {
    let (Some(&first), Some(&last)) = (time_s.first(), time_s.last()) else { return Vec::new() };
    let width_s = ((last - first) / BINS as f64).max(1e-9);
    let mut sums = vec![(0.0, 0_u32); BINS];
    for ((&time_s, m), x) in time_s.iter().zip(measured).zip(model) {
        let square = (x - m).powi(2);
        if square.is_finite() {
            let bin = &mut sums[(((time_s - first) / width_s) as usize).min(BINS - 1)];
            *bin = (bin.0 + square, bin.1 + 1);
        }
    }
    let rms = |(sum, n): (f64, u32)| if n > 0 { (sum / f64::from(n)).sqrt() } else { f64::NAN };
    sums.into_iter().enumerate().map(|(k, bin)| (first + (k as f64 + 0.5) * width_s, rms(bin))).collect()
}

/// Error of rollouts over their length.
pub(super) fn horizon(outcome: &Outcome) -> [Chart; 2] {
    let picture = |title: &str, unit: &str, error: &dyn Fn(&HorizonError) -> Change| {
        let line = |role: Role, name: &str, value: &dyn Fn(Change) -> f64| Layer::Line {
            role,
            name: name.into(),
            points: std::iter::once((0.0, f64::NAN))
                .chain(outcome.rollout_error.iter().map(|e| (e.horizon_s, value(error(e)))))
                .collect(),
        };
        Chart::new(
            title,
            Axis::new("time since the start of the rollout / s").from_zero(),
            Axis::new(unit).from_zero(),
        )
        .sized(460, 230)
        .with(line(Role::Nominal, "before", &|change| change.before))
        .with(line(Role::Identified, "with the tires found", &|change| change.after))
    };
    [
        picture("rollout error of the lateral velocity", "RMS error of v_y / (m/s)", &|e| e.v_y_mps),
        picture("rollout error of the yaw rate", "RMS error / (rad/s)", &|e| e.yaw_rate_radps),
    ]
}

/// The handling diagram: steering beyond that of the curve over lateral acceleration.
pub(super) fn handling(outcome: &Outcome) -> Chart {
    let points = &outcome.handling.diagram;
    let line = points.iter().map(|p| (p.a_y_mps2, p.steering_rad.value.to_degrees()));
    let band = points
        .iter()
        .map(|p| (p.a_y_mps2, p.steering_rad.low.to_degrees(), p.steering_rad.high.to_degrees()));
    Chart::new(
        "handling diagram",
        Axis::new("lateral acceleration / (m/s²)").from_zero(),
        Axis::new("steering beyond L/R / °"),
    )
    .sized(460, 230)
    .with(Layer::Band { role: Role::Identified, name: "90 %".into(), points: band.collect() })
    .with(Layer::Line {
        role: Role::Identified,
        name: "with the tires found".into(),
        points: std::iter::once((0.0, 0.0)).chain(line).collect(),
    })
}

/// The g-g diagram of the drive.
pub(super) fn accelerations(outcome: &Outcome) -> Chart {
    let t = &outcome.trace;
    let points = t.a_y_mps2.iter().copied().zip(t.a_x_mps2.iter().copied()).collect();
    Chart::new(
        "lateral and forward acceleration",
        Axis::new("lateral, left positive / (m/s²)"),
        Axis::new("forward / (m/s²)"),
    )
    .sized(460, 230)
    .with(Layer::Cloud { role: Role::Measured, name: "driven".into(), points })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_seconds_hold_the_largest_error() {
        let time_s: Vec<f64> = (0..6000).map(|k| f64::from(k) * 0.01).collect();
        let v_y_after_mps = time_s.iter().map(|t| if (30.0..33.0).contains(t) { 1.0 } else { 0.1 }).collect();
        let zeros = vec![0.0; time_s.len()];
        let trace = Trace {
            time_s,
            v_y_after_mps,
            v_y_mps: zeros.clone(),
            yaw_rate_radps: zeros.clone(),
            yaw_rate_after_radps: zeros,
            ..Trace::default()
        };
        let (from_s, to_s) = worst(&trace, [0.1, 0.1]);
        assert!(from_s <= 30.0 && to_s >= 32.99, "{from_s} {to_s}");
        assert_eq!(worst(&Trace::default(), [1.0, 1.0]), (0.0, WORST_S));
    }

    #[test]
    fn errors_are_root_mean_squares_by_stretch() {
        let time_s: Vec<f64> = (0..1500).map(f64::from).collect();
        let model: Vec<f64> = time_s.iter().map(|t| if *t < 749.5 { 3.0 } else { -1.0 }).collect();
        let bins = binned(&time_s, &vec![0.0; 1500], &model);
        assert_eq!(bins.len(), BINS);
        assert!((bins[0].1 - 3.0).abs() < 1e-12 && (bins[BINS - 1].1 - 1.0).abs() < 1e-12);
    }
}
