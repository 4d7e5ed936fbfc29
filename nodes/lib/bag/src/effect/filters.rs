//! Effects with a memory.

use gripsight_signals::{DriveSample, ImuSample, NS_PER_S, OdometrySample};

fn step_s(from_ns: i64, to_ns: i64) -> f64 {
    (to_ns - from_ns) as f64 / NS_PER_S
}

/// The command, held over each step, of which the recorded one is the lagged response.
pub(super) fn undo_lag(drive: &mut [DriveSample], tau_s: f64) {
    for k in 1..drive.len() {
        let dt_s = step_s(drive[k - 1].stamp_ns, drive[k].stamp_ns);
        // Without a step or a lag the command is what it was.
        if dt_s > 0.0 && tau_s > 0.0 {
            let a = (-dt_s / tau_s).exp();
            let [now, next] = [drive[k - 1].steering_angle_rad, drive[k].steering_angle_rad];
            drive[k - 1].steering_angle_rad = (next - a * now) / (1.0 - a);
        }
    }
}

/// v_y later by a delay.
pub(super) fn delay(odometry: &mut [OdometrySample], delay_s: f64) {
    let recorded: Vec<(i64, f64)> = odometry.iter().map(|m| (m.stamp_ns, m.v_y_mps)).collect();
    let delay_ns = (delay_s * NS_PER_S).round() as i64;
    for m in odometry {
        let t_ns = m.stamp_ns.saturating_sub(delay_ns);
        let after = recorded.partition_point(|&(stamp_ns, _)| stamp_ns <= t_ns);
        m.v_y_mps = match (recorded.get(after.wrapping_sub(1)), recorded.get(after)) {
            (Some(&(t0_ns, v0)), Some(&(t1_ns, v1))) => {
                v0 + (v1 - v0) * step_s(t0_ns, t_ns) / step_s(t0_ns, t1_ns)
            }
            (Some(&(_, v)), None) | (None, Some(&(_, v))) => v,
            (None, None) => m.v_y_mps,
        };
    }
}

/// v_y through a first-order low pass.
pub(super) fn low_pass(odometry: &mut [OdometrySample], tau_s: f64) {
    if tau_s <= 0.0 {
        return;
    }
    let mut input = odometry.first().map_or(0.0, |m| m.v_y_mps);
    for k in 1..odometry.len() {
        let dt_s = step_s(odometry[k - 1].stamp_ns, odometry[k].stamp_ns).max(0.0);
        let output = odometry[k - 1].v_y_mps;
        let next_input = odometry[k].v_y_mps;
        // Exact for an input that is linear over the step; share is the mean of the decay over it.
        let (decay, share) = if dt_s > 0.0 {
            let decay = (-dt_s / tau_s).exp();
            (decay, (1.0 - decay) * tau_s / dt_s)
        } else {
            (1.0, 1.0)
        };
        odometry[k].v_y_mps = decay * output + (share - decay) * input + (1.0 - share) * next_input;
        input = next_input;
    }
}

/// Slopes of the yaw rate, central differences.
pub(super) fn yaw_accelerations_radps2(imu: &[ImuSample]) -> Vec<f64> {
    let last = imu.len().saturating_sub(1);
    let slope = |k: usize| {
        let [from, to] = [&imu[k.saturating_sub(1)], &imu[(k + 1).min(last)]];
        let dt_s = step_s(from.stamp_ns, to.stamp_ns);
        if dt_s > 0.0 { (to.yaw_rate_radps - from.yaw_rate_radps) / dt_s } else { 0.0 }
    };
    (0..imu.len()).map(slope).collect()
}
