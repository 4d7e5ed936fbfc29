//! Recordings that are short, slow or broken, made of a good one.

use gripsight_signals::StateSequence;

/// Samples `kept` (by place and time) of a recording, on the channels that every car has.
pub(crate) fn picked(all: &StateSequence, kept: impl Fn(usize, f32) -> bool) -> StateSequence {
    let kept: Vec<usize> = (0..all.len()).filter(|&k| kept(k, all.time_s[k])).collect();
    let pick = |channel: &[f32]| kept.iter().map(|&k| channel[k]).collect();
    StateSequence {
        time_s: pick(&all.time_s),
        v_x_mps: pick(&all.v_x_mps),
        v_y_mps: pick(&all.v_y_mps),
        yaw_rate_radps: pick(&all.yaw_rate_radps),
        steering_rad: pick(&all.steering_rad),
        ..StateSequence::default()
    }
}

/// With the car standing from 9 to 15 s; its v_y shows the sensor's bias.
pub(crate) fn stopped(all: &StateSequence, bias_mps: f64) -> StateSequence {
    let mut stopped = picked(all, |_, _| true);
    for k in 0..stopped.len() {
        if (9.0..15.0).contains(&stopped.time_s[k]) {
            stopped.v_x_mps[k] = 0.0;
            stopped.v_y_mps[k] = bias_mps as f32;
            stopped.yaw_rate_radps[k] = 0.0;
        }
    }
    stopped
}

/// With one value of v_y that is no number.
pub(crate) fn with_nan(all: &StateSequence, place: usize) -> StateSequence {
    let mut broken = picked(all, |_, _| true);
    broken.v_y_mps[place] = f32::NAN;
    broken
}

/// Straight ahead at the recorded speed, with a sensor's last digits in v_y and yaw rate.
pub(crate) fn straight(all: &StateSequence) -> StateSequence {
    let all = picked(all, |_, _| true);
    StateSequence {
        v_y_mps: (0..all.len()).map(|k| 0.002 * (k % 5) as f32).collect(),
        yaw_rate_radps: (0..all.len()).map(|k| 0.001 * (k % 3) as f32).collect(),
        steering_rad: vec![0.0; all.len()],
        ..all
    }
}
