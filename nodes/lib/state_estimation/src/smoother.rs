//! Forward by the filter, back by the smoother.

use gripsight_signals::{StateSequence, is_dead_reckoning, pose_delay_s};
use serde::Serialize;

use crate::error::StateError;
use crate::events::events;
use crate::filter::{Filter, JUMP_POSES, Motion};
use crate::levels::Levels;
use crate::state::{ARM, B_R, B_X, B_Y, LATE, Matrix, PSI, RATE, SCALE, TILT, V_X, Vector, X, Y};

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

/// Steps between which the way back needs all that is known.
struct Step {
    time_s: f64,
    /// From the step before to this one.
    transition: Matrix,
    predicted: (Vector, Matrix),
    known: (Vector, Matrix),
    /// How many of the first states began anew here: nothing of them goes back.
    anew: usize,
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
        let predicted = (filter.s, filter.p);
        let jumps = filter.jumps_s.len();
        while place < events.len() && events[place].0 - time_s < 1e-6 {
            filter.observe(&events[place].1);
            place += 1;
        }
        if !(filter.s.iter().all(|v| v.is_finite()) && filter.p.diagonal().iter().all(|v| *v >= 0.0)) {
            return Err(StateError::Diverged { time_s });
        }
        let anew = if filter.jumps_s.len() > jumps { filter.anew } else { 0 };
        steps.push(Step { time_s, transition, predicted, known: (filter.s, filter.p), anew });
    }
    // Where jumps hold more poses than not, what the filter makes of them is no motion.
    let jumps = filter.jumps_s.len();
    if 2 * JUMP_POSES * jumps > poses.time_s.len() && jumps > 1 {
        return Err(StateError::Contradicted { jumps, poses: poses.time_s.len() });
    }
    back(&mut steps)?;
    let last = steps.last().ok_or(StateError::NothingMeasured)?;
    let of = |i: usize| (last.known.0[i], last.known.1[(i, i)].max(0.0).sqrt());
    let times: Vec<f64> = sequence.time_s.iter().map(|&t| f64::from(t)).collect();
    let motion = times
        .iter()
        .map(|&t| {
            let k = steps.partition_point(|s| s.time_s < t - 1e-6).min(steps.len() - 1);
            let mut motion = Motion::of(t, &steps[k].known.0, &steps[k].known.1);
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

/// The Rauch-Tung-Striebel pass: from the last step to the first.
fn back(steps: &mut [Step]) -> Result<(), StateError> {
    for k in (0..steps.len().saturating_sub(1)).rev() {
        let (early, late) = steps.split_at_mut(k + 1);
        let (here, next) = (&mut early[k], &late[0]);
        let mut cross = here.known.1 * next.transition.transpose();
        // What lies beyond a jump says nothing of place and heading before it.
        cross.columns_mut(0, next.anew).fill(0.0);
        let mut predicted = next.predicted.1;
        let mut later = next.known;
        for i in 0..next.anew {
            for j in 0..crate::state::N {
                if i != j {
                    predicted[(i, j)] = 0.0;
                    predicted[(j, i)] = 0.0;
                    later.1[(i, j)] = 0.0;
                    later.1[(j, i)] = 0.0;
                }
            }
            later.0[i] = next.predicted.0[i];
            later.1[(i, i)] = predicted[(i, i)];
        }
        let Some(cholesky) = predicted.cholesky() else {
            return Err(StateError::Diverged { time_s: next.time_s });
        };
        let gain = cholesky.solve(&cross.transpose()).transpose();
        let s = here.known.0 + gain * (later.0 - next.predicted.0);
        let p = here.known.1 + gain * (later.1 - predicted) * gain.transpose();
        here.known = (s, (p + p.transpose()) * 0.5);
    }
    Ok(())
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
