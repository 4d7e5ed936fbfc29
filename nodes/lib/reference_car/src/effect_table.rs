//! The table of effects: canonical names, parameters with units and typical sizes, and the mechanism of each.

use crate::error::ReferenceCarError;
use crate::mechanisms::{Mechanisms, Patch};

/// One parameter of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterSpec {
    /// Name with its unit, as in the published reports.
    pub name: &'static str,
    /// Unit; `1` for a ratio.
    pub unit: &'static str,
    /// The value at which the effect is absent; `None` where the parameter places the effect instead of sizing it.
    pub null: Option<f64>,
    /// A size seen on a full-size car.
    pub typical: f64,
    /// A size seen on a 1:10 car.
    pub typical_small: f64,
}

/// An effect's entry in the table.
#[derive(Debug, Clone, Copy)]
pub struct EffectSpec {
    /// Canonical name.
    pub name: &'static str,
    /// Its parameters, the sizing one first.
    pub parameters: &'static [ParameterSpec],
    pub(crate) apply: fn(&mut Mechanisms, &[f64]),
}

/// The entry of an effect.
///
/// # Errors
/// `UnknownName` with the names that exist.
pub fn effect_spec(name: &str) -> Result<&'static EffectSpec, ReferenceCarError> {
    EFFECTS.iter().find(|e| e.name == name).ok_or_else(|| ReferenceCarError::UnknownName {
        kind: "effect",
        name: name.to_owned(),
        known: EFFECTS.iter().map(|e| e.name).collect::<Vec<_>>().join(", "),
    })
}

pub(crate) fn parameter_spec(
    spec: &'static EffectSpec,
    name: &str,
) -> Result<&'static ParameterSpec, ReferenceCarError> {
    spec.parameters.iter().find(|p| p.name == name).ok_or_else(|| ReferenceCarError::UnknownName {
        kind: "effect parameter",
        name: format!("{}.{name}", spec.name),
        known: spec.parameters.iter().map(|p| p.name).collect::<Vec<_>>().join(", "),
    })
}

const fn size(
    name: &'static str,
    unit: &'static str,
    null: f64,
    typical: f64,
    typical_small: f64,
) -> ParameterSpec {
    ParameterSpec { name, unit, null: Some(null), typical, typical_small }
}

const fn place(name: &'static str, unit: &'static str, typical: f64, typical_small: f64) -> ParameterSpec {
    ParameterSpec { name, unit, null: None, typical, typical_small }
}

macro_rules! effects {
    ($($name:ident [$($parameter:expr),+] => |$m:ident, $v:ident| $apply:expr;)+) => {
        /// Every effect of the car, the actuators and the sensors.
        pub const EFFECTS: &[EffectSpec] = &[$(EffectSpec {
            name: stringify!($name),
            parameters: &[$($parameter),+],
            apply: |$m, $v| $apply,
        }),+];
    };
}

effects! {
    tire_relaxation [size("sigma_m", "m", 0.0, 0.45, 0.08)]
        => |m, v| m.relaxation_m = v[0];
    lateral_load_transfer [size("k", "1", 0.0, 0.15, 0.15)]
        => |m, v| m.load_transfer_loss = v[0];
    longitudinal_load_transfer [size("h_m", "m", 0.0, 0.3, 0.06)]
        => |m, v| m.pitch_arm_m = v[0];
    combined_slip [size("k", "1", 0.0, 0.9, 0.9)]
        => |m, v| m.coupling = v[0];
    grip_scale [size("m", "1", 0.0, -0.15, -0.15)]
        => |m, v| m.grip_scale = v[0];
    grip_balance [size("b", "1", 0.0, 0.05, 0.05)]
        => |m, v| m.grip_balance = v[0];
    low_grip_patch [size("depth", "1", 0.0, 0.25, 0.25), place("start_m", "m", 200.0, 10.0), place("length_m", "m", 80.0, 3.0)]
        => |m, v| m.patch = Some(Patch { depth: v[0], start_m: v[1], length_m: v[2] });
    tire_wear [size("rate_per_min", "1/min", 0.0, 0.1, 0.1)]
        => |m, v| m.wear_per_min = v[0];
    steering_lag [size("tau_s", "s", 0.0, 0.08, 0.08)]
        => |m, v| m.steering.lag_s = v[0];
    steering_delay [size("delay_s", "s", 0.0, 0.05, 0.05)]
        => |m, v| m.steering.delay_s = v[0];
    steering_gain [size("gain", "1", 0.0, 0.06, 0.06)]
        => |m, v| m.steering.gain = v[0];
    steering_offset [size("offset_rad", "rad", 0.0, 0.008, 0.02)]
        => |m, v| m.steering.offset_rad = v[0];
    steering_backlash [size("half_width_rad", "rad", 0.0, 0.004, 0.015)]
        => |m, v| m.steering.play_rad = v[0];
    steering_rate_limit [ParameterSpec { name: "rate_radps", unit: "rad/s", null: None, typical: 0.3, typical_small: 1.5 }]
        => |m, v| m.steering.rate_limit_radps = Some(v[0]);
    aero_downforce [size("c_f", "s2/m2", 0.0, 8e-05, 0.001), size("c_r", "s2/m2", 0.0, 9e-05, 0.001)]
        => |m, v| (m.downforce_front, m.downforce_rear) = (v[0], v[1]);
    aero_drag [size("c_1pm", "1/m", 0.0, 0.0008, 0.008)]
        => |m, v| m.drag_1pm = v[0];
    rolling_resistance [size("c", "1", 0.0, 0.015, 0.03)]
        => |m, v| m.rolling_resistance = v[0];
    mass_error [size("ratio", "1", 1.0, 1.1, 1.1)]
        => |m, v| m.mass_ratio = v[0];
    yaw_inertia_error [size("ratio", "1", 1.0, 1.2, 1.2)]
        => |m, v| m.inertia_ratio = v[0];
    cog_shift [size("dl_m", "m", 0.0, 0.08, 0.01)]
        => |m, v| m.cog_shift_m = v[0];
    road_bank [size("angle_rad", "rad", 0.0, 0.06, 0.05)]
        => |m, v| m.bank_rad = v[0];
    road_slope [size("angle_rad", "rad", 0.0, 0.03, 0.03)]
        => |m, v| m.slope_rad = v[0];
    compliance_steer [size("rad_per_g", "rad/g", 0.0, 0.01, 0.02)]
        => |m, v| m.compliance_rad_per_g = v[0];
    roll_steer [size("rad_per_g", "rad/g", 0.0, 0.006, 0.012)]
        => |m, v| m.roll_steer_rad_per_g = v[0];
    differential_yaw_moment [size("k", "1", 0.0, 0.05, 0.05)]
        => |m, v| m.differential = v[0];
    gyro_scale [size("scale", "1", 0.0, 0.05, 0.05)]
        => |m, v| m.sensors.gyro_scale = v[0];
    gyro_bias [size("bias_radps", "rad/s", 0.0, 0.01, 0.04)]
        => |m, v| m.sensors.gyro_bias_radps = v[0];
    v_y_lever_arm [size("x_m", "m", 0.0, 0.6, 0.06)]
        => |m, v| m.sensors.v_y_lever_arm_m = v[0];
    v_y_bias [size("bias_mps", "m/s", 0.0, 0.15, 0.1)]
        => |m, v| m.sensors.v_y_bias_mps = v[0];
    odometry_delay [size("delay_s", "s", 0.0, 0.05, 0.05)]
        => |m, v| m.sensors.v_y_delay_s = v[0];
    odometry_low_pass [size("tau_s", "s", 0.0, 0.08, 0.08)]
        => |m, v| m.sensors.v_y_low_pass_s = v[0];
    v_x_scale [size("scale", "1", 0.0, 0.03, 0.03)]
        => |m, v| m.sensors.v_x_scale = v[0];
    imu_lever_arm [size("x_m", "m", 0.0, 0.3, 0.06), size("y_m", "m", 0.0, 0.1, 0.02)]
        => |m, v| (m.sensors.imu_x_m, m.sensors.imu_y_m) = (v[0], v[1]);
    imu_tilt [size("roll_rad", "rad", 0.0, 0.03, 0.03)]
        => |m, v| m.sensors.imu_roll_rad = v[0];
    cross_wind [size("speed_mps", "m/s", 0.0, 12.0, 5.0)]
        => |m, v| m.wind_mps = v[0];
    gusts [size("speed_mps", "m/s", 0.0, 8.0, 4.0)]
        => |m, v| m.gust_mps = v[0];
    tire_asymmetry [size("ratio", "1", 0.0, 0.12, 0.12)]
        => |m, v| m.tire_asymmetry = v[0];
    steering_map [size("cubic", "1", 0.0, 0.5, 0.5)]
        => |m, v| m.steering.cubic = v[0];
    camber_thrust [size("per_roll", "1", 0.0, 0.5, 0.5)]
        => |m, v| m.camber_per_roll = v[0];
    drive_lag [size("tau_s", "s", 0.0, 0.15, 0.1)]
        => |m, v| m.drive_lag_s = v[0];
}
