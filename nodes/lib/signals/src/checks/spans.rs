//! The same change over a span by two ways.

use crate::{Poses, StateSequence};

/// Long enough that noise averages out and a delay of a localisation matters little, short enough that a drift does not.
const SPAN_S: f64 = 0.5;
/// A pause longer than this ends a span.
const PAUSE_S: f64 = 0.25;

/// A sequence cut into spans.
pub(super) struct Spans<'a> {
    sequence: &'a StateSequence,
    poses: Poses,
    spans: Vec<(usize, usize)>,
}

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
        Self { sequence, poses: sequence.poses(), spans }
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

    pub(super) fn turns(&self) -> Pairs {
        self.pairs(!self.poses.time_s.is_empty(), |span| {
            let [a, b] = self.ends(span)?;
            Some((self.integral(&self.sequence.yaw_rate_radps, span), b[2] - a[2]))
        })
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
            // The way is the arc, and poses give its chord.
            let half = 0.5 * (b[2] - a[2]).abs();
            let arc = if half > 1e-3 { half / half.sin() } else { 1.0 };
            let way = (b[0] - a[0]).hypot(b[1] - a[1]) * arc.clamp(1.0, 2.0);
            let speed = |k: usize| f64::from(s.v_x_mps[k]).hypot(s.v_y_mps[k].into());
            Some((self.integral_of(speed, span), way))
        })
    }

    pub(super) fn sideways(&self) -> Pairs {
        let s = self.sequence;
        self.pairs(!self.poses.time_s.is_empty() && s.has_v_y(), |span| {
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
            Some((by_slip, moved - by_speed))
        })
    }

    pub(super) fn lateral_forces(&self) -> Pairs {
        let s = self.sequence;
        self.pairs(!s.a_y_mps2.is_empty(), |span| {
            let turning = |k: usize| f64::from(s.v_x_mps[k]) * f64::from(s.yaw_rate_radps[k]);
            let change = f64::from(s.v_y_mps[span.1] - s.v_y_mps[span.0]);
            let duration_s = self.duration_s(span);
            Some((
                self.integral(&s.a_y_mps2, span) / duration_s,
                (self.integral_of(turning, span) + change) / duration_s,
            ))
        })
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

    pub(super) fn slipping(&self) -> Pairs {
        let s = self.sequence;
        self.pairs(!s.a_y_mps2.is_empty() && s.has_v_y(), |span| {
            let turning = |k: usize| f64::from(s.v_x_mps[k]) * f64::from(s.yaw_rate_radps[k]);
            let change = f64::from(s.v_y_mps[span.1] - s.v_y_mps[span.0]);
            Some((change, self.integral(&s.a_y_mps2, span) - self.integral_of(turning, span)))
        })
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
}
