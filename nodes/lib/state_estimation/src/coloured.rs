//! What sensors and poses are off by over tenths of a second.
//!
//! A filtered or differentiated signal has hardly any noise from sample to sample and is wrong all the same, and so is a localisation that wanders. Believed
//! to its white noise either outvotes the other. Over spans of some length poses and a sensor say the same change; what remains of the difference, beyond
//! the white noise of both, tells by its growth with the span which of the two it is: a wandering localisation's change is bounded, and a sensor's error
//! adds up. What the recording does not decide counts on both sides, each by its probability.

use gripsight_signals::{Poses, StateSequence, yaw_rates};
use nalgebra::{DMatrix, DVector};

use crate::levels::{Levels, Wander};

/// Lengths of the spans.
const SPANS_S: [f64; 5] = [0.1, 0.2, 0.4, 0.8, 1.6];
/// A difference tells of a sensor where it is larger than what the poses' noise makes by this.
const BEYOND: f64 = 1.5;
/// A turn within a span beyond which the way ahead mixes with the one to the side.
const MOST_TURN_RAD: f64 = 0.5;
/// Spans that a judgement needs.
const LEAST_SPANS: usize = 20;
/// Times over which a localisation, or a sensor, may forget what it is off by.
const FORGETS_S: [f64; 5] = [0.1, 0.2, 0.4, 0.8, 1.6];
/// A sensor that forgets at once.
const WHITE_S: f64 = 1e-3;

/// One span: what the poses say less nothing else, what the sensor says and what may be wrong with it, and how many samples it is worth.
struct Row {
    by_pose: f64,
    beside: [f64; 4],
    samples: f64,
}

/// The levels with what the sensors, and the poses, are off by over tenths of a second.
pub(crate) fn with_coloured(sequence: &StateSequence, poses: &Poses, white: Levels) -> Levels {
    let mut all = white;
    let rows = SPANS_S.map(|span_s| rows(sequence, poses, span_s));
    let of = |channel: usize, white: f64| {
        let growth: Vec<Growth> = SPANS_S
            .into_iter()
            .zip(&rows)
            .filter_map(|(span_s, rows)| Growth::of(&rows[channel], span_s, white * 2_f64.sqrt()))
            .collect();
        told_apart(&growth)
    };
    for (channel, white, level, wander) in [
        (0, white.position_m, &mut all.v_x_mps, &mut all.position_wander),
        (1, white.heading_rad, &mut all.yaw_rate_radps, &mut all.heading_wander),
    ] {
        let Some(found) = of(channel, white) else { continue };
        *level = level.max(found.sensor);
        if found.wander.sigma > wander.sigma {
            *wander = found.wander;
        }
    }
    for (span_s, rows) in SPANS_S.into_iter().zip(&rows) {
        let wander = all.position_wander;
        let alike = |spans: f64| (-spans * span_s / wander.time_s).exp();
        let wandered = wander.sigma.powi(2) * (6.0 - 8.0 * alike(1.0) + 2.0 * alike(2.0));
        let noise = (6.0 * white.position_m.powi(2) + wandered).sqrt() / (span_s * span_s);
        for (level, rows) in [&mut all.a_x_mps2, &mut all.a_y_mps2].into_iter().zip(&rows[2..]) {
            if let Some((left, samples)) = left(rows)
                && left > BEYOND * noise
            {
                *level = level.max((left * left - noise * noise).sqrt() * samples.sqrt());
            }
        }
    }
    all
}

/// What remains of the change over spans of one length.
struct Growth {
    span_s: f64,
    /// Variance of the difference of the changes, beyond the poses' white noise.
    beyond: f64,
    /// Standard deviation of that.
    sigma: f64,
    /// Samples of the sensor in a span.
    samples: f64,
}

impl Growth {
    /// `noise` is what white noise of the poses makes of a change.
    fn of(rows: &[Row], span_s: f64, noise: f64) -> Option<Self> {
        let (left, samples) = left(rows)?;
        let variance = (left * span_s).powi(2);
        // Half of the spans overlap, and a variance by a median is as good as one by a third of the points (the median absolute deviation's efficiency is 0.37).
        let points = 0.37 * 0.5 * rows.len() as f64;
        Some(Self {
            span_s,
            beyond: variance - noise * noise,
            sigma: variance * (2.0 / points).sqrt(),
            samples,
        })
    }
}

/// A law of growth, as it fits.
struct Law {
    time_s: f64,
    size: f64,
    chi2: f64,
}

/// What of it is whose.
struct Apart {
    /// White noise of the sensor that is worth as much.
    sensor: f64,
    wander: Wander,
}

/// Whose the growth is: least squares of each law of growth to it, each law weighted by its likelihood, laws of either side as likely beforehand.
/// `None` where there is nothing beyond the white noise.
fn told_apart(growth: &[Growth]) -> Option<Apart> {
    if growth.len() < 2 || growth.iter().all(|g| (g.beyond / g.sigma) < 1.0) {
        return None;
    }
    // A Gauss-Markov localisation: gamma(0) - gamma(s), twice. A sensor: the integral of a Gauss-Markov error over the span.
    let bounded = |span_s: f64, time_s: f64| 2.0 * (1.0 - (-span_s / time_s).exp());
    let adding = |span_s: f64, time_s: f64| span_s - time_s * (1.0 - (-span_s / time_s).exp());
    let fitted = |law: &dyn Fn(f64) -> f64| {
        let (mut up, mut down) = (0.0, 0.0);
        for g in growth {
            let shape = law(g.span_s) / g.sigma;
            up += shape * g.beyond / g.sigma;
            down += shape * shape;
        }
        let size = (up / down).max(0.0);
        let chi2: f64 = growth.iter().map(|g| ((g.beyond - size * law(g.span_s)) / g.sigma).powi(2)).sum();
        (size, chi2)
    };
    let of = |times_s: &[f64], law: &dyn Fn(f64, f64) -> f64| -> Vec<Law> {
        let law = |&time_s: &f64| {
            let (size, chi2) = fitted(&|span_s| law(span_s, time_s));
            Law { time_s, size, chi2 }
        };
        times_s.iter().map(law).collect()
    };
    let poses = of(&FORGETS_S, &bounded);
    let sensor = of(&[&[WHITE_S], &FORGETS_S[..]].concat(), &adding);
    let least = poses.iter().chain(&sensor).map(|l| l.chi2).fold(f64::INFINITY, f64::min);
    let weight = |law: &Law| (-0.5 * (law.chi2 - least)).exp();
    let mean = |laws: &[Law], f: &dyn Fn(&Law) -> f64| {
        laws.iter().map(|law| weight(law) * f(law)).sum::<f64>() / laws.len() as f64
    };
    let either = mean(&poses, &|_| 1.0) + mean(&sensor, &|_| 1.0);
    let variance = mean(&poses, &|law| law.size) / either;
    // How fast it spreads at first.
    let spread = mean(&poses, &|law| law.size / law.time_s) / either;
    // White noise that has added up to as much over the longest span looked at.
    let longest = growth.iter().max_by(|a, b| a.span_s.total_cmp(&b.span_s))?;
    let white =
        |law: &Law| law.size * adding(longest.span_s, law.time_s) / longest.span_s.powi(2) * longest.samples;
    Some(Apart {
        sensor: (mean(&sensor, &white) / either).sqrt(),
        wander: Wander {
            sigma: variance.sqrt(),
            time_s: if spread > 0.0 { variance / spread } else { FORGETS_S[0] },
        },
    })
}

fn rows(sequence: &StateSequence, poses: &Poses, span_s: f64) -> [Vec<Row>; 4] {
    let mut rows = [const { Vec::new() }; 4];
    if sequence.len() < 2 {
        return rows;
    }
    let time = |k: usize| f64::from(sequence.time_s[k]);
    let n = sequence.len();
    let rates = yaw_rates(sequence);
    let has_speed = sequence.v_x_mps.iter().any(|&v| v != 0.0);
    let has_forces = sequence.a_x_mps2.len() == n && sequence.a_y_mps2.len() == n;
    // By the trapezoid: a plain mean of samples is off by more than a good sensor.
    let integral = |v: &[f32]| {
        let mut sum = vec![0.0; n];
        for k in 1..n {
            sum[k] = sum[k - 1] + 0.5 * f64::from(v[k] + v[k - 1]) * (time(k) - time(k - 1));
        }
        sum
    };
    let (ways, turns) = (integral(&sequence.v_x_mps), rates.map(integral));
    let at = |integral: &[f64], t: f64| {
        let k = sequence.time_s.partition_point(|&s| f64::from(s) <= t).clamp(1, n - 1);
        let share = ((t - time(k - 1)) / (time(k) - time(k - 1))).clamp(0.0, 1.0);
        integral[k - 1] + (integral[k] - integral[k - 1]) * share
    };
    let value = |values: &[f32], t: f64| {
        let k = sequence.time_s.partition_point(|&s| f64::from(s) <= t).clamp(1, n - 1);
        let share = ((t - time(k - 1)) / (time(k) - time(k - 1))).clamp(0.0, 1.0);
        f64::from(values[k - 1]) + f64::from(values[k] - values[k - 1]) * share
    };
    let next = |from: usize| {
        let t = poses.time_s[from];
        let to = from + poses.time_s[from..].partition_point(|&p| p < t + span_s - 1e-6);
        (to < poses.time_s.len() && poses.time_s[to] < t + 1.5 * span_s).then_some(to)
    };
    let mut a = 0;
    while a < poses.time_s.len() {
        let here = a;
        // Neighbouring spans overlap by half: more would tell the same twice.
        a += poses.time_s[a..].partition_point(|&p| p < poses.time_s[here] + 0.5 * span_s).max(1);
        let Some(b) = next(here) else { continue };
        let samples = |from_s: f64, to_s: f64| {
            sequence.time_s.partition_point(|&t| f64::from(t) < from_s)
                ..sequence.time_s.partition_point(|&t| f64::from(t) <= to_s)
        };
        let (from_s, to_s) = (poses.time_s[here], poses.time_s[b]);
        let count = samples(from_s, to_s).len();
        if (count as f64) < 0.5 * (to_s - from_s) * n as f64 / (time(n - 1) - time(0)).max(1e-3) || count < 2
        {
            continue;
        }
        let mean = |integral: &[f64]| (at(integral, to_s) - at(integral, from_s)) / (to_s - from_s);
        // What a sensor's lag, or a rest of the poses' delay, makes of it.
        let change = |integral: &[f64]| {
            let middle_s = 0.5 * (from_s + to_s);
            at(integral, to_s) + at(integral, from_s) - 2.0 * at(integral, middle_s)
        };
        let turned = poses.yaw_rad[b] - poses.yaw_rad[here];
        if let Some(turns) = &turns {
            rows[1].push(Row {
                by_pose: turned / (to_s - from_s),
                beside: [mean(turns), 1.0, change(turns), 0.0],
                samples: count as f64,
            });
        }
        if has_speed && turned.abs() < MOST_TURN_RAD {
            // Seen from the heading in the middle. Without a yaw rate the car turns evenly, as far as anything tells.
            let middle = 0.5 * (poses.yaw_rad[b] + poses.yaw_rad[here]);
            let (sin, cos) = middle.sin_cos();
            let along = (poses.x_m[b] - poses.x_m[here]) * cos + (poses.y_m[b] - poses.y_m[here]) * sin;
            let heading = |t: f64| match &turns {
                Some(turns) => at(turns, t) - 0.5 * (at(turns, from_s) + at(turns, to_s)),
                None => ((t - from_s) / (to_s - from_s) - 0.5) * turned,
            };
            let (mut forward, mut slipping) = (0.0, 0.0);
            let mut last: Option<(f64, f64, f64)> = None;
            let inside = samples(from_s, to_s).map(time).filter(|&t| t > from_s && t < to_s);
            for t in [from_s].into_iter().chain(inside).chain([to_s]) {
                let (sin, cos) = heading(t).sin_cos();
                let rate = rates.map_or(turned / (to_s - from_s), |rates| value(rates, t));
                let now = (t, value(&sequence.v_x_mps, t) * cos, -rate * sin);
                if let Some(before) = last {
                    let dt_s = t - before.0;
                    forward += 0.5 * (now.1 + before.1) * dt_s;
                    slipping += 0.5 * (now.2 + before.2) * dt_s;
                }
                last = Some(now);
            }
            rows[0].push(Row {
                by_pose: along / (to_s - from_s),
                // v_y is nearly proportional to the yaw rate while the speed hardly changes.
                beside: [forward / (to_s - from_s), 1.0, change(&ways), slipping / (to_s - from_s)],
                samples: count as f64,
            });
        }
        let Some(c) = next(b).filter(|_| has_forces) else { continue };
        let until_s = poses.time_s[c];
        let speed =
            |p: &[f64], from: usize, to: usize| (p[to] - p[from]) / (poses.time_s[to] - poses.time_s[from]);
        let change = |p: &[f64]| (speed(p, b, c) - speed(p, here, b)) / (0.5 * (until_s - from_s));
        let (sin, cos) = poses.yaw_rad[b].sin_cos();
        let (along, across) = (
            cos * change(&poses.x_m) + sin * change(&poses.y_m),
            cos * change(&poses.y_m) - sin * change(&poses.x_m),
        );
        // The second difference of positions is the mean acceleration under a triangle.
        let (mut weights, mut squares, mut force, mut late) = (0.0, 0.0, [0.0; 2], [0.0; 2]);
        let rate = |k: usize| rates.map_or(0.0, |r| f64::from(r[k]));
        let (mut turning, mut turning2) = (0.0, 0.0);
        for k in samples(from_s, until_s) {
            let t = time(k);
            let weight =
                if t < to_s { (t - from_s) / (to_s - from_s) } else { (until_s - t) / (until_s - to_s) };
            let heading = turns.as_ref().map_or(0.0, |turns| at(turns, t) - at(turns, to_s));
            let (sin, cos) = heading.sin_cos();
            let (a_x, a_y) = (f64::from(sequence.a_x_mps2[k]), f64::from(sequence.a_y_mps2[k]));
            for (place, a) in [cos * a_x - sin * a_y, sin * a_x + cos * a_y].into_iter().enumerate() {
                force[place] += weight * a;
                late[place] += if t < to_s { -a } else { a };
            }
            turning2 += weight * rate(k).powi(2);
            turning += if t < to_s { -rate(k) } else { rate(k) };
            weights += weight;
            squares += weight * weight;
        }
        if weights <= 0.0 || rates.is_none() {
            continue;
        }
        // Scale, bias and the place of the unit are the filter's to find.
        let samples = weights * weights / squares;
        rows[2].push(Row {
            by_pose: along,
            beside: [force[0] / weights, 1.0, turning2 / weights, late[0] / weights],
            samples,
        });
        rows[3].push(Row {
            by_pose: across,
            beside: [force[1] / weights, 1.0, turning, late[1] / weights],
            samples,
        });
    }
    rows
}

/// What is left of the first beside the others (half of it below and half above), and the samples that a span is worth.
fn left(rows: &[Row]) -> Option<(f64, f64)> {
    if rows.len() < LEAST_SPANS {
        return None;
    }
    let mut kept: Vec<usize> = (0..rows.len()).collect();
    let mut size = f64::INFINITY;
    for _ in 0..3 {
        let width = if rows.iter().all(|r| r.beside[3] == 0.0) { 3 } else { 4 };
        let a = DMatrix::from_fn(kept.len(), width, |i, j| rows[kept[i]].beside[j]);
        let y = DVector::from_fn(kept.len(), |i, _| rows[kept[i]].by_pose);
        let found = a.svd(true, true).solve(&y, 1e-9).ok()?;
        let off = |r: &Row| r.by_pose - (0..width).map(|j| found[j] * r.beside[j]).sum::<f64>();
        let mut sizes: Vec<f64> = rows.iter().map(|r| off(r).abs()).collect();
        let middle = sizes.len() / 2;
        size = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.6745;
        kept = (0..rows.len()).filter(|&i| off(&rows[i]).abs() <= 3.0 * size).collect();
        if kept.len() < LEAST_SPANS / 2 {
            return None;
        }
    }
    let samples = rows.iter().map(|r| r.samples).sum::<f64>() / rows.len() as f64;
    Some((size, samples))
}
