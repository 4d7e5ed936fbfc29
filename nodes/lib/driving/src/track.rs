//! A closed track from a table, and the place of a car on it.
//!
//! The file has a row a point, in driving order, without the first point again at the end: `x_m, y_m, w_tr_right_m, w_tr_left_m`, separated by
//! commas or semicolons; a first row of names and rows that begin with `#` are passed over. That is what the track tools of F1TENTH stacks write.
//! The line is driven as it stands: no racing line is planned.

use std::f64::consts::TAU;

use crate::DrivingError;
use crate::spline::ClosedSpline;

/// Points that a lap is resampled to.
const POINTS: usize = 1024;
/// Fewest different points of a lap.
const FEWEST: usize = 8;

/// A point of the line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackPoint {
    /// Position.
    pub x_m: f64,
    /// Position.
    pub y_m: f64,
    /// Heading of the tangent, in -pi..pi.
    pub heading_rad: f64,
    /// Curvature, positive to the left.
    pub curvature_1pm: f64,
    /// Drivable width to the right of the line.
    pub right_m: f64,
    /// Drivable width to the left of the line.
    pub left_m: f64,
}

/// A place relative to the line.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Place {
    /// Distance along the line in this lap.
    pub station_m: f64,
    /// Distance to the left of it.
    pub offset_m: f64,
}

/// A closed line with widths, evenly sampled.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    points: Vec<TrackPoint>,
    step_m: f64,
}

impl Track {
    /// Reads a table as the module's text describes it.
    ///
    /// # Errors
    /// [`DrivingError`] names the row or point that makes no sense.
    pub fn from_csv(text: &str) -> Result<Self, DrivingError> {
        let first = text.lines().find(|line| !line.trim_start().starts_with('#')).unwrap_or_default();
        let delimiter = if first.contains(';') { b';' } else { b',' };
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .flexible(true)
            .delimiter(delimiter)
            .from_reader(text.as_bytes());
        let mut rows = Vec::new();
        for (index, record) in reader.records().enumerate() {
            let record = record?;
            let numbers: Vec<f64> = record.iter().take(4).map_while(|cell| cell.parse().ok()).collect();
            match <[f64; 4]>::try_from(numbers) {
                Ok(row) => rows.push(row),
                Err(none) if index == 0 && none.is_empty() => {}
                Err(_) => {
                    let row = record.position().map_or(0, csv::Position::line);
                    return Err(DrivingError::Row { row, got: record.iter().collect::<Vec<_>>().join(",") });
                }
            }
        }
        Self::from_points(&rows)
    }

    /// From points in driving order: x, y, width to the right, width to the left, in m.
    ///
    /// # Errors
    /// [`DrivingError::Point`] and [`DrivingError::TooShort`].
    pub fn from_points(rows: &[[f64; 4]]) -> Result<Self, DrivingError> {
        for (index, &[x_m, y_m, right_m, left_m]) in rows.iter().enumerate() {
            let good = [x_m, y_m, right_m, left_m].iter().all(|v| v.is_finite());
            if !(good && right_m > 0.0 && left_m > 0.0) {
                return Err(DrivingError::Point { point: index + 1, x_m, y_m, right_m, left_m });
            }
        }
        let mut rows = rows.to_vec();
        rows.dedup_by(|a, b| a[..2] == b[..2]);
        if rows.len() > 1 && rows[0][..2] == rows[rows.len() - 1][..2] {
            rows.pop();
        }
        if rows.len() < FEWEST {
            return Err(DrivingError::TooShort { got: rows.len(), needed: FEWEST });
        }
        let n = rows.len();
        let mut knots = vec![0.0];
        for i in 0..n {
            let next = rows[(i + 1) % n];
            knots.push(knots[i] + (next[0] - rows[i][0]).hypot(next[1] - rows[i][1]));
        }
        let column = |k: usize| rows.iter().map(|row| row[k]).collect::<Vec<f64>>();
        let (x, y) = (column(0), column(1));
        let (x, y) = (ClosedSpline::new(&knots, &x), ClosedSpline::new(&knots, &y));
        Ok(Self::resampled(&rows, &knots, &x, &y))
    }

    /// Evenly by arc length, which differs from the knots' chords.
    fn resampled(rows: &[[f64; 4]], knots: &[f64], x: &ClosedSpline<'_>, y: &ClosedSpline<'_>) -> Self {
        const FINE: usize = 8;
        let n = rows.len();
        let fine = (POINTS * 2 / n).max(FINE);
        let mut places = Vec::with_capacity(n * fine + 1);
        let (mut length_m, mut last) = (0.0, (rows[0][0], rows[0][1]));
        for k in 0..=n * fine {
            let i = (k / fine).min(n - 1);
            let s = knots[i] + (knots[i + 1] - knots[i]) * (k - i * fine) as f64 / fine as f64;
            let here = (x.at(i, s).0, y.at(i, s).0);
            length_m += (here.0 - last.0).hypot(here.1 - last.1);
            last = here;
            places.push((length_m, i, s));
        }
        let step_m = length_m / POINTS as f64;
        let mut at = 0;
        let points = (0..POINTS).map(|k| {
            let target = k as f64 * step_m;
            while at + 2 < places.len() && places[at + 1].0 <= target {
                at += 1;
            }
            let (from, to) = (places[at], places[at + 1]);
            let share = (target - from.0) / (to.0 - from.0).max(f64::MIN_POSITIVE);
            // Two fine points lie in one segment, or the second on its end.
            let i = from.1;
            let end = if to.1 == i { to.2 } else { knots[i + 1] };
            let s = from.2 + share * (end - from.2);
            let ((x_m, dx, ddx), (y_m, dy, ddy)) = (x.at(i, s), y.at(i, s));
            let along = (s - knots[i]) / (knots[i + 1] - knots[i]);
            let width = |c: usize| rows[i][c] + along * (rows[(i + 1) % n][c] - rows[i][c]);
            TrackPoint {
                x_m,
                y_m,
                heading_rad: dy.atan2(dx),
                curvature_1pm: (dx * ddy - dy * ddx) / dx.hypot(dy).powi(3),
                right_m: width(2),
                left_m: width(3),
            }
        });
        Self { points: points.collect(), step_m }
    }

    /// Length of a lap.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.step_m * self.points.len() as f64
    }

    /// Distance between two neighbours of [`Self::points`].
    #[must_use]
    pub fn step_m(&self) -> f64 {
        self.step_m
    }

    /// The line, evenly spaced.
    #[must_use]
    pub fn points(&self) -> &[TrackPoint] {
        &self.points
    }

    /// The line at a distance, which may lie beyond one lap.
    #[must_use]
    pub fn at(&self, station_m: f64) -> TrackPoint {
        let (index, share) = self.index(station_m);
        let (a, b) = (self.points[index], self.points[(index + 1) % self.points.len()]);
        let mix = |from: f64, to: f64| from + share * (to - from);
        TrackPoint {
            x_m: mix(a.x_m, b.x_m),
            y_m: mix(a.y_m, b.y_m),
            heading_rad: wrap_angle(a.heading_rad + share * wrap_angle(b.heading_rad - a.heading_rad)),
            curvature_1pm: mix(a.curvature_1pm, b.curvature_1pm),
            right_m: mix(a.right_m, b.right_m),
            left_m: mix(a.left_m, b.left_m),
        }
    }

    /// The sample before a distance, and the share of the way to the next one.
    pub(crate) fn index(&self, station_m: f64) -> (usize, f64) {
        let place = station_m / self.step_m;
        let floor = place.floor();
        ((floor as i64).rem_euclid(self.points.len() as i64) as usize, place - floor)
    }

    /// The place of a point: near `near_m` where given, else the nearest of the whole lap.
    #[must_use]
    pub fn place(&self, x_m: f64, y_m: f64, near_m: Option<f64>) -> Place {
        let mut station_m = near_m.unwrap_or_else(|| {
            let away = |p: &TrackPoint| (p.x_m - x_m).hypot(p.y_m - y_m);
            let nearest = self.points.iter().enumerate().min_by(|(_, a), (_, b)| away(a).total_cmp(&away(b)));
            nearest.map_or(0.0, |(index, _)| index as f64 * self.step_m)
        });
        let ahead = |station_m: f64| {
            let p = self.at(station_m);
            let (sin, cos) = p.heading_rad.sin_cos();
            let (dx, dy) = (x_m - p.x_m, y_m - p.y_m);
            (cos * dx + sin * dy, -sin * dx + cos * dy, p.curvature_1pm)
        };
        for _ in 0..4 {
            let (along_m, offset_m, curvature) = ahead(station_m);
            let step_m = along_m / (1.0 - offset_m * curvature).max(0.2);
            station_m += step_m;
            if step_m.abs() < 1e-4 * self.step_m {
                break;
            }
        }
        Place { station_m: station_m.rem_euclid(self.length_m()), offset_m: ahead(station_m).1 }
    }
}

/// An angle within half a turn of zero.
pub(crate) fn wrap_angle(angle_rad: f64) -> f64 {
    angle_rad - TAU * (angle_rad / TAU).round()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(points: u32, radius_m: f64) -> String {
        let row = |i: u32| {
            let p = TAU * f64::from(i) / f64::from(points);
            format!("{},{},1.0,2.0\n", radius_m * p.cos(), radius_m * p.sin())
        };
        (0..points).map(row).collect()
    }

    #[test]
    fn a_circle_has_its_length_curvature_and_places() {
        let text = format!("# a comment\nx_m,y_m,w_tr_right_m,w_tr_left_m\n{}", circle(60, 5.0));
        let track = Track::from_csv(&text).unwrap();
        approx::assert_relative_eq!(track.length_m(), TAU * 5.0, max_relative = 1e-4);
        for point in track.points() {
            approx::assert_relative_eq!(point.curvature_1pm, 0.2, max_relative = 0.01);
            assert_eq!((point.right_m, point.left_m), (1.0, 2.0));
        }
        let place = track.place(0.0, 4.5, None);
        approx::assert_relative_eq!(place.station_m, TAU * 5.0 / 4.0, max_relative = 1e-3);
        approx::assert_relative_eq!(place.offset_m, 0.5, max_relative = 1e-2);
        let near = track.place(0.0, 4.5, Some(place.station_m - 1.0));
        approx::assert_relative_eq!(near.station_m, place.station_m, max_relative = 1e-6);
    }

    #[test]
    fn bad_tables_say_where() {
        let row = Track::from_csv("1,2,3,4\n5,6,seven,8\n").unwrap_err().to_string();
        assert!(row.contains("row 2") && row.contains("seven"), "{row}");
        let width = Track::from_csv(&circle(20, 3.0).replacen("1.0", "-1.0", 1)).unwrap_err().to_string();
        assert!(width.contains("point 1") && width.contains("right -1"), "{width}");
        let short = Track::from_csv(&circle(5, 3.0)).unwrap_err().to_string();
        assert!(short.contains("at least 8"), "{short}");
        assert!(matches!(Track::from_csv(""), Err(DrivingError::TooShort { got: 0, .. })));
    }
}
