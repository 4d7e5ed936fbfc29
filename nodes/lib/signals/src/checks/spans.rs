//! The same change over a span by two ways.

use crate::{Poses, StateSequence, is_integral_of_twist, pose_delay_s};

/// Long enough that noise averages out and a delay of a localisation matters little, short enough that a drift does not.
const SPAN_S: f64 = 0.5;
/// A pause longer than this ends a span.
const PAUSE_S: f64 = 0.25;

/// A sequence cut into spans.
pub(super) struct Spans<'a> {
    sequence: &'a StateSequence,
    poses: Poses,
    spans: Vec<(usize, usize)>,
    /// Whether the poses are nothing but the integral of the speeds.
    pub(super) poses_are_integral: bool,
}

/// The same change by two ways, and what else moves the first.
type Beside<const N: usize> = Option<(Vec<f64>, Vec<f64>, [Vec<f64>; N])>;
type Pairs = Option<(Vec<f64>, Vec<f64>)>;

impl<'a> Spans<'a> {
    pub(super) fn of(sequence: &'a StateSequence) -> Self {
        let t = &sequence.time_s;
        let mut spans = Vec::new();
        let mut from = 0;
        for k in 1..t.len() {
            if f64::from(t[k] - t[k - 1]) > PAUSE_S {
                from = k;
            } else if f64::from(t[k] - t[from]) >= SPAN_S {
                spans.push((from, k));
                from = k;
            }
        }
        let mut poses = sequence.poses();
        // A localisation says where the car was.
        let delay_s = pose_delay_s(sequence, &poses).map_or(0.0, |(delay_s, _)| delay_s);
        poses.time_s.iter_mut().for_each(|t| *t -= delay_s);
        Self { sequence, poses, spans, poses_are_integral: is_integral_of_twist(sequence) }
    }

    /// Integral of a channel over a span, by the trapezoid.
    fn integral(&self, channel: &[f32], (from, to): (usize, usize)) -> f64 {
        let t = &self.sequence.time_s;
        (from..to).map(|k| 0.5 * f64::from(channel[k] + channel[k + 1]) * f64::from(t[k + 1] - t[k])).sum()
    }

    /// The integral of a product of channels.
    fn integral_of(&self, f: impl Fn(usize) -> f64, (from, to): (usize, usize)) -> f64 {
        let t = &self.sequence.time_s;
        (from..to).map(|k| 0.5 * (f(k) + f(k + 1)) * f64::from(t[k + 1] - t[k])).sum()
    }

    fn duration_s(&self, (from, to): (usize, usize)) -> f64 {
        f64::from(self.sequence.time_s[to] - self.sequence.time_s[from])
    }

    /// Pairs over all spans; `None` where a way is not recorded, or the first one is nothing throughout.
    fn pairs(&self, recorded: bool, both: impl Fn((usize, usize)) -> Option<(f64, f64)>) -> Pairs {
        let pairs: Vec<(f64, f64)> =
            if recorded { self.spans.iter().filter_map(|&span| both(span)).collect() } else { Vec::new() };
        (pairs.len() >= 20 && pairs.iter().any(|p| p.0 != 0.0)).then(|| pairs.into_iter().unzip())
    }

    /// The pose at a time, between its neighbours; `None` where they are far apart.
    fn pose(&self, time_s: f64) -> Option<[f64; 3]> {
        let p = &self.poses;
        let k = p.time_s.partition_point(|&t| t <= time_s).clamp(1, p.time_s.len().checked_sub(1)?.max(1));
        let (a, b) = (*p.time_s.get(k - 1)?, *p.time_s.get(k)?);
        if b - a > PAUSE_S || time_s < a - 1e-6 || time_s > b + 1e-6 {
            return None;
        }
        let share = (time_s - a) / (b - a);
        Some([&p.x_m, &p.y_m, &p.yaw_rad].map(|v| v[k - 1] + (v[k] - v[k - 1]) * share))
    }

    fn ends(&self, (from, to): (usize, usize)) -> Option<[[f64; 3]; 2]> {
        let t = &self.sequence.time_s;
        Some([self.pose(t[from].into())?, self.pose(t[to].into())?])
    }

    /// The turn by the yaw rate and by the heading over so many spans in a row, beginning at each.
    pub(super) fn turns(&self, in_a_row: usize) -> Pairs {
        let rows: Vec<(f64, f64)> = self
            .spans
            .windows(if self.poses.time_s.is_empty() { usize::MAX } else { in_a_row })
            .filter(|w| w.windows(2).all(|two| two[0].1 == two[1].0))
            .filter_map(|w| {
                let span = (w[0].0, w[w.len() - 1].1);
                let [a, b] = self.ends(span)?;
                Some((self.integral(&self.sequence.yaw_rate_radps, span), b[2] - a[2]))
            })
            .collect();
        (rows.len() >= 20 && rows.iter().any(|p| p.0 != 0.0)).then(|| rows.into_iter().unzip())
    }

    pub(super) fn gyro(&self) -> Pairs {
        let gyro = &self.sequence.gyro_yaw_rate_radps;
        self.pairs(!gyro.is_empty(), |span| {
            Some((self.integral(&self.sequence.yaw_rate_radps, span), self.integral(gyro, span)))
        })
    }

    pub(super) fn ways(&self) -> Pairs {
        let s = self.sequence;
        self.pairs(!self.poses.time_s.is_empty(), |span| {
            let [a, b] = self.ends(span)?;
            // The way is the arc, and poses give its chord; against the heading it counts backwards.
            let half = 0.5 * (b[2] - a[2]).abs();
            let arc = if half > 1e-3 { half / half.sin() } else { 1.0 };
            let (sin, cos) = (0.5 * (a[2] + b[2])).sin_cos();
            let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
            let way = dx.hypot(dy) * arc.clamp(1.0, 2.0) * (cos * dx + sin * dy).signum();
            let speed = |k: usize| {
                let (v_x, v_y) = (f64::from(s.v_x_mps[k]), f64::from(s.v_y_mps[k]));
                v_x.hypot(v_y) * v_x.signum()
            };
            Some((self.integral_of(speed, span), way))
        })
    }

    /// The sideways way by the pose and by v_y, and the turn: v_y may be of another point than the pose.
    pub(super) fn sideways(&self) -> Beside<1> {
        let s = self.sequence;
        let rows = self.rows(!self.poses.time_s.is_empty() && s.has_v_y(), |span| {
            let [a, b] = self.ends(span)?;
            let t = &s.time_s;
            let middle = 0.5 * (a[2] + b[2]);
            let (sin, cos) = middle.sin_cos();
            let moved = -sin * (b[0] - a[0]) + cos * (b[1] - a[1]);
            // What v_x alone moves sideways, seen from the middle heading.
            let mut by_speed = 0.0;
            let mut by_slip = 0.0;
            for k in span.0..span.1 {
                let dt = f64::from(t[k + 1] - t[k]);
                let heading = 0.5 * (self.pose(t[k].into())?[2] + self.pose(t[k + 1].into())?[2]) - middle;
                by_speed += 0.5 * f64::from(s.v_x_mps[k] + s.v_x_mps[k + 1]) * dt * heading.sin();
                by_slip += 0.5 * f64::from(s.v_y_mps[k] + s.v_y_mps[k + 1]) * dt * heading.cos();
            }
            Some([moved - by_speed, by_slip, b[2] - a[2]])
        })?;
        let column = |j: usize| rows.iter().map(|r| r[j]).collect::<Vec<_>>();
        Some((column(0), column(1), [column(2)]))
    }

    /// Numbers of every span; `None` where a way is not recorded.
    fn rows<const N: usize>(
        &self,
        recorded: bool,
        of: impl Fn((usize, usize)) -> Option<[f64; N]>,
    ) -> Option<Vec<[f64; N]>> {
        let rows: Vec<[f64; N]> =
            if recorded { self.spans.iter().filter_map(|&span| of(span)).collect() } else { Vec::new() };
        (rows.len() >= 20).then_some(rows)
    }

    /// a_y and what the motion takes, and the turning's change: the inertial unit may sit ahead of the point of v_y.
    pub(super) fn lateral_forces(&self) -> Beside<1> {
        let s = self.sequence;
        let rows = self.rows(!s.a_y_mps2.is_empty(), |span| {
            let turning = |k: usize| f64::from(s.v_x_mps[k]) * f64::from(s.yaw_rate_radps[k]);
            let duration_s = self.duration_s(span);
            let change = |v: &[f32]| f64::from(v[span.1] - v[span.0]) / duration_s;
            Some([
                self.integral(&s.a_y_mps2, span) / duration_s,
                self.integral_of(turning, span) / duration_s + change(&s.v_y_mps),
                change(&s.yaw_rate_radps),
            ])
        })?;
        let column = |j: usize| rows.iter().map(|r| r[j]).collect::<Vec<_>>();
        Some((column(0), column(1), [column(2)]))
    }

    pub(super) fn forward_forces(&self) -> Pairs {
        let s = self.sequence;
        self.pairs(!s.a_x_mps2.is_empty(), |span| {
            let turning = |k: usize| f64::from(s.v_y_mps[k]) * f64::from(s.yaw_rate_radps[k]);
            let change = f64::from(s.v_x_mps[span.1] - s.v_x_mps[span.0]);
            let duration_s = self.duration_s(span);
            Some((
                self.integral(&s.a_x_mps2, span) / duration_s,
                (change - self.integral_of(turning, span)) / duration_s,
            ))
        })
    }

    /// The change of v_y and what a_y leaves for it; and the turning (an accelerometer's scale, a body's roll), its change (the unit's place), and that of the
    /// steering; over so many spans in a row, beginning at each.
    ///
    /// v_y' = a_y - v_x r is weighed with a function w that rises from nothing and falls back to it (modulating functions: Shinbrot, NACA TN 3288 (1954)): the
    /// integral of w v_y' is that of -w' v_y, the mean of the second half less that of the first, and no single sample's noise is in it.
    pub(super) fn slipping(&self, in_a_row: usize) -> Beside<3> {
        let s = self.sequence;
        if s.a_y_mps2.is_empty() || !s.has_v_y() {
            return None;
        }
        let turning = |k: usize| f64::from(s.v_x_mps[k]) * f64::from(s.yaw_rate_radps[k]);
        let rows: Vec<[f64; 5]> = self
            .spans
            .windows(in_a_row)
            .filter(|spans| spans.windows(2).all(|two| two[0].1 == two[1].0))
            .map(|spans| {
                let span = (spans[0].0, spans[in_a_row - 1].1);
                let turned = self.weighed(turning, span);
                [
                    self.change(&s.v_y_mps, span),
                    self.weighed(|k| f64::from(s.a_y_mps2[k]), span) - turned,
                    turned,
                    self.change(&s.yaw_rate_radps, span),
                    self.change(&s.steering_rad, span),
                ]
            })
            .collect();
        let column = |j: usize| rows.iter().map(|r| r[j]).collect::<Vec<_>>();
        (rows.len() >= 20).then(|| (column(0), column(1), [column(2), column(3), column(4)]))
    }

    /// Steps of a span: the middle of each as a share of the half span from its middle, -1 to 1, and its length, s.
    fn steps(&self, (from, to): (usize, usize)) -> impl Iterator<Item = (usize, f64, f64)> {
        let t = &self.sequence.time_s;
        let (middle_s, half_s) = (f64::from(t[from] + t[to]) / 2.0, f64::from(t[to] - t[from]) / 2.0);
        (from..to).map(move |k| {
            let at_s = f64::from(t[k] + t[k + 1]) / 2.0;
            (k, (at_s - middle_s) / half_s, f64::from(t[k + 1] - t[k]))
        })
    }

    /// The integral of a series over a span, weighed by a triangle.
    fn weighed(&self, series: impl Fn(usize) -> f64, span: (usize, usize)) -> f64 {
        self.steps(span)
            .map(|(k, share, dt_s)| (1.0 - share.abs()) * 0.5 * (series(k) + series(k + 1)) * dt_s)
            .sum()
    }

    /// The same of a series' derivative: its mean over the second half less that over the first.
    fn change(&self, series: &[f32], span: (usize, usize)) -> f64 {
        let half_s = 0.5 * self.duration_s(span);
        self.steps(span)
            .map(|(k, share, dt_s)| {
                share.signum() * 0.5 * f64::from(series[k] + series[k + 1]) * dt_s / half_s
            })
            .sum()
    }

    pub(super) fn steering(&self) -> Pairs {
        let s = self.sequence;
        let commanded = !s.command_steering_rad.is_empty();
        self.pairs(commanded && !s.measured_steering_rad.is_empty(), |span| {
            let duration_s = self.duration_s(span);
            Some((
                self.integral(&s.measured_steering_rad, span) / duration_s,
                self.integral(&s.steering_rad, span) / duration_s,
            ))
        })
    }

    /// The steering and the curvature's angle L r / v_x, at spans in which the car moves.
    pub(super) fn curvature(&self, wheelbase_m: f64) -> Pairs {
        const SLOW_MPS: f64 = 0.5;
        let s = self.sequence;
        self.pairs(true, |span| {
            let duration_s = self.duration_s(span);
            let v_mps = self.integral(&s.v_x_mps, span) / duration_s;
            let turned = self.integral(&s.yaw_rate_radps, span) / duration_s;
            (v_mps.abs() > SLOW_MPS)
                .then(|| (self.integral(&s.steering_rad, span) / duration_s, wheelbase_m * turned / v_mps))
        })
    }
}
