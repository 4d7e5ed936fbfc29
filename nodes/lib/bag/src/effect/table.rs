//! Every effect that can be injected.

use std::ops::Bound::{Excluded, Included, Unbounded};

use gripsight_signals::NS_PER_S;

use super::EffectKind;
use super::filters::{delay, low_pass, undo_lag, yaw_accelerations_radps2};
use crate::Role;

const GRAVITY_MPS2: f64 = 9.81;

/// Every effect that can be injected.
pub static EFFECTS: [EffectKind; 13] = [
    EffectKind {
        name: "steering_delay",
        parameters: &["delay_s"],
        stream: Role::Drive,
        least: Included(0.0),
        apply: |[delay_s, _], s| {
            let delay_ns = (delay_s * NS_PER_S).round() as i64;
            s.drive.iter_mut().for_each(|m| m.stamp_ns = m.stamp_ns.saturating_sub(delay_ns));
        },
    },
    EffectKind {
        name: "steering_gain",
        parameters: &["gain"],
        stream: Role::Drive,
        least: Excluded(-1.0),
        apply: |[gain, _], s| {
            s.drive.iter_mut().for_each(|m| m.steering_angle_rad /= 1.0 + gain);
        },
    },
    EffectKind {
        name: "steering_offset",
        parameters: &["offset_rad"],
        stream: Role::Drive,
        least: Unbounded,
        apply: |[offset_rad, _], s| {
            s.drive.iter_mut().for_each(|m| m.steering_angle_rad -= offset_rad);
        },
    },
    EffectKind {
        name: "steering_lag",
        parameters: &["tau_s"],
        stream: Role::Drive,
        least: Included(0.0),
        apply: |[tau_s, _], s| {
            undo_lag(&mut s.drive, tau_s);
        },
    },
    EffectKind {
        name: "gyro_scale",
        parameters: &["scale"],
        stream: Role::Odom,
        least: Excluded(-1.0),
        apply: |[scale, _], s| {
            s.odometry.iter_mut().for_each(|m| m.yaw_rate_radps *= 1.0 + scale);
            s.imu.iter_mut().for_each(|m| m.yaw_rate_radps *= 1.0 + scale);
        },
    },
    EffectKind {
        name: "gyro_bias",
        parameters: &["bias_radps"],
        stream: Role::Odom,
        least: Unbounded,
        apply: |[bias_radps, _], s| {
            s.odometry.iter_mut().for_each(|m| m.yaw_rate_radps += bias_radps);
            s.imu.iter_mut().for_each(|m| m.yaw_rate_radps += bias_radps);
        },
    },
    EffectKind {
        name: "v_y_lever_arm",
        parameters: &["x_m"],
        stream: Role::Odom,
        least: Unbounded,
        apply: |[x_m, _], s| {
            s.odometry.iter_mut().for_each(|m| m.v_y_mps += x_m * m.yaw_rate_radps);
        },
    },
    EffectKind {
        name: "v_y_bias",
        parameters: &["bias_mps"],
        stream: Role::Odom,
        least: Unbounded,
        apply: |[bias_mps, _], s| {
            s.odometry.iter_mut().for_each(|m| m.v_y_mps += bias_mps);
        },
    },
    EffectKind {
        name: "odometry_delay",
        parameters: &["delay_s"],
        stream: Role::Odom,
        least: Included(0.0),
        apply: |[delay_s, _], s| {
            delay(&mut s.odometry, delay_s);
        },
    },
    EffectKind {
        name: "odometry_low_pass",
        parameters: &["tau_s"],
        stream: Role::Odom,
        least: Included(0.0),
        apply: |[tau_s, _], s| {
            low_pass(&mut s.odometry, tau_s);
        },
    },
    EffectKind {
        name: "v_x_scale",
        parameters: &["scale"],
        stream: Role::Odom,
        least: Excluded(-1.0),
        apply: |[scale, _], s| {
            s.odometry.iter_mut().for_each(|m| m.v_x_mps *= 1.0 + scale);
        },
    },
    EffectKind {
        name: "imu_lever_arm",
        parameters: &["x_m", "y_m"],
        stream: Role::Imu,
        least: Unbounded,
        apply: |[x_m, y_m], s| {
            let yaw_accelerations_radps2 = yaw_accelerations_radps2(&s.imu);
            for (m, yaw_acceleration_radps2) in s.imu.iter_mut().zip(yaw_accelerations_radps2) {
                m.a_y_mps2 += x_m * yaw_acceleration_radps2 - y_m * m.yaw_rate_radps.powi(2);
            }
        },
    },
    EffectKind {
        name: "imu_tilt",
        parameters: &["roll_rad"],
        stream: Role::Imu,
        least: Unbounded,
        apply: |[roll_rad, _], s| {
            let (sin, cos) = roll_rad.sin_cos();
            s.imu.iter_mut().for_each(|m| m.a_y_mps2 = m.a_y_mps2 * cos + GRAVITY_MPS2 * sin);
        },
    },
];
