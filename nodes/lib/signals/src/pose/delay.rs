//! How late poses are: the shift at which their heading follows the integrated yaw rate best.

use super::yaw_rates;
use crate::{Poses, StateSequence};

/// Delays tried.
const LONGEST_S: f64 = 0.25;
const STEP_S: f64 = 0.005;
/// Over so long the gyroscope's bias and the map's heading are one straight line.
const SPAN_S: f64 = 4.0;

/// The delay of the poses behind the yaw rate, with its standard deviation; `None` where no yaw rate is recorded or the car does not
/// turn enough to tell.
#[must_use]
pub fn pose_delay_s(sequence: &StateSequence, poses: &Poses) -> Option<(f64, f64)> {
    let rates = yaw_rates(sequence)?;
    let time_s: Vec<f64> = sequence.time_s.iter().map(|&t| f64::from(t)).collect();
    let mut turned = vec![0.0; time_s.len()];
    for k in 1..time_s.len() {
        turned[k] = turned[k - 1] + 0.5 * f64::from(rates[k] + rates[k - 1]) * (time_s[k] - time_s[k - 1]);
    }
    let at = |t: f64| {
        let k = time_s.partition_point(|&s| s <= t).clamp(1, time_s.len() - 1);
        let share = ((t - time_s[k - 1]) / (time_s[k] - time_s[k - 1])).clamp(0.0, 1.0);
        turned[k - 1] + (turned[k] - turned[k - 1]) * share
    };
    let spans = spans(poses);
    if spans.len() < 3 {
        return None;
    }
    let tried: Vec<f64> = (-10..=(LONGEST_S / STEP_S) as i32).map(|k| f64::from(k) * STEP_S).collect();
    let costs: Vec<Vec<f64>> = tried
        .iter()
        .map(|&delay_s| {
            spans
                .iter()
                .map(|&(from, to)| {
                    let points: Vec<(f64, f64)> = (from..to)
                        .map(|k| (poses.time_s[k], poses.yaw_rad[k] - at(poses.time_s[k] - delay_s)))
                        .collect();
                    about_line(&points)
                })
                .collect()
        })
        .collect();
    let best_of = |picked: &[usize]| {
        let totals: Vec<f64> = costs.iter().map(|c| trimmed(picked.iter().map(|&i| c[i]))).collect();
        let best = (0..totals.len()).min_by(|&a, &b| totals[a].total_cmp(&totals[b]))?;
        if best == 0 || best + 1 == totals.len() {
            return None;
        }
        // The lowest point of the parabola through the best and its neighbours.
        let [a, b, c] = [totals[best - 1], totals[best], totals[best + 1]];
        let bend = a - 2.0 * b + c;
        let shift = if bend > 0.0 { 0.5 * (a - c) / bend } else { 0.0 };
        Some((tried[best] + shift * STEP_S, totals[best], totals.iter().copied().fold(0.0, f64::max)))
    };
    let all: Vec<usize> = (0..spans.len()).collect();
    let (delay_s, least, most) = best_of(&all)?;
    // Where the delay makes little difference, the car hardly turned.
    if most < 1.2 * least {
        return None;
    }
    // Leave one span in eight out, in turn: the spread of the eight, as a jackknife has it.
    let parts: Vec<f64> = (0..8)
        .filter_map(|part| {
            let kept: Vec<usize> = all.iter().copied().filter(|i| i % 8 != part).collect();
            best_of(&kept).map(|(delay_s, ..)| delay_s)
        })
        .collect();
    let mean = parts.iter().sum::<f64>() / parts.len().max(1) as f64;
    let spread = parts.iter().map(|d| (d - mean).powi(2)).sum::<f64>() * 7.0 / 8.0;
    Some((delay_s, spread.sqrt().max(1e-3)))
}

/// Stretches of poses of four seconds.
fn spans(poses: &Poses) -> Vec<(usize, usize)> {
    let mut spans = Vec::new();
    let mut from = 0;
    for k in 0..poses.time_s.len() {
        if poses.time_s[k] - poses.time_s[from] >= SPAN_S {
            if k - from >= 10 {
                spans.push((from, k));
            }
            from = k;
        }
    }
    spans
}

/// Mean squared distance of points from their straight line, by least squares, the farthest left out.
fn about_line(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let (mt, mv) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
    let (mut up, mut down) = (0.0, 0.0);
    for (t, v) in points {
        up += (t - mt) * (v - mv);
        down += (t - mt) * (t - mt);
    }
    let slope = if down > 0.0 { up / down } else { 0.0 };
    trimmed(points.iter().map(|(t, v)| (v - mv - slope * (t - mt)).powi(2)))
}

/// The mean of all but the largest tenth.
fn trimmed(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    if values.is_empty() {
        return f64::NAN;
    }
    values.sort_unstable_by(f64::total_cmp);
    let kept = (values.len() * 9).div_ceil(10);
    values[..kept].iter().sum::<f64>() / kept as f64
}
