//! What a sequence says, in the order of its stamps.

use gripsight_signals::{Poses, StateSequence, yaw_rates};

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
    let rates = yaw_rates(sequence);
    let forces = [&sequence.a_x_mps2, &sequence.a_y_mps2];
    for (k, &t) in sequence.time_s.iter().enumerate() {
        let t = f64::from(t);
        if has_speed {
            all.push((t, Observation::Speed(sequence.v_x_mps[k].into())));
        }
        if let Some(values) = rates {
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
