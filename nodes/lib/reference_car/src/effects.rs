//! The effects by their canonical names, and the mechanism that each switches on.
//!
//! An [`EffectSetting`] is a name with its parameters; [`Mechanisms`] is the flat table that the car, the actuators and
//! the sensors read. Its default is the car without any effect.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::error::ReferenceCarError;

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
    /// Whether the diagnoser's library knows it.
    pub in_library: bool,
    apply: fn(&mut Mechanisms, &[f64]),
}

/// What the effects switch on, one field per parameter; the default is none of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mechanisms {
    pub(crate) relaxation_m: f64,
    pub(crate) load_transfer_loss: f64,
    pub(crate) pitch_arm_m: f64,
    pub(crate) coupling: f64,
    pub(crate) grip_scale: f64,
    pub(crate) grip_balance: f64,
    pub(crate) patch: Option<Patch>,
    pub(crate) wear_per_min: f64,
    pub(crate) steering: SteeringMechanisms,
    pub(crate) downforce_front: f64,
    pub(crate) downforce_rear: f64,
    pub(crate) drag_1pm: f64,
    pub(crate) rolling_resistance: f64,
    pub(crate) mass_ratio: f64,
    pub(crate) inertia_ratio: f64,
    pub(crate) cog_shift_m: f64,
    pub(crate) bank_rad: f64,
    pub(crate) slope_rad: f64,
    pub(crate) compliance_rad_per_g: f64,
    pub(crate) roll_steer_rad_per_g: f64,
    pub(crate) differential: f64,
    pub(crate) sensors: SensorMechanisms,
    pub(crate) wind_mps: f64,
    pub(crate) gust_mps: f64,
    pub(crate) tire_asymmetry: f64,
    pub(crate) camber_per_roll: f64,
    pub(crate) drive_lag_s: f64,
}

/// A place with less grip.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Patch {
    /// Lost share of the friction.
    pub depth: f64,
    /// Where it begins along the track.
    pub start_m: f64,
    /// Its length along the track.
    pub length_m: f64,
}

/// What happens between the steering command and the road wheels.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct SteeringMechanisms {
    pub(crate) lag_s: f64,
    pub(crate) delay_s: f64,
    pub(crate) gain: f64,
    pub(crate) offset_rad: f64,
    pub(crate) play_rad: f64,
    pub(crate) rate_limit_radps: Option<f64>,
    pub(crate) cubic: f64,
}

/// What happens between the car's motion and the recorded signals.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct SensorMechanisms {
    pub(crate) gyro_scale: f64,
    pub(crate) gyro_bias_radps: f64,
    pub(crate) v_y_lever_arm_m: f64,
    pub(crate) v_y_bias_mps: f64,
    pub(crate) v_y_delay_s: f64,
    pub(crate) v_y_low_pass_s: f64,
    pub(crate) v_x_scale: f64,
    pub(crate) imu_x_m: f64,
    pub(crate) imu_y_m: f64,
    pub(crate) imu_roll_rad: f64,
}

impl Default for Mechanisms {
    fn default() -> Self {
        Self {
            relaxation_m: 0.0,
            load_transfer_loss: 0.0,
            pitch_arm_m: 0.0,
            coupling: 0.0,
            grip_scale: 0.0,
            grip_balance: 0.0,
            patch: None,
            wear_per_min: 0.0,
            steering: SteeringMechanisms::default(),
            downforce_front: 0.0,
            downforce_rear: 0.0,
            drag_1pm: 0.0,
            rolling_resistance: 0.0,
            mass_ratio: 1.0,
            inertia_ratio: 1.0,
            cog_shift_m: 0.0,
            bank_rad: 0.0,
            slope_rad: 0.0,
            compliance_rad_per_g: 0.0,
            roll_steer_rad_per_g: 0.0,
            differential: 0.0,
            sensors: SensorMechanisms::default(),
            wind_mps: 0.0,
            gust_mps: 0.0,
            tire_asymmetry: 0.0,
            camber_per_roll: 0.0,
            drive_lag_s: 0.0,
        }
    }
}

/// An effect with its size, by canonical name. Parameters left out take their typical value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectSetting {
    /// Canonical name.
    pub name: String,
    /// Parameters by name.
    #[serde(default)]
    pub parameters: BTreeMap<String, f64>,
}

impl EffectSetting {
    /// An effect with its parameters in the table's order; those left out take their typical value.
    ///
    /// # Errors
    /// `UnknownName` for a name outside the table, `UnreadableEffect` for more values than parameters.
    pub fn new(name: &str, values: &[f64]) -> Result<Self, ReferenceCarError> {
        let spec = effect_spec(name)?;
        if values.len() > spec.parameters.len() {
            return Err(ReferenceCarError::UnreadableEffect {
                text: format!("{name}={values:?}"),
                reason: format!("expected at most {} values", spec.parameters.len()),
            });
        }
        let parameters = spec.parameters.iter().zip(values).map(|(p, v)| (p.name.to_owned(), *v)).collect();
        Ok(Self { name: name.to_owned(), parameters })
    }

    /// Reads `NAME`, `NAME=VALUE`, `NAME=VALUE,VALUE` or `NAME=PARAMETER:VALUE,PARAMETER:VALUE`.
    ///
    /// # Errors
    /// `UnknownName` for a name outside the table, `UnreadableEffect` for a value that is not a number.
    pub fn parse(text: &str) -> Result<Self, ReferenceCarError> {
        let unreadable =
            |reason: String| ReferenceCarError::UnreadableEffect { text: text.to_owned(), reason };
        let (name, values) = text.split_once('=').map_or((text, None), |(name, values)| (name, Some(values)));
        let spec = effect_spec(name)?;
        let mut setting = Self { name: name.to_owned(), parameters: BTreeMap::new() };
        for (index, item) in values.into_iter().flat_map(|v| v.split(',')).enumerate() {
            let (key, number) = match item.split_once(':') {
                Some((key, number)) => (parameter_spec(spec, key)?.name, number),
                None => match spec.parameters.get(index) {
                    Some(parameter) => (parameter.name, item),
                    None => {
                        return Err(unreadable(format!("expected at most {} values", spec.parameters.len())));
                    }
                },
            };
            let value: f64 =
                number.trim().parse().map_err(|_| unreadable(format!("{number:?} is not a number")))?;
            setting.parameters.insert(key.to_owned(), value);
        }
        Ok(setting)
    }

    fn values(&self, spec: &'static EffectSpec, small: bool) -> Result<Vec<f64>, ReferenceCarError> {
        for key in self.parameters.keys() {
            parameter_spec(spec, key)?;
        }
        spec.parameters
            .iter()
            .map(|p| {
                let typical = if small { p.typical_small } else { p.typical };
                let value = self.parameters.get(p.name).copied().unwrap_or(typical);
                if value.is_finite() {
                    Ok(value)
                } else {
                    Err(ReferenceCarError::InvalidParameter {
                        name: format!("effect {}.{}", spec.name, p.name),
                        value,
                        expected: "a finite number",
                    })
                }
            })
            .collect()
    }
}

impl Mechanisms {
    /// The mechanisms that a list of effects switches on. `small` picks the typical sizes of a 1:10 car.
    ///
    /// # Errors
    /// Unknown names, effects given twice, values that are not finite or mean nothing.
    pub fn from_settings(settings: &[EffectSetting], small: bool) -> Result<Self, ReferenceCarError> {
        let mut mechanisms = Self::default();
        for (index, setting) in settings.iter().enumerate() {
            if settings.iter().take(index).any(|earlier| earlier.name == setting.name) {
                return Err(ReferenceCarError::RepeatedEffect { name: setting.name.clone() });
            }
            let spec = effect_spec(&setting.name)?;
            (spec.apply)(&mut mechanisms, &setting.values(spec, small)?);
        }
        mechanisms.validate()?;
        Ok(mechanisms)
    }

    fn validate(&self) -> Result<(), ReferenceCarError> {
        let not_negative = [
            ("tire_relaxation.sigma_m", self.relaxation_m),
            ("combined_slip.k", self.coupling),
            ("steering_lag.tau_s", self.steering.lag_s),
            ("steering_delay.delay_s", self.steering.delay_s),
            ("steering_backlash.half_width_rad", self.steering.play_rad),
            ("odometry_delay.delay_s", self.sensors.v_y_delay_s),
            ("odometry_low_pass.tau_s", self.sensors.v_y_low_pass_s),
            ("drive_lag.tau_s", self.drive_lag_s),
            ("gusts.speed_mps", self.gust_mps),
        ];
        for (name, value) in not_negative {
            require(name, value, value >= 0.0, "not negative")?;
        }
        require("mass_error.ratio", self.mass_ratio, self.mass_ratio > 0.0, "above zero (1 is no error)")?;
        require(
            "yaw_inertia_error.ratio",
            self.inertia_ratio,
            self.inertia_ratio > 0.0,
            "above zero (1 is no error)",
        )?;
        require(
            "steering_delay.delay_s",
            self.steering.delay_s,
            self.steering.delay_s <= 1.0,
            "at most 1 s",
        )?;
        require(
            "odometry_delay.delay_s",
            self.sensors.v_y_delay_s,
            self.sensors.v_y_delay_s <= 1.0,
            "at most 1 s",
        )?;
        if let Some(rate) = self.steering.rate_limit_radps {
            require("steering_rate_limit.rate_radps", rate, rate > 0.0, "above zero")?;
        }
        if let Some(patch) = self.patch {
            require("low_grip_patch.depth", patch.depth, (0.0..1.0).contains(&patch.depth), "in 0..1")?;
            require("low_grip_patch.length_m", patch.length_m, patch.length_m >= 0.0, "not negative")?;
        }
        for (name, value) in
            [("road_bank.angle_rad", self.bank_rad), ("road_slope.angle_rad", self.slope_rad)]
        {
            require(name, value, value.abs() < 1.0, "below 1 rad")?;
        }
        require("grip_scale.m", self.grip_scale, self.grip_scale > -1.0, "above -1")?;
        require("grip_balance.b", self.grip_balance, self.grip_balance.abs() < 1.0, "between -1 and 1")
    }
}

fn require(name: &str, value: f64, holds: bool, expected: &'static str) -> Result<(), ReferenceCarError> {
    if holds {
        Ok(())
    } else {
        Err(ReferenceCarError::InvalidParameter { name: format!("effect {name}"), value, expected })
    }
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

fn parameter_spec(
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
    ($($known:ident $name:ident [$($parameter:expr),+] => |$m:ident, $v:ident| $apply:expr;)+) => {
        /// Every effect of the car, the actuators and the sensors.
        pub const EFFECTS: &[EffectSpec] = &[$(EffectSpec {
            name: stringify!($name),
            parameters: &[$($parameter),+],
            in_library: effects!(@ $known),
            apply: |$m, $v| $apply,
        }),+];
    };
    (@ library) => { true };
    (@ outside) => { false };
}

effects! {
    library tire_relaxation [size("sigma_m", "m", 0.0, 0.45, 0.08)]
        => |m, v| m.relaxation_m = v[0];
    library lateral_load_transfer [size("k", "1", 0.0, 0.15, 0.15)]
        => |m, v| m.load_transfer_loss = v[0];
    library longitudinal_load_transfer [size("h_m", "m", 0.0, 0.3, 0.06)]
        => |m, v| m.pitch_arm_m = v[0];
    library combined_slip [size("k", "1", 0.0, 0.9, 0.9)]
        => |m, v| m.coupling = v[0];
    library grip_scale [size("m", "1", 0.0, -0.15, -0.15)]
        => |m, v| m.grip_scale = v[0];
    library grip_balance [size("b", "1", 0.0, 0.05, 0.05)]
        => |m, v| m.grip_balance = v[0];
    library low_grip_patch [size("depth", "1", 0.0, 0.25, 0.25), place("start_m", "m", 200.0, 10.0), place("length_m", "m", 80.0, 3.0)]
        => |m, v| m.patch = Some(Patch { depth: v[0], start_m: v[1], length_m: v[2] });
    library tire_wear [size("rate_per_min", "1/min", 0.0, 0.1, 0.1)]
        => |m, v| m.wear_per_min = v[0];
    library steering_lag [size("tau_s", "s", 0.0, 0.08, 0.08)]
        => |m, v| m.steering.lag_s = v[0];
    library steering_delay [size("delay_s", "s", 0.0, 0.05, 0.05)]
        => |m, v| m.steering.delay_s = v[0];
    library steering_gain [size("gain", "1", 0.0, 0.06, 0.06)]
        => |m, v| m.steering.gain = v[0];
    library steering_offset [size("offset_rad", "rad", 0.0, 0.008, 0.02)]
        => |m, v| m.steering.offset_rad = v[0];
    library steering_backlash [size("half_width_rad", "rad", 0.0, 0.004, 0.015)]
        => |m, v| m.steering.play_rad = v[0];
    library steering_rate_limit [ParameterSpec { name: "rate_radps", unit: "rad/s", null: None, typical: 0.3, typical_small: 1.5 }]
        => |m, v| m.steering.rate_limit_radps = Some(v[0]);
    library aero_downforce [size("c_f", "s2/m2", 0.0, 8e-05, 0.001), size("c_r", "s2/m2", 0.0, 9e-05, 0.001)]
        => |m, v| (m.downforce_front, m.downforce_rear) = (v[0], v[1]);
    library aero_drag [size("c_1pm", "1/m", 0.0, 0.0008, 0.008)]
        => |m, v| m.drag_1pm = v[0];
    library rolling_resistance [size("c", "1", 0.0, 0.015, 0.03)]
        => |m, v| m.rolling_resistance = v[0];
    library mass_error [size("ratio", "1", 1.0, 1.1, 1.1)]
        => |m, v| m.mass_ratio = v[0];
    library yaw_inertia_error [size("ratio", "1", 1.0, 1.2, 1.2)]
        => |m, v| m.inertia_ratio = v[0];
    library cog_shift [size("dl_m", "m", 0.0, 0.08, 0.01)]
        => |m, v| m.cog_shift_m = v[0];
    library road_bank [size("angle_rad", "rad", 0.0, 0.06, 0.05)]
        => |m, v| m.bank_rad = v[0];
    library road_slope [size("angle_rad", "rad", 0.0, 0.03, 0.03)]
        => |m, v| m.slope_rad = v[0];
    library compliance_steer [size("rad_per_g", "rad/g", 0.0, 0.01, 0.02)]
        => |m, v| m.compliance_rad_per_g = v[0];
    library roll_steer [size("rad_per_g", "rad/g", 0.0, 0.006, 0.012)]
        => |m, v| m.roll_steer_rad_per_g = v[0];
    library differential_yaw_moment [size("k", "1", 0.0, 0.05, 0.05)]
        => |m, v| m.differential = v[0];
    library gyro_scale [size("scale", "1", 0.0, 0.05, 0.05)]
        => |m, v| m.sensors.gyro_scale = v[0];
    library gyro_bias [size("bias_radps", "rad/s", 0.0, 0.01, 0.04)]
        => |m, v| m.sensors.gyro_bias_radps = v[0];
    library v_y_lever_arm [size("x_m", "m", 0.0, 0.6, 0.06)]
        => |m, v| m.sensors.v_y_lever_arm_m = v[0];
    library v_y_bias [size("bias_mps", "m/s", 0.0, 0.15, 0.1)]
        => |m, v| m.sensors.v_y_bias_mps = v[0];
    library odometry_delay [size("delay_s", "s", 0.0, 0.05, 0.05)]
        => |m, v| m.sensors.v_y_delay_s = v[0];
    library odometry_low_pass [size("tau_s", "s", 0.0, 0.08, 0.08)]
        => |m, v| m.sensors.v_y_low_pass_s = v[0];
    library v_x_scale [size("scale", "1", 0.0, 0.03, 0.03)]
        => |m, v| m.sensors.v_x_scale = v[0];
    library imu_lever_arm [size("x_m", "m", 0.0, 0.3, 0.06), size("y_m", "m", 0.0, 0.1, 0.02)]
        => |m, v| (m.sensors.imu_x_m, m.sensors.imu_y_m) = (v[0], v[1]);
    library imu_tilt [size("roll_rad", "rad", 0.0, 0.03, 0.03)]
        => |m, v| m.sensors.imu_roll_rad = v[0];
    outside cross_wind [size("speed_mps", "m/s", 0.0, 12.0, 5.0)]
        => |m, v| m.wind_mps = v[0];
    outside gusts [size("speed_mps", "m/s", 0.0, 8.0, 4.0)]
        => |m, v| m.gust_mps = v[0];
    outside tire_asymmetry [size("ratio", "1", 0.0, 0.12, 0.12)]
        => |m, v| m.tire_asymmetry = v[0];
    outside steering_map [size("cubic", "1", 0.0, 0.5, 0.5)]
        => |m, v| m.steering.cubic = v[0];
    outside camber_thrust [size("per_roll", "1", 0.0, 0.5, 0.5)]
        => |m, v| m.camber_per_roll = v[0];
    outside drive_lag [size("tau_s", "s", 0.0, 0.15, 0.1)]
        => |m, v| m.drive_lag_s = v[0];
}
