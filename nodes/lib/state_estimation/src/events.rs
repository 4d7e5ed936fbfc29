//! What a sequence says, in the order of its stamps.

use gripsight_signals::{Poses, StateSequence};

/// One thing measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Observation {
    /// Position and heading in a fixed frame.
    Pose {
        /// Position.
        x_m: f64,
        /// Position.
        y_m: f64,
        /// Heading.
        yaw_rad: f64,
    },
    /// Forward speed, m/s.
    Speed(f64),
    /// Lateral speed, m/s, left positive.
    LateralSpeed(f64),
    /// Yaw rate, rad/s.
    YawRate(f64),
    /// Specific force in the car's frame.
    Acceleration {
        /// Forward.
        a_x_mps2: f64,
        /// To the left.
        a_y_mps2: f64,
    },
}

/// The observations of a sequence with their times, poses earlier by their delay.
pub(crate) fn events(sequence: &StateSequence, poses: &Poses, delay_s: f64) -> Vec<(f64, Observation)> {
    let mut all: Vec<(f64, Observation)> = Vec::with_capacity(4 * sequence.len());
    let moves = |values: &[f32]| values.iter().any(|&v| v != 0.0);
    let has_speed = moves(&sequence.v_x_mps);
    let yaw_rates = yaw_rates(sequence);
    let forces = [&sequence.a_x_mps2, &sequence.a_y_mps2];
    for (k, &t) in sequence.time_s.iter().enumerate() {
        let t = f64::from(t);
        if has_speed {
            all.push((t, Observation::Speed(sequence.v_x_mps[k].into())));
        }
        if let Some(values) = yaw_rates {
            all.push((t, Observation::YawRate(values[k].into())));
        }
        if let [Some(&a_x), Some(&a_y)] = forces.map(|f| f.get(k)) {
            all.push((t, Observation::Acceleration { a_x_mps2: a_x.into(), a_y_mps2: a_y.into() }));
        }
    }
    for (k, &t) in poses.time_s.iter().enumerate() {
        let pose = Observation::Pose { x_m: poses.x_m[k], y_m: poses.y_m[k], yaw_rad: poses.yaw_rad[k] };
        all.push((t - delay_s, pose));
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all
}

/// The yaw rate to be used: the gyroscope's, else the odometry's. Not both: one sensor often feeds both.
pub(crate) fn yaw_rates(sequence: &StateSequence) -> Option<&[f32]> {
    [&sequence.gyro_yaw_rate_radps, &sequence.yaw_rate_radps]
        .into_iter()
        .map(Vec::as_slice)
        .find(|values| values.iter().any(|&v| v != 0.0))
}

/// Whether the pose is nothing but the integral of v_x and yaw rate without any v_y (wheel odometry): it tells nothing new, and that v_y is
/// zero least of all.
///
/// Over spans of half a second, the sideways displacement is compared with that of the integral; a measured pose differs by its noise or by v_y.
#[must_use]
pub fn is_dead_reckoning(sequence: &StateSequence) -> bool {
    const SPAN_S: f64 = 0.5;
    const SHARE: f64 = 2e-3;
    let (x, y, psi, t) = (&sequence.x_m, &sequence.y_m, &sequence.yaw_rad, &sequence.time_s);
    if psi.is_empty() || !sequence.pose_time_s.is_empty() {
        return false;
    }
    let n = t.len();
    // An integrator takes the heading before a step, in its middle, or after it.
    let mut errors = [const { Vec::new() }; 3];
    let mut from = 0;
    while from + 1 < n {
        let Some(to) = (from + 1..n).find(|&k| f64::from(t[k] - t[from]) >= SPAN_S) else { break };
        for (errors, place) in errors.iter_mut().zip([0.0_f64, 0.5, 1.0]) {
            let (mut px, mut py, mut distance) = (0.0, 0.0, 0.0);
            for k in from..to {
                let dt = f64::from(t[k + 1] - t[k]);
                let between = |v: &[f32]| f64::from(v[k]) + place * f64::from(v[k + 1] - v[k]);
                let (v, heading) = (between(&sequence.v_x_mps), between(psi));
                px += v * dt * heading.cos();
                py += v * dt * heading.sin();
                distance += v.abs() * dt;
            }
            let error = (f64::from(x[to] - x[from]) - px).hypot(f64::from(y[to] - y[from]) - py);
            if distance > 0.2 {
                errors.push(error / distance);
            }
        }
        from = to;
    }
    errors.iter_mut().any(|errors| {
        errors.sort_unstable_by(f64::total_cmp);
        errors.len() >= 4 && errors[errors.len() * 9 / 10] < SHARE
    })
}
