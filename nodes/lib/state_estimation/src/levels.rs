//! How noisy each sensor is and how fast the motion changes, from the recording itself.

use gripsight_signals::{Poses, StateSequence, yaw_rates};
use serde::Serialize;

use crate::coloured::with_coloured;
use crate::state::Drive;

/// What a localisation is off by from one moment to the next in the same way: a first-order Gauss-Markov process.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Wander {
    /// Its standard deviation, m or rad.
    pub sigma: f64,
    /// Over which it forgets, s.
    pub time_s: f64,
}

/// Standard deviations of white noise, and strengths of what drives the motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Levels {
    /// Of each coordinate of a pose.
    pub position_m: f64,
    /// Of its heading.
    pub heading_rad: f64,
    /// What each coordinate of the poses is off by beside that.
    pub position_wander: Wander,
    /// What their heading is.
    pub heading_wander: Wander,
    /// Of their stamps.
    pub pose_stamp_s: f64,
    /// Of the speed.
    pub v_x_mps: f64,
    /// Of the lateral speed, where one is measured.
    pub v_y_mps: f64,
    /// Of the yaw rate.
    pub yaw_rate_radps: f64,
    /// Of the accelerations.
    pub a_x_mps2: f64,
    /// Of the accelerations.
    pub a_y_mps2: f64,
    /// How large v_y may be before anything is known of it.
    pub v_y_spread_mps: f64,
    /// How far the inertial unit may sit from the point of the poses.
    pub arm_m: f64,
    /// How well the delay of the poses is known.
    pub late_s: f64,
    /// Mean squared change of the accelerations in a second, m2/s5, and of the yaw acceleration, rad2/s5.
    pub change: [f64; 3],
}

/// Rounding and unmodelled small motion: no sensor is believed further.
const LEAST: [f64; 6] = [2e-3, 1e-3, 5e-3, 2e-3, 0.02, 0.02];

/// A lateral acceleration that may change no faster than it was seen to over a tenth of a second is followed late, and what it is late by reads as an arm of
/// the inertial unit and a delay of the poses. With 4 m2/s5 the delay scattered by 2.4 ms where 1.2 ms were claimed, with 40 to 4000 by 1.0 where 1.4 were, 0.5 ms
/// too short (example `signals delays`, full-size cars of others' plants, poses to 1 degree at 40 Hz; 3 ms too short where the turn's own change was a surprise, too).
const LEAST_CHANGE_A_Y: f64 = 40.0;

impl Levels {
    /// Looks at a sequence and its poses, whose delay is taken off.
    #[must_use]
    pub fn of(sequence: &StateSequence, poses: &Poses) -> Self {
        let wide = |values: &[f32]| values.iter().map(|&v| f64::from(v)).collect::<Vec<_>>();
        let time_s = wide(&sequence.time_s);
        let v_x = wide(&sequence.v_x_mps);
        let r = yaw_rates(sequence).map(wide).unwrap_or_default();
        let position = white_noise(&poses.x_m).max(white_noise(&poses.y_m)).max(LEAST[0]);
        let heading = white_noise(&poses.yaw_rad).max(LEAST[1]);
        let [v_x_noise, r_noise] = [white_noise(&v_x).max(LEAST[2]), white_noise(&r).max(LEAST[3])];
        let lateral: Vec<f64> = v_x.iter().zip(&r).map(|(v, r)| v * r).collect();
        let speeds: Vec<f64> = if v_x.iter().any(|&v| v != 0.0) { v_x.clone() } else { speeds(poses) };
        let typical = speeds.iter().map(|v| v.abs()).sum::<f64>() / speeds.len().max(1) as f64;
        let (change_a_y, change_alpha) = if r.is_empty() {
            // Nothing but poses: what a car does at the limit of grip, within a tenth of a second.
            (100.0, 400.0)
        } else {
            (walk(&time_s, &lateral, 1, v_x_noise.hypot(typical * r_noise)), walk(&time_s, &r, 2, r_noise))
        };
        let change_a_x =
            if v_x.iter().any(|&v| v != 0.0) { walk(&time_s, &v_x, 2, v_x_noise) } else { 100.0 };
        let levels = Self {
            position_m: position,
            heading_rad: heading,
            // Small beside the noise where nothing speaks for more, and not nothing: a covariance has to have an inverse.
            position_wander: Wander { sigma: 0.1 * position, time_s: 0.5 },
            heading_wander: Wander { sigma: 0.1 * heading, time_s: 0.5 },
            pose_stamp_s: stamp_jitter_s(&time_s, &v_x, poses, position),
            v_x_mps: v_x_noise,
            v_y_mps: white_noise(&wide(&sequence.v_y_mps)).max(LEAST[2]),
            yaw_rate_radps: r_noise,
            a_x_mps2: white_noise(&wide(&sequence.a_x_mps2)).max(LEAST[4]),
            a_y_mps2: white_noise(&wide(&sequence.a_y_mps2)).max(LEAST[5]),
            v_y_spread_mps: (0.3 * typical).max(0.1),
            late_s: 0.03,
            arm_m: 0.3 * (typical / 5.0).clamp(0.5, 5.0),
            change: [
                change_a_x.clamp(1.0, 1e4),
                change_a_y.clamp(LEAST_CHANGE_A_Y, 1e4),
                change_alpha.clamp(4.0, 1e5),
            ],
        };
        if poses.time_s.is_empty() { levels } else { with_coloured(sequence, poses, levels) }
    }

    pub(crate) fn drive(&self) -> Drive {
        let [a_x, a_y, alpha] = self.change;
        Drive { a_x, a_y, alpha, position: self.position_wander, heading: self.heading_wander }
    }
}

/// Standard deviation of the poses' stamps about the speed's clock. A stamp that is off makes the way to its pose longer by as much as it makes the next one
/// shorter: ways from pose to pose, less the speed's, that follow one another are correlated by it, beyond what the poses' own noise does, by the square of the
/// speed; a speed's own errors do not do so. Some stamps are off by far (a frame that came late): it is the mean that counts, without the fiftieth that may be
/// jumps.
fn stamp_jitter_s(time_s: &[f64], v_x: &[f64], poses: &Poses, position_m: f64) -> f64 {
    /// From one pose to the next, a way worth comparing.
    const LONGEST_S: f64 = 0.25;
    let at = |t: f64| {
        let k = time_s.partition_point(|&s| s <= t).clamp(1, time_s.len() - 1);
        let share = ((t - time_s[k - 1]) / (time_s[k] - time_s[k - 1])).clamp(0.0, 1.0);
        v_x[k - 1] + (v_x[k] - v_x[k - 1]) * share
    };
    if time_s.len() < 2 {
        return 0.0;
    }
    // How much farther than by the speed, and the speed.
    let farther = |k: usize| {
        let (from_s, to_s) = (poses.time_s[k - 1], poses.time_s[k]);
        let (sin, cos) = (0.5 * (poses.yaw_rad[k] + poses.yaw_rad[k - 1])).sin_cos();
        let along = (poses.x_m[k] - poses.x_m[k - 1]) * cos + (poses.y_m[k] - poses.y_m[k - 1]) * sin;
        let v_mps = 0.5 * (at(from_s) + at(to_s));
        (to_s - from_s < LONGEST_S).then_some((along - v_mps * (to_s - from_s), v_mps))
    };
    let ways: Vec<Option<(f64, f64)>> = (1..poses.time_s.len()).map(farther).collect();
    let mut pairs: Vec<(f64, f64)> = ways
        .windows(2)
        .filter_map(|w| {
            let [(a, v_a), (b, v_b)] = [w[0]?, w[1]?];
            Some((-a * b, (0.5 * (v_a + v_b)).powi(2)))
        })
        .collect();
    pairs.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
    pairs.truncate(pairs.len() * 49 / 50);
    let (beyond, speed2) = pairs.iter().fold((0.0, 0.0), |(a, b), p| (a + p.0 - position_m.powi(2), b + p.1));
    if speed2 > 0.0 { (beyond / speed2).max(0.0).sqrt() } else { 0.0 }
}

/// Speeds by the distance from pose to pose over a tenth of a second.
fn speeds(poses: &Poses) -> Vec<f64> {
    let n = poses.time_s.len();
    (0..n)
        .filter_map(|k| {
            let to = (k + 1..n).find(|&i| poses.time_s[i] - poses.time_s[k] >= 0.1)?;
            let distance = (poses.x_m[to] - poses.x_m[k]).hypot(poses.y_m[to] - poses.y_m[k]);
            Some(distance / (poses.time_s[to] - poses.time_s[k]))
        })
        .collect()
}

/// Standard deviation of white noise on a series, from its third differences, by their median.
pub(crate) fn white_noise(values: &[f64]) -> f64 {
    let mut differences: Vec<f64> =
        values.windows(4).map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs()).collect();
    if differences.is_empty() {
        return 0.0;
    }
    let middle = differences.len() / 2;
    // Var of a third difference of white noise is 20 times its own; the median of |x| is 0.6745 sigma.
    *differences.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.6745 / 20_f64.sqrt()
}

/// Strength of the random walk that a series (order 1) or its derivative (order 2) does, over steps of a tenth of a second, less what its own
/// noise makes.
fn walk(time_s: &[f64], values: &[f64], order: i32, noise: f64) -> f64 {
    const STEP_S: f64 = 0.1;
    let n = time_s.len().min(values.len());
    let dt_s = if n > 1 { (time_s[n - 1] - time_s[0]) / (n - 1) as f64 } else { return 0.0 };
    let stride = (STEP_S / dt_s).round().max(1.0) as usize;
    // Means over a step are less noisy than samples.
    let means: Vec<f64> =
        values[..n].chunks_exact(stride).map(|c| c.iter().sum::<f64>() / stride as f64).collect();
    let step_s = stride as f64 * dt_s;
    let noise2 = noise * noise / stride as f64;
    let squares: Vec<f64> = match order {
        1 => means.windows(2).map(|w| (w[1] - w[0]).powi(2) - 2.0 * noise2).collect(),
        _ => means
            .windows(3)
            .map(|w| ((w[2] - 2.0 * w[1] + w[0]).powi(2) - 6.0 * noise2) / (step_s * step_s))
            .collect(),
    };
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64 / step_s).max(0.0)
}
