//! Forward by the filter, back by the smoother.

use gripsight_signals::{StateSequence, is_dead_reckoning, pose_delay_s};
use nalgebra::SMatrix;
use serde::Serialize;

use crate::error::StateError;
use crate::events::events;
use crate::filter::{Filter, JUMP_POSES, Motion, Update};
use crate::levels::Levels;
use crate::state::{ARM, B_R, B_X, B_Y, LATE, Matrix, N, PSI, RATE, SCALE, TILT, V_X, Vector, X, Y, between};

/// What the recording says of the motion at every sample.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Smoothed {
    /// How noisy each sensor was taken to be.
    pub levels: Levels,
    /// v_x, v_y and yaw rate with their covariance, one for each sample.
    pub motion: Vec<Motion>,
    /// How late the poses are, with its standard deviation; `None` where nothing tells (taken as zero).
    pub pose_delay_s: Option<(f64, f64)>,
    /// Whether poses were used; wheel odometry's are not.
    pub poses_used: bool,
    /// Times at which the localisation jumped.
    pub jumps_s: Vec<f64>,
    /// Observations that contradicted the rest and were left out.
    pub left_out: usize,
    /// Bias of the yaw rate, with its standard deviation.
    pub yaw_rate_bias_radps: (f64, f64),
    /// Biases of the accelerations, forward and to the left.
    pub acceleration_bias_mps2: [(f64, f64); 2],
    /// How far ahead of the point of the poses the inertial unit sits.
    pub imu_arm_m: (f64, f64),
    /// Scale of the reported speed: reported over true, less one.
    pub v_x_scale: (f64, f64),
    /// Scale of the yaw rate: reported over true, less one.
    pub yaw_rate_scale: (f64, f64),
    /// Scale of the lateral acceleration: reported over true, less one. A body that rolls adds to it.
    pub a_y_scale: (f64, f64),
}

/// A time of observations, as the way back needs it.
struct Step {
    time_s: f64,
    /// From the step before to this one.
    transition: Matrix,
    /// What the observations did, in their order.
    updates: Vec<Update>,
    /// What is known after them.
    known: Known,
}

/// The motion at a step and its rows of the covariance.
struct Known {
    motion: Motion,
    rows: SMatrix<f64, 3, N>,
}

impl Known {
    fn of(time_s: f64, filter: &Filter) -> Self {
        let rows = SMatrix::from_fn(|i, j| filter.p[(Motion::PLACES[i], j)]);
        Self { motion: Motion::of(time_s, &filter.s, &filter.p), rows }
    }
}

/// Poses that a beginning needs.
const LEAST_POSES: usize = 8;

/// Estimates the motion at every sample of a sequence from all its channels but v_y, without any tire model.
///
/// # Errors
/// [`StateError`].
pub fn smooth(sequence: &StateSequence) -> Result<Smoothed, StateError> {
    sequence.check()?;
    let mut poses = sequence.poses();
    if is_dead_reckoning(sequence) {
        poses = gripsight_signals::Poses::default();
    }
    let has_speed = sequence.v_x_mps.iter().any(|&v| v != 0.0);
    if poses.time_s.is_empty() && !has_speed {
        return Err(StateError::NothingMeasured);
    }
    if !poses.time_s.is_empty() && poses.time_s.len() < LEAST_POSES {
        return Err(StateError::TooFewPoses { got: poses.time_s.len(), needed: LEAST_POSES });
    }
    let delay = pose_delay_s(sequence, &poses);
    // Without a yaw rate the delay rests on the poses alone; with one, on a fit whose spread is known.
    let late_s = delay.map_or(0.03, |(_, sigma_s)| (3.0 * sigma_s).clamp(0.005, 0.03));
    let mut in_time = poses.clone();
    in_time.time_s.iter_mut().for_each(|t| *t -= delay.map_or(0.0, |d| d.0));
    let levels = Levels { late_s, ..Levels::of(sequence, &in_time) };
    let mut filter = Filter::new(levels);
    begin(&mut filter, sequence, &poses);
    let events = events(sequence, &poses, delay.map_or(0.0, |d| d.0));
    let mut steps: Vec<Step> = Vec::with_capacity(sequence.len() + poses.time_s.len());
    let mut place = 0;
    while place < events.len() {
        let time_s = events[place].0;
        let transition = filter.advance(time_s);
        let mut updates = Vec::new();
        while place < events.len() && events[place].0 - time_s < 1e-6 {
            filter.observe(&events[place].1, &mut |update| updates.push(update));
            place += 1;
        }
        if !(filter.s.iter().all(|v| v.is_finite()) && filter.p.diagonal().iter().all(|v| *v >= 0.0)) {
            return Err(StateError::Diverged { time_s });
        }
        steps.push(Step { time_s, transition, updates, known: Known::of(time_s, &filter) });
    }
    // Where jumps hold more poses than not, what the filter makes of them is no motion.
    let jumps = filter.jumps_s.len();
    if 2 * JUMP_POSES * jumps > poses.time_s.len() && jumps > 1 {
        return Err(StateError::Contradicted { jumps, poses: poses.time_s.len() });
    }
    if steps.is_empty() {
        return Err(StateError::NothingMeasured);
    }
    back(&mut steps)?;
    let of = |i: usize| (filter.s[i], filter.p[(i, i)].max(0.0).sqrt());
    let times: Vec<f64> = sequence.time_s.iter().map(|&t| f64::from(t)).collect();
    let motion = times
        .iter()
        .map(|&t| {
            let k = steps.partition_point(|s| s.time_s < t - 1e-6).min(steps.len() - 1);
            let mut motion = Motion { time_s: t, ..steps[k].known.motion };
            if poses.time_s.is_empty() {
                // Without a pose nothing tells where the inertial unit sits, and v_y is that of its place: what the filter makes of the products
                // of unknowns is not knowledge.
                motion.covariance[1][1] += (levels.arm_m * motion.yaw_rate_radps).powi(2);
            }
            motion
        })
        .collect();
    Ok(Smoothed {
        levels,
        motion,
        pose_delay_s: delay.map(|(delay_s, _)| (delay_s + of(LATE).0, of(LATE).1)),
        poses_used: !poses.time_s.is_empty(),
        jumps_s: filter.jumps_s.clone(),
        left_out: filter.left_out,
        yaw_rate_bias_radps: of(B_R),
        acceleration_bias_mps2: [of(B_X), of(B_Y)],
        imu_arm_m: of(ARM),
        v_x_scale: of(SCALE),
        yaw_rate_scale: of(RATE),
        a_y_scale: of(TILT),
    })
}

/// Where the first pose and the first speed lie: an extended filter needs to begin near the truth.
fn begin(filter: &mut Filter, sequence: &StateSequence, poses: &gripsight_signals::Poses) {
    if let (Some(&x), Some(&y), Some(&psi)) = (poses.x_m.first(), poses.y_m.first(), poses.yaw_rad.first()) {
        (filter.s[X], filter.s[Y], filter.s[PSI]) = (x, y, psi);
        let far =
            poses.time_s.iter().position(|&t| t - poses.time_s[0] >= 0.2).unwrap_or(poses.x_m.len() - 1);
        let along = (poses.x_m[far] - x) * psi.cos() + (poses.y_m[far] - y) * psi.sin();
        filter.s[V_X] = along / (poses.time_s[far] - poses.time_s[0]).max(1e-3);
    }
    if let Some(&v) = sequence.v_x_mps.first().filter(|&&v| v != 0.0) {
        filter.s[V_X] = v.into();
    }
}

/// The modified Bryson-Frazier pass, from the last step to the first: what all that comes later says of the state, as the adjoint lambda and its
/// information Lambda, goes back through every update and transition; x - P lambda and P - P Lambda P are the smoothed state and its covariance.
/// The same as Rauch, Tung and Striebel's pass, without the inverse of a covariance at every step.
fn back(steps: &mut [Step]) -> Result<(), StateError> {
    let (mut adjoint, mut information) = (Vector::zeros(), Matrix::zeros());
    for step in steps.iter_mut().rev() {
        let Known { motion, rows } = &mut step.known;
        let by = *rows * adjoint;
        let covariance = *rows * information * rows.transpose();
        motion.v_x_mps -= by[0];
        motion.v_y_mps -= by[1];
        motion.yaw_rate_radps -= by[2];
        for i in 0..3 {
            for j in 0..3 {
                motion.covariance[i][j] -= covariance[(i, j)];
            }
        }
        if !(by.iter().chain(covariance.iter()).all(|v| v.is_finite())) {
            return Err(StateError::Diverged { time_s: step.time_s });
        }
        for update in step.updates.iter().rev() {
            before(update, &mut adjoint, &mut information);
        }
        adjoint = step.transition.tr_mul(&adjoint);
        information = between(&information, &step.transition);
    }
    Ok(())
}

/// Takes adjoint and information from after an update to before it.
fn before(update: &Update, adjoint: &mut Vector, information: &mut Matrix) {
    match update {
        Update::One { h, gain, innovation, variance } => {
            let told = *information * gain;
            *adjoint -= h * (gain.dot(adjoint) + innovation / variance);
            let own = h * (gain.dot(&told) + 1.0 / variance) - told;
            information.ger(1.0, &own, h, 1.0);
            information.ger(-1.0, h, &told, 1.0);
        }
        Update::Pose(pose) => {
            let told = *information * pose.gain;
            *adjoint -= pose.h.tr_mul(&(pose.gain.tr_mul(adjoint) + pose.inverse * pose.innovation));
            let own = pose.h.tr_mul(&(pose.gain.tr_mul(&told) + pose.inverse)) - told;
            *information += own * pose.h - pose.h.tr_mul(&told.transpose());
        }
        // What lies beyond a jump says nothing of what began anew there.
        Update::Anew(states) => {
            adjoint.rows_mut(0, *states).fill(0.0);
            information.rows_mut(0, *states).fill(0.0);
            information.columns_mut(0, *states).fill(0.0);
        }
    }
}

/// The sequence with v_y (and v_x and yaw rate where nothing measures them) as the smoother gives them.
#[must_use]
pub fn filled(sequence: &StateSequence, smoothed: &Smoothed) -> StateSequence {
    let mut out = sequence.clone();
    let column = |f: &dyn Fn(&Motion) -> f64| smoothed.motion.iter().map(|m| f(m) as f32).collect::<Vec<_>>();
    let silent = |values: &[f32]| values.iter().all(|&v| v == 0.0);
    out.v_y_mps = column(&|m| m.v_y_mps);
    if silent(&out.v_x_mps) {
        out.v_x_mps = column(&|m| m.v_x_mps);
    }
    if silent(&out.yaw_rate_radps) {
        out.yaw_rate_radps = column(&|m| m.yaw_rate_radps);
    }
    out
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng as _;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution as _, Normal};

    use super::*;

    /// Five seconds of a car that weaves, seen by noisy sensors.
    fn weaving() -> StateSequence {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        // Within two standard deviations: nothing is to be left out.
        let normal = Normal::new(0.0_f64, 1.0).unwrap();
        let mut noisy =
            |value: f64, sigma: f64| (value + sigma * normal.sample(&mut random).clamp(-2.0, 2.0)) as f32;
        let mut s = StateSequence::default();
        let (mut x, mut y, mut yaw) = (0.0_f64, 0.0_f64, 0.0_f64);
        for k in 0..500 {
            let t = f64::from(k) * 0.01;
            let (v, r) = (5.0 + (0.5 * t).sin(), (2.0 * t).sin());
            s.time_s.push(t as f32);
            s.v_x_mps.push(noisy(v, 0.02));
            s.v_y_mps.push(0.0);
            s.yaw_rate_radps.push(noisy(r, 0.01));
            s.steering_rad.push(0.0);
            s.a_x_mps2.push(noisy(0.5 * (0.5 * t).cos(), 0.2));
            s.a_y_mps2.push(noisy(v * r, 0.2));
            if k % 3 == 0 {
                s.pose_time_s.push(t as f32);
                s.pose_x_m.push(noisy(x, 0.02));
                s.pose_y_m.push(noisy(y, 0.02));
                s.pose_yaw_rad.push(noisy(yaw, 0.01));
            }
            x += v * yaw.cos() * 0.01;
            y += v * yaw.sin() * 0.01;
            yaw += r * 0.01;
        }
        s
    }

    /// Where nothing contradicts, the pass gives what Rauch, Tung and Striebel's does (AIAA Journal 3 (1965), 1445-1450).
    #[test]
    fn the_way_back_is_the_smoother_of_rauch_tung_and_striebel() {
        let sequence = weaving();
        let smoothed = smooth(&sequence).unwrap();
        assert_eq!((smoothed.left_out, smoothed.jumps_s.len()), (0, 0));

        let poses = sequence.poses();
        let mut filter = Filter::new(smoothed.levels);
        begin(&mut filter, &sequence, &poses);
        let delay_s = pose_delay_s(&sequence, &poses).map_or(0.0, |d| d.0);
        type Estimate = (Vector, Matrix);
        let mut forward: Vec<(f64, Matrix, [Estimate; 2])> = Vec::new();
        for (time_s, observation) in events(&sequence, &poses, delay_s) {
            let transition = filter.advance(time_s);
            let predicted = (filter.s, filter.p);
            filter.observe(&observation, &mut |_| ());
            forward.push((time_s, transition, [predicted, (filter.s, filter.p)]));
        }
        let mut later = (filter.s, filter.p);
        for k in (0..forward.len()).rev() {
            if let Some((_, transition, [(s, p), _])) = forward.get(k + 1) {
                let known = forward[k].2[1];
                let gain = known.1 * transition.transpose() * p.try_inverse().unwrap();
                later = (known.0 + gain * (later.0 - s), known.1 + gain * (later.1 - p) * gain.transpose());
            }
            let motion = Motion::of(forward[k].0, &later.0, &later.1);
            let at = smoothed.motion.iter().find(|m| (m.time_s - motion.time_s).abs() < 1e-6);
            let Some(at) = at else { continue };
            approx::assert_abs_diff_eq!(at.v_x_mps, motion.v_x_mps, epsilon = 1e-5);
            approx::assert_abs_diff_eq!(at.v_y_mps, motion.v_y_mps, epsilon = 1e-5);
            approx::assert_abs_diff_eq!(at.yaw_rate_radps, motion.yaw_rate_radps, epsilon = 1e-5);
            approx::assert_relative_eq!(at.v_y_sigma_mps(), motion.v_y_sigma_mps(), max_relative = 1e-4);
        }
    }
}
