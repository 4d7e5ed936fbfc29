//! The place on the lap, from the pose alone: the first lap is the ruler for all later ones.

use gripsight_signals::Segment;

use crate::smooth::median;

/// Laps of a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Laps {
    /// Distance along the lap over its length, per segment and sample; 0 without laps.
    pub(crate) share: Vec<Vec<f64>>,
    /// Length of the lap; 0 where no lap was closed.
    pub(crate) lap_m: f64,
    /// Laps driven.
    pub(crate) laps: f64,
    /// The first closed lap, point by point: x, y, heading.
    ruler: Vec<(f64, f64, f64)>,
}

/// A lap turns the car by a full turn and brings it back to within this share of the way driven since.
const CLOSE_SHARE: f64 = 0.03;
/// How far ahead of the last place the next is looked for, over the lap.
const LOOK_AHEAD_SHARE: f64 = 0.1;
/// A drive that is further off another one's lap, over the lap, is on another course.
const OTHER_COURSE_SHARE: f64 = 0.02;

/// Finds laps and places. Without a pose, or without a closed lap, the places are all 0. With `known` laps of another drive over the same
/// course, places are theirs.
pub(crate) fn stations(segments: &[Segment], known: Option<&Laps>) -> Laps {
    let none = || Laps { share: segments.iter().map(|s| vec![0.0; s.len()]).collect(), ..Laps::default() };
    if segments.iter().any(|s| s.x_m.is_empty() || s.yaw_rad.is_empty()) {
        return none();
    }
    let points: Vec<(f64, f64, f64)> =
        segments.iter().flat_map(|s| (0..s.len()).map(|k| (s.x_m[k], s.y_m[k], s.yaw_rad[k]))).collect();
    let ruler: &[_] = match known.map(|k| &k.ruler) {
        Some(ruler) => ruler,
        None => first_lap(&points).map_or(&[], |(from, to)| &points[from..=to]),
    };
    if ruler.is_empty() {
        return none();
    }
    let mut along = vec![0.0];
    for w in ruler.windows(2) {
        along.push(along[along.len() - 1] + (w[1].0 - w[0].0).hypot(w[1].1 - w[0].1));
    }
    let lap_m = along[along.len() - 1];
    let driven: f64 = points.windows(2).map(|w| (w[1].0 - w[0].0).hypot(w[1].1 - w[0].1)).sum();
    let mut near: Option<usize> = None;
    let mut off_m = Vec::with_capacity(points.len());
    let share = segments
        .iter()
        .map(|s| {
            (0..s.len())
                .map(|k| {
                    let place = nearest(ruler, s.x_m[k], s.y_m[k], near);
                    near = Some(place);
                    off_m.push((ruler[place].0 - s.x_m[k]).hypot(ruler[place].1 - s.y_m[k]));
                    along[place] / lap_m
                })
                .collect()
        })
        .collect();
    if known.is_some() && median(off_m) > OTHER_COURSE_SHARE * lap_m {
        return stations(segments, None);
    }
    Laps { share, lap_m, laps: driven / lap_m, ruler: ruler.to_vec() }
}

/// First and last sample of the first closed lap: the heading has turned by a whole turn, and the car is back.
fn first_lap(points: &[(f64, f64, f64)]) -> Option<(usize, usize)> {
    let moved = |p: &(f64, f64, f64), q: &(f64, f64, f64)| (p.0 - q.0).hypot(p.1 - q.1);
    let from = points.iter().position(|p| moved(p, &points[0]) > 0.0)?;
    let start = points[from];
    let mut way_m = 0.0;
    let mut best: Option<(usize, f64)> = None;
    for k in from + 1..points.len() {
        way_m += moved(&points[k], &points[k - 1]);
        let turned = (points[k].2 - start.2).abs() / std::f64::consts::TAU;
        let apart_m = moved(&points[k], &start);
        let facing = (points[k].2 - start.2).cos() > 0.5;
        if turned > 0.8 && facing && apart_m < CLOSE_SHARE * way_m {
            if best.is_none_or(|(_, m)| apart_m < m) {
                best = Some((k, apart_m));
            }
        } else if let Some((k, _)) = best {
            return Some((from, k));
        }
    }
    None
}

fn nearest(ruler: &[(f64, f64, f64)], x_m: f64, y_m: f64, near: Option<usize>) -> usize {
    let n = ruler.len();
    let square = |i: usize| (ruler[i].0 - x_m).powi(2) + (ruler[i].1 - y_m).powi(2);
    let ahead = ((n as f64 * LOOK_AHEAD_SHARE) as usize).max(3);
    let places: Vec<usize> = match near {
        Some(i) => (0..ahead).map(|d| (i + d + n - ahead / 4) % n).collect(),
        None => (0..n).collect(),
    };
    places.into_iter().min_by(|&a, &b| square(a).total_cmp(&square(b))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_laps_of_a_circle_give_the_same_places() {
        let n = 1000;
        let turn = |k: usize| k as f64 * 0.015;
        let segment = Segment {
            dt_s: 0.01,
            v_x_mps: vec![1.0; n],
            x_m: (0..n).map(|k| 10.0 * turn(k).cos() - 10.0).collect(),
            y_m: (0..n).map(|k| 10.0 * turn(k).sin()).collect(),
            yaw_rad: (0..n).map(|k| turn(k) + 1.57).collect(),
            ..Segment::default()
        };
        let laps = stations(&[segment], None);
        approx::assert_relative_eq!(laps.lap_m, 62.8, max_relative = 0.01);
        for k in (0..n).step_by(50) {
            let expected = (turn(k) / std::f64::consts::TAU).fract();
            let off = laps.share[0][k] - expected;
            assert!((off - off.round()).abs() < 0.01, "{k}: {} against {expected}", laps.share[0][k]);
        }
    }
}
