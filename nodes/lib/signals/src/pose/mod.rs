//! What poses are worth: how late they come, and whether they are more than the integral of the speeds beside them.

mod delay;

pub use delay::pose_delay_s;

use crate::StateSequence;

/// The yaw rate to be used: the gyroscope's, else the odometry's. Not both: one sensor often feeds both.
#[must_use]
pub fn yaw_rates(sequence: &StateSequence) -> Option<&[f32]> {
    [&sequence.gyro_yaw_rate_radps, &sequence.yaw_rate_radps]
        .into_iter()
        .map(Vec::as_slice)
        .find(|values| values.iter().any(|&v| v != 0.0))
}

/// Whether the pose is nothing but the integral of v_x and heading without any v_y (wheel odometry): it tells nothing new, and that v_y is
/// zero least of all.
///
/// Over spans of half a second, the displacement is compared with that of the integral; a measured pose differs by its noise or by v_y.
#[must_use]
pub fn is_dead_reckoning(sequence: &StateSequence) -> bool {
    integrates(sequence, false)
}

/// Whether the pose is nothing but the integral of v_x, v_y and heading: it cannot check them.
#[must_use]
pub fn is_integral_of_twist(sequence: &StateSequence) -> bool {
    integrates(sequence, true)
}

fn integrates(sequence: &StateSequence, with_v_y: bool) -> bool {
    const SPAN_S: f64 = 0.5;
    const SHARE: f64 = 2e-3;
    const LEAST_WAY_M: f64 = 0.2;
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
                let v_y = if with_v_y { between(&sequence.v_y_mps) } else { 0.0 };
                let (sin, cos) = heading.sin_cos();
                px += (v * cos - v_y * sin) * dt;
                py += (v * sin + v_y * cos) * dt;
                distance += v.abs() * dt;
            }
            let error = (f64::from(x[to] - x[from]) - px).hypot(f64::from(y[to] - y[from]) - py);
            if distance > LEAST_WAY_M {
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
