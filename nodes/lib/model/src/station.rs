//! The place on the course, from the pose alone: the first lap is the ruler for all later ones, or the way driven where no lap was closed.

use gripsight_signals::Segment;

use crate::smooth::median;

/// The course of a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Laps {
    /// Distance along the course over its length, per segment and sample; 0 without a pose.
    pub share: Vec<Vec<f64>>,
    /// Length of the lap; where none was closed, of the way driven and a stretch more that keeps its ends apart. 0 without a pose.
    pub lap_m: f64,
    /// Laps driven; 0 where none was closed.
    pub laps: f64,
    /// The first closed lap, or the way driven, point by point: x, y, heading.
    ruler: Vec<(f64, f64, f64)>,
}

impl Laps {
    /// A course of which no more than its length is known.
    pub(crate) fn of_length(lap_m: f64) -> Self {
        Self { lap_m, ..Self::default() }
    }
}

/// A lap turns the car by a full turn and brings it back to within this share of the way driven since.
const CLOSE_SHARE: f64 = 0.03;
/// How far ahead of the last place the next is looked for, over the lap.
const LOOK_AHEAD_SHARE: f64 = 0.1;
/// A drive that is further off another one's course, over its length, is on another one.
const OTHER_COURSE_SHARE: f64 = 0.02;
/// Stretch between the ends of a course that is not closed, over the way driven, and the place on it where a sample is that is off the course.
const APART: f64 = 0.2;
const OFF_COURSE: f64 = 1.0 - 0.5 * APART / (1.0 + APART);
/// Points of a course that is not closed that places are looked for among, at most.
const MOST_POINTS: usize = 2000;

/// Finds laps and places. Without a pose the places are all 0. With the `known` course of another drive, places are on that one.
pub(crate) fn stations(segments: &[Segment], known: Option<&Laps>) -> Laps {
    let none = || Laps { share: segments.iter().map(|s| vec![0.0; s.len()]).collect(), ..Laps::default() };
    if segments.iter().any(|s| s.x_m.is_empty() || s.yaw_rad.is_empty()) {
        return none();
    }
    let points: Vec<(f64, f64, f64)> =
        segments.iter().flat_map(|s| (0..s.len()).map(|k| (s.x_m[k], s.y_m[k], s.yaw_rad[k]))).collect();
    let (ruler, closed) = match known {
        Some(known) => (&known.ruler[..], known.laps > 0.0),
        None => match first_lap(&points) {
            Some((from, to)) => (&points[from..=to], true),
            None => (&points[..], false),
        },
    };
    let mut along = vec![0.0];
    for w in ruler.windows(2) {
        along.push(along[along.len() - 1] + (w[1].0 - w[0].0).hypot(w[1].1 - w[0].1));
    }
    let way_m = along[along.len() - 1];
    let lap_m = if closed { way_m } else { (1.0 + APART) * way_m };
    if lap_m <= 0.0 {
        return none();
    }
    let mut near: Option<usize> = None;
    let mut off_m = Vec::with_capacity(points.len());
    let mut place = |k: usize| {
        let (x_m, y_m, _) = points[k];
        let place = match (closed, known) {
            (true, _) => nearest(ruler, x_m, y_m, near),
            (false, Some(_)) => nearest_of_all(ruler, x_m, y_m),
            (false, None) => k,
        };
        near = Some(place);
        off_m.push((ruler[place].0 - x_m).hypot(ruler[place].1 - y_m));
        let is_off = !closed && off_m[off_m.len() - 1] > OTHER_COURSE_SHARE * lap_m;
        if is_off { OFF_COURSE } else { along[place] / lap_m }
    };
    let mut first = 0;
    let mut share = Vec::with_capacity(segments.len());
    for s in segments {
        share.push((first..first + s.len()).map(&mut place).collect());
        first += s.len();
    }
    if closed && known.is_some() && median(off_m) > OTHER_COURSE_SHARE * lap_m {
        return stations(segments, None);
    }
    let driven: f64 = points.windows(2).map(|w| (w[1].0 - w[0].0).hypot(w[1].1 - w[0].1)).sum();
    Laps { share, lap_m, laps: if closed { driven / lap_m } else { 0.0 }, ruler: ruler.to_vec() }
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

/// The nearest of some points along the whole of a course.
fn nearest_of_all(ruler: &[(f64, f64, f64)], x_m: f64, y_m: f64) -> usize {
    let square = |i: usize| (ruler[i].0 - x_m).powi(2) + (ruler[i].1 - y_m).powi(2);
    let step = ruler.len().div_ceil(MOST_POINTS).max(1);
    (0..ruler.len()).step_by(step).min_by(|&a, &b| square(a).total_cmp(&square(b))).unwrap_or(0)
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

    #[test]
    fn half_a_lap_is_a_course_too_and_another_drive_finds_its_places_on_it() {
        let arc = |from: f64, to: f64, radius_m: f64| {
            let n = 800;
            let turn = move |k: usize| from + (to - from) * k as f64 / n as f64;
            Segment {
                dt_s: 0.01,
                v_x_mps: vec![1.0; n],
                x_m: (0..n).map(|k| radius_m * turn(k).cos()).collect(),
                y_m: (0..n).map(|k| radius_m * turn(k).sin()).collect(),
                yaw_rad: (0..n).map(|k| turn(k) + 1.57).collect(),
                ..Segment::default()
            }
        };
        let half = stations(&[arc(0.0, 3.0, 10.0)], None);
        assert_eq!(half.laps, 0.0);
        approx::assert_relative_eq!(half.lap_m, 36.0, max_relative = 0.01);
        approx::assert_relative_eq!(half.share[0][400], 15.0 / 36.0, max_relative = 0.01);
        // Beside it, from its middle on and beyond its end.
        let other = stations(&[arc(1.5, 4.5, 10.1)], Some(&half));
        approx::assert_relative_eq!(other.share[0][0], 15.0 / 36.0, max_relative = 0.01);
        approx::assert_relative_eq!(other.share[0][200], 22.5 / 36.0, max_relative = 0.01);
        assert_eq!(other.share[0][799], OFF_COURSE);
        assert_eq!(other.lap_m, half.lap_m);
    }
}
