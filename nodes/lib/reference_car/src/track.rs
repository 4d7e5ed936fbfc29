//! Closed tracks as smooth curves, and the place of a car on them.
//!
//! A track is a radius given as a Fourier series of the polar angle, `R(p) = a (1 + sum_k c_k cos(k p) + s_k sin(k p))`,
//! sampled by arc length: closed, smooth and free of corners with infinite curvature. Distances are along the centre
//! line; offsets are positive to the left of the driving direction.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

use crate::error::ReferenceCarError;

/// Names of the closed tracks.
pub const TRACK_NAMES: [&str; 17] = [
    "oval", "club", "esses", "bean", "clover", "harbor", "valley", "quarry", "delta", "lagoon", "ridge",
    "basin", "summit", "meadow", "canyon", "plateau", "marsh",
];

/// A closed centre line, sampled evenly by arc length.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    points: Vec<TrackPoint>,
    step_m: f64,
    half_width_m: f64,
}

/// A point of the centre line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TrackPoint {
    /// Position.
    pub x_m: f64,
    /// Position.
    pub y_m: f64,
    /// Heading of the tangent, not wrapped along the lap.
    pub heading_rad: f64,
    /// Curvature, positive to the left.
    pub curvature_1pm: f64,
}

/// A place relative to the centre line.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TrackPosition {
    /// Distance along the centre line in this lap.
    pub station_m: f64,
    /// Distance to the left of it.
    pub offset_m: f64,
}

struct Shape {
    size_m: f64,
    cosines: &'static [(u8, f64)],
    sines: &'static [(u8, f64)],
}

fn shape(name: &str) -> Option<Shape> {
    let shape = match name {
        "oval" => Shape { size_m: 190.0, cosines: &[(2, 0.33)], sines: &[] },
        "club" => Shape { size_m: 200.0, cosines: &[(2, 0.25), (3, 0.12)], sines: &[(1, 0.1), (4, 0.05)] },
        "esses" => Shape { size_m: 230.0, cosines: &[(2, 0.22), (7, 0.035)], sines: &[(3, 0.1), (5, 0.05)] },
        "bean" => Shape { size_m: 210.0, cosines: &[(1, 0.32), (2, -0.24)], sines: &[(3, 0.08)] },
        "clover" => Shape { size_m: 220.0, cosines: &[(3, 0.24), (2, 0.1)], sines: &[(5, 0.04)] },
        "harbor" => Shape { size_m: 205.0, cosines: &[(2, 0.2), (4, 0.05)], sines: &[(1, 0.15), (3, 0.1)] },
        "valley" => Shape { size_m: 225.0, cosines: &[(1, 0.2), (3, 0.12)], sines: &[(2, 0.18), (5, 0.02)] },
        "quarry" => Shape { size_m: 215.0, cosines: &[(2, 0.12), (3, 0.14)], sines: &[(1, 0.18), (4, 0.04)] },
        "delta" => Shape { size_m: 200.0, cosines: &[(1, 0.12), (5, 0.03)], sines: &[(2, 0.2), (3, 0.12)] },
        "lagoon" => Shape { size_m: 210.0, cosines: &[(1, 0.15), (4, 0.06)], sines: &[(2, 0.14), (3, 0.13)] },
        "ridge" => Shape { size_m: 220.0, cosines: &[(2, 0.24), (5, 0.04)], sines: &[(1, 0.12), (3, -0.11)] },
        "basin" => Shape { size_m: 195.0, cosines: &[(2, 0.16), (3, -0.13)], sines: &[(1, 0.1), (4, 0.07)] },
        "summit" => Shape { size_m: 230.0, cosines: &[(1, 0.22), (4, -0.05)], sines: &[(2, 0.1), (3, 0.14)] },
        "meadow" => Shape { size_m: 205.0, cosines: &[(1, 0.1), (2, 0.21)], sines: &[(3, -0.12), (4, 0.05)] },
        "canyon" => {
            Shape { size_m: 220.0, cosines: &[(2, -0.14), (3, 0.1), (5, 0.03)], sines: &[(1, 0.2), (2, 0.1)] }
        }
        "plateau" => {
            Shape { size_m: 215.0, cosines: &[(1, 0.18), (3, -0.1)], sines: &[(2, -0.16), (4, 0.04)] }
        }
        "marsh" => {
            Shape { size_m: 200.0, cosines: &[(2, 0.18), (4, -0.04)], sines: &[(1, -0.14), (3, 0.12)] }
        }
        _ => return None,
    };
    Some(shape)
}

impl Track {
    /// A built-in track, scaled (1 is full size), driven anticlockwise or, `reversed`, clockwise.
    ///
    /// # Errors
    /// `UnknownName` with the names that exist, `InvalidParameter` for a scale that is not above zero.
    pub fn by_name(name: &str, scale: f64, reversed: bool) -> Result<Self, ReferenceCarError> {
        if !(scale.is_finite() && scale > 0.0) {
            return Err(ReferenceCarError::InvalidParameter {
                name: "track scale".to_owned(),
                value: scale,
                expected: "a finite number above zero",
            });
        }
        let shape = shape(name).ok_or_else(|| ReferenceCarError::UnknownName {
            kind: "track",
            name: name.to_owned(),
            known: TRACK_NAMES.join(", "),
        })?;
        let direction = if reversed { -1.0 } else { 1.0 };
        let curve = |u: f64| {
            let p = direction * u;
            let wave: f64 = shape.cosines.iter().map(|&(k, c)| c * (f64::from(k) * p).cos()).sum::<f64>()
                + shape.sines.iter().map(|&(k, s)| s * (f64::from(k) * p).sin()).sum::<f64>();
            let radius = shape.size_m * scale * (1.0 + wave);
            (radius * p.cos(), radius * p.sin())
        };
        Ok(Self::from_curve(curve, 7.0 * scale))
    }

    /// A circle of radius `radius_m`, anticlockwise or, `reversed`, clockwise.
    pub fn circle(radius_m: f64, reversed: bool) -> Self {
        let direction = if reversed { -1.0 } else { 1.0 };
        Self::from_curve(|u| (radius_m * u.cos(), direction * radius_m * u.sin()), radius_m * 0.5)
    }

    fn from_curve(curve: impl Fn(f64) -> (f64, f64), half_width_m: f64) -> Self {
        const FINE: u32 = 8192;
        const POINTS: u32 = 2048;
        let fine: Vec<(f64, f64)> = (0..=FINE).map(|i| curve(TAU * f64::from(i) / f64::from(FINE))).collect();
        let mut distance = vec![0.0];
        let mut total = 0.0;
        for pair in fine.windows(2) {
            total += (pair[1].0 - pair[0].0).hypot(pair[1].1 - pair[0].1);
            distance.push(total);
        }
        let step_m = total / f64::from(POINTS);
        let mut segment = 0;
        let positions: Vec<(f64, f64)> = (0..POINTS)
            .map(|i| {
                let target = f64::from(i) * step_m;
                while segment + 2 < distance.len() && distance[segment + 1] <= target {
                    segment += 1;
                }
                let share = (target - distance[segment]) / (distance[segment + 1] - distance[segment]);
                curve(TAU * (segment as f64 + share) / f64::from(FINE))
            })
            .collect();
        Self { points: with_tangents(&positions, step_m), step_m, half_width_m }
    }

    /// Length of a lap.
    pub fn length_m(&self) -> f64 {
        self.step_m * self.points.len() as f64
    }

    /// Half of the drivable width.
    pub fn half_width_m(&self) -> f64 {
        self.half_width_m
    }

    /// The centre line, evenly spaced.
    pub fn points(&self) -> &[TrackPoint] {
        &self.points
    }

    /// Distance between two neighbours of [`Self::points`].
    pub fn step_m(&self) -> f64 {
        self.step_m
    }

    /// The centre line at a distance, which may lie beyond one lap.
    pub fn at(&self, station_m: f64) -> TrackPoint {
        let count = self.points.len();
        let place = station_m / self.step_m;
        let floor = place.floor();
        let share = place - floor;
        let index = (floor as i64).rem_euclid(count as i64) as usize;
        let (a, b) = (self.points[index], self.points[(index + 1) % count]);
        let turn = wrap_angle(b.heading_rad - a.heading_rad);
        let mix = |from: f64, to: f64| from + share * (to - from);
        TrackPoint {
            x_m: mix(a.x_m, b.x_m),
            y_m: mix(a.y_m, b.y_m),
            heading_rad: a.heading_rad + share * turn,
            curvature_1pm: mix(a.curvature_1pm, b.curvature_1pm),
        }
    }

    /// The place of a point, searched near `near_m`.
    pub fn project(&self, x_m: f64, y_m: f64, near_m: f64) -> TrackPosition {
        let mut station_m = near_m;
        for _ in 0..3 {
            let point = self.at(station_m);
            let (sin, cos) = point.heading_rad.sin_cos();
            let (dx, dy) = (x_m - point.x_m, y_m - point.y_m);
            let offset_m = -sin * dx + cos * dy;
            let stretch = (1.0 - offset_m * point.curvature_1pm).max(0.2);
            let step = (cos * dx + sin * dy) / stretch;
            station_m += step;
            if step.abs() < 1e-4 * self.step_m {
                break;
            }
        }
        let point = self.at(station_m);
        let (sin, cos) = point.heading_rad.sin_cos();
        TrackPosition {
            station_m: station_m.rem_euclid(self.length_m()),
            offset_m: -sin * (x_m - point.x_m) + cos * (y_m - point.y_m),
        }
    }
}

/// An angle within half a turn of zero.
pub(crate) fn wrap_angle(angle_rad: f64) -> f64 {
    angle_rad - TAU * (angle_rad / TAU).round()
}

fn with_tangents(positions: &[(f64, f64)], step_m: f64) -> Vec<TrackPoint> {
    let count = positions.len();
    let around = |i: usize, by: usize| positions[(i + count + by - 1) % count];
    (0..count)
        .map(|i| {
            let (before, here, after) = (around(i, 0), around(i, 1), around(i, 2));
            let (dx, dy) = ((after.0 - before.0) / 2.0, (after.1 - before.1) / 2.0);
            let (ddx, ddy) = (after.0 - 2.0 * here.0 + before.0, after.1 - 2.0 * here.1 + before.1);
            TrackPoint {
                x_m: here.0,
                y_m: here.1,
                heading_rad: dy.atan2(dx),
                curvature_1pm: (dx * ddy - dy * ddx) / (step_m * step_m * step_m),
            }
        })
        .collect()
}
