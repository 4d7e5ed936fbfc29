//! Known sensor and actuator effects, applied to recorded telemetry.
//!
//! Each is what the car or the sensor would have done, so that a diagnosis must find it by this name and with this value. Signals
//! downstream of the effect are what they were; where the effect lies between the recorded command and the car (steering), the
//! command is changed so that the car's response to it, through the effect, is the response recorded.
//!
//! | name | value | what happens to the record |
//! | --- | --- | --- |
//! | `steering_delay` | T s | the command is moved earlier: u_rec(t) = u(t + T), so the road wheel follows as d(t) = u_rec(t - T). Stamps move, values stay |
//! | `steering_gain` | g | u_rec = u / (1 + g), so d = (1 + g) u_rec |
//! | `steering_offset` | d0 rad | u_rec = u - d0, so d = u_rec + d0 |
//! | `steering_lag` | tau s | u_rec held over a step makes tau d' + d = u_rec pass through the recorded u at every stamp: u_rec_k = (u_{k+1} - a u_k)/(1 - a), a = exp(-dt/tau) |
//! | `gyro_scale` | s | (1 + s) r, in odometry and inertial unit: one gyroscope feeds both |
//! | `gyro_bias` | b rad/s | r + b, likewise |
//! | `v_y_lever_arm` | x m | v_y + x r |
//! | `v_y_bias` | b m/s | v_y + b |
//! | `odometry_delay` | T s | v_y(t - T), linear between samples, the first value before them; v_y alone, as where a filter makes it |
//! | `odometry_low_pass` | tau s | tau y' + y = v_y, v_y linear between samples, y = v_y at the first |
//! | `v_x_scale` | s | (1 + s) v_x of the odometry |
//! | `imu_lever_arm` | x_m, y_m | a_y + x r' - y r^2, r the unit's own, r' by central differences |
//! | `imu_tilt` | phi rad | a_y cos phi + g sin phi |
//!
//! Signs and equations: the table of candidate effects, where these are the actuator's and the sensors'.

use std::str::FromStr;

use gripsight_signals::{DriveSample, ImuSample, NS_PER_S, OdometrySample};

use crate::{BagError, Role};

const GRAVITY_MPS2: f64 = 9.81;

/// A bag's telemetry by stream, in the order of recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Odometry.
    pub odometry: Vec<OdometrySample>,
    /// Drive commands.
    pub drive: Vec<DriveSample>,
    /// Inertial unit.
    pub imu: Vec<ImuSample>,
}

/// An effect with its size; see the module's table.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Effect {
    /// `steering_delay`.
    SteeringDelay {
        /// Delay.
        delay_s: f64,
    },
    /// `steering_gain`.
    SteeringGain {
        /// Gain less one.
        gain: f64,
    },
    /// `steering_offset`.
    SteeringOffset {
        /// Offset, left positive.
        offset_rad: f64,
    },
    /// `steering_lag`.
    SteeringLag {
        /// Time constant.
        tau_s: f64,
    },
    /// `gyro_scale`.
    GyroScale {
        /// Scale less one.
        scale: f64,
    },
    /// `gyro_bias`.
    GyroBias {
        /// Bias.
        bias_radps: f64,
    },
    /// `v_y_lever_arm`.
    LateralVelocityLeverArm {
        /// Sensor ahead of the centre of gravity.
        x_m: f64,
    },
    /// `v_y_bias`.
    LateralVelocityBias {
        /// Bias, left positive.
        bias_mps: f64,
    },
    /// `odometry_delay`.
    OdometryDelay {
        /// Delay.
        delay_s: f64,
    },
    /// `odometry_low_pass`.
    OdometryLowPass {
        /// Time constant.
        tau_s: f64,
    },
    /// `v_x_scale`.
    ForwardVelocityScale {
        /// Scale less one.
        scale: f64,
    },
    /// `imu_lever_arm`.
    ImuLeverArm {
        /// Unit ahead of the centre of gravity.
        x_m: f64,
        /// Unit left of the centre of gravity.
        y_m: f64,
    },
    /// `imu_tilt`.
    ImuTilt {
        /// Roll of the unit.
        roll_rad: f64,
    },
}

/// Every effect that can be injected, with its parameters.
pub const EFFECTS: [(&str, &[&str]); 13] = [
    ("steering_delay", &["delay_s"]),
    ("steering_gain", &["gain"]),
    ("steering_offset", &["offset_rad"]),
    ("steering_lag", &["tau_s"]),
    ("gyro_scale", &["scale"]),
    ("gyro_bias", &["bias_radps"]),
    ("v_y_lever_arm", &["x_m"]),
    ("v_y_bias", &["bias_mps"]),
    ("odometry_delay", &["delay_s"]),
    ("odometry_low_pass", &["tau_s"]),
    ("v_x_scale", &["scale"]),
    ("imu_lever_arm", &["x_m", "y_m"]),
    ("imu_tilt", &["roll_rad"]),
];

impl FromStr for Effect {
    type Err = BagError;

    /// Reads `NAME=VALUE` or `NAME=PARAMETER:VALUE,PARAMETER:VALUE`, SI units; a parameter not named is zero.
    fn from_str(given: &str) -> Result<Self, BagError> {
        let refuse = |why: String| BagError::Effect { given: given.to_owned(), why };
        let (name, values) = given.split_once('=').ok_or_else(|| refuse("expected NAME=VALUE".to_owned()))?;
        let Some((_, parameters)) = EFFECTS.iter().find(|(known, _)| *known == name) else {
            let names = EFFECTS.map(|(name, _)| name).join(", ");
            return Err(refuse(format!("can be injected: {names}")));
        };
        let [a, b] = parse_values(values, parameters).map_err(refuse)?;
        let effect = match name {
            "steering_delay" => Self::SteeringDelay { delay_s: a },
            "steering_gain" => Self::SteeringGain { gain: a },
            "steering_offset" => Self::SteeringOffset { offset_rad: a },
            "steering_lag" => Self::SteeringLag { tau_s: a },
            "gyro_scale" => Self::GyroScale { scale: a },
            "gyro_bias" => Self::GyroBias { bias_radps: a },
            "v_y_lever_arm" => Self::LateralVelocityLeverArm { x_m: a },
            "v_y_bias" => Self::LateralVelocityBias { bias_mps: a },
            "odometry_delay" => Self::OdometryDelay { delay_s: a },
            "odometry_low_pass" => Self::OdometryLowPass { tau_s: a },
            "v_x_scale" => Self::ForwardVelocityScale { scale: a },
            "imu_lever_arm" => Self::ImuLeverArm { x_m: a, y_m: b },
            _ => Self::ImuTilt { roll_rad: a },
        };
        effect.check().map_err(refuse)?;
        Ok(effect)
    }
}

/// Reads `VALUE` or `PARAMETER:VALUE`, separated by commas.
fn parse_values(text: &str, parameters: &[&str]) -> Result<[f64; 2], String> {
    let mut values = [0.0; 2];
    for (place, item) in text.split(',').enumerate() {
        let (place, number) = match item.split_once(':') {
            Some((parameter, number)) => (parameters.iter().position(|p| *p == parameter.trim()), number),
            None => (Some(place), item),
        };
        let slot = place.filter(|&place| place < parameters.len()).and_then(|place| values.get_mut(place));
        let slot = slot.ok_or_else(|| format!("takes {}", parameters.join(" and ")))?;
        *slot = match number.trim().parse::<f64>() {
            Ok(number) if number.is_finite() => number,
            _ => return Err(format!("`{number}` is no finite number")),
        };
    }
    Ok(values)
}

impl Effect {
    /// Says what is wrong with a size that no mechanism can have.
    fn check(&self) -> Result<(), String> {
        let (what, value, wrong) = match *self {
            Self::SteeringDelay { delay_s } | Self::OdometryDelay { delay_s } => {
                ("delay", delay_s, delay_s < 0.0)
            }
            Self::SteeringLag { tau_s } | Self::OdometryLowPass { tau_s } => {
                ("time constant", tau_s, tau_s < 0.0)
            }
            Self::SteeringGain { gain: scale }
            | Self::GyroScale { scale }
            | Self::ForwardVelocityScale { scale } => ("one plus the scale", 1.0 + scale, scale <= -1.0),
            _ => return Ok(()),
        };
        if wrong { Err(format!("the {what} cannot be {value}")) } else { Ok(()) }
    }

    /// Its name in the table.
    #[must_use]
    pub fn name(&self) -> &'static str {
        let place = match self {
            Self::SteeringDelay { .. } => 0,
            Self::SteeringGain { .. } => 1,
            Self::SteeringOffset { .. } => 2,
            Self::SteeringLag { .. } => 3,
            Self::GyroScale { .. } => 4,
            Self::GyroBias { .. } => 5,
            Self::LateralVelocityLeverArm { .. } => 6,
            Self::LateralVelocityBias { .. } => 7,
            Self::OdometryDelay { .. } => 8,
            Self::OdometryLowPass { .. } => 9,
            Self::ForwardVelocityScale { .. } => 10,
            Self::ImuLeverArm { .. } => 11,
            Self::ImuTilt { .. } => 12,
        };
        EFFECTS[place].0
    }

    /// The stream that must be recorded for the effect to show.
    #[must_use]
    pub fn stream(&self) -> Role {
        match self {
            Self::SteeringDelay { .. }
            | Self::SteeringGain { .. }
            | Self::SteeringOffset { .. }
            | Self::SteeringLag { .. } => Role::Drive,
            Self::ImuLeverArm { .. } | Self::ImuTilt { .. } => Role::Imu,
            _ => Role::Odom,
        }
    }

    /// Applies the effect. Numbers of samples stay; stamps move with [`Self::SteeringDelay`] only.
    pub fn apply(&self, series: &mut Series) {
        let Series { odometry, drive, imu } = series;
        match *self {
            Self::SteeringDelay { delay_s } => {
                let delay_ns = (delay_s * NS_PER_S).round() as i64;
                drive.iter_mut().for_each(|m| m.stamp_ns = m.stamp_ns.saturating_sub(delay_ns));
            }
            Self::SteeringGain { gain } => drive.iter_mut().for_each(|m| m.steering_angle_rad /= 1.0 + gain),
            Self::SteeringOffset { offset_rad } => {
                drive.iter_mut().for_each(|m| m.steering_angle_rad -= offset_rad);
            }
            Self::SteeringLag { tau_s } => undo_lag(drive, tau_s),
            Self::GyroScale { scale } => {
                odometry.iter_mut().for_each(|m| m.yaw_rate_radps *= 1.0 + scale);
                imu.iter_mut().for_each(|m| m.yaw_rate_radps *= 1.0 + scale);
            }
            Self::GyroBias { bias_radps } => {
                odometry.iter_mut().for_each(|m| m.yaw_rate_radps += bias_radps);
                imu.iter_mut().for_each(|m| m.yaw_rate_radps += bias_radps);
            }
            Self::LateralVelocityLeverArm { x_m } => {
                odometry.iter_mut().for_each(|m| m.v_y_mps += x_m * m.yaw_rate_radps);
            }
            Self::LateralVelocityBias { bias_mps } => odometry.iter_mut().for_each(|m| m.v_y_mps += bias_mps),
            Self::OdometryDelay { delay_s } => delay(odometry, delay_s),
            Self::OdometryLowPass { tau_s } => low_pass(odometry, tau_s),
            Self::ForwardVelocityScale { scale } => {
                odometry.iter_mut().for_each(|m| m.v_x_mps *= 1.0 + scale);
            }
            Self::ImuLeverArm { x_m, y_m } => {
                let yaw_accelerations_radps2 = yaw_accelerations_radps2(imu);
                for (m, yaw_acceleration_radps2) in imu.iter_mut().zip(yaw_accelerations_radps2) {
                    m.a_y_mps2 += x_m * yaw_acceleration_radps2 - y_m * m.yaw_rate_radps.powi(2);
                }
            }
            Self::ImuTilt { roll_rad } => {
                let (sin, cos) = roll_rad.sin_cos();
                imu.iter_mut().for_each(|m| m.a_y_mps2 = m.a_y_mps2 * cos + GRAVITY_MPS2 * sin);
            }
        }
    }
}

fn step_s(from_ns: i64, to_ns: i64) -> f64 {
    (to_ns - from_ns) as f64 / NS_PER_S
}

fn undo_lag(drive: &mut [DriveSample], tau_s: f64) {
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

fn delay(odometry: &mut [OdometrySample], delay_s: f64) {
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

fn low_pass(odometry: &mut [OdometrySample], tau_s: f64) {
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

fn yaw_accelerations_radps2(imu: &[ImuSample]) -> Vec<f64> {
    let last = imu.len().saturating_sub(1);
    let slope = |k: usize| {
        let [from, to] = [&imu[k.saturating_sub(1)], &imu[(k + 1).min(last)]];
        let dt_s = step_s(from.stamp_ns, to.stamp_ns);
        if dt_s > 0.0 { (to.yaw_rate_radps - from.yaw_rate_radps) / dt_s } else { 0.0 }
    };
    (0..imu.len()).map(slope).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// Two seconds at 100 Hz of something that moves.
    fn series() -> Series {
        let stamps = || (0..200).map(|k| (k, 10_000_000 * i64::from(k), 0.01 * f64::from(k)));
        Series {
            odometry: stamps()
                .map(|(_, stamp_ns, t)| OdometrySample {
                    stamp_ns,
                    v_x_mps: 5.0 + t,
                    v_y_mps: (3.0 * t).sin(),
                    yaw_rate_radps: (2.0 * t).cos(),
                    ..Default::default()
                })
                .collect(),
            drive: stamps()
                .map(|(_, stamp_ns, t)| DriveSample {
                    stamp_ns,
                    steering_angle_rad: 0.3 * (4.0 * t).sin(),
                    speed_mps: 5.0,
                    ..Default::default()
                })
                .collect(),
            imu: stamps()
                .map(|(_, stamp_ns, t)| ImuSample {
                    stamp_ns,
                    a_y_mps2: t,
                    yaw_rate_radps: t * t,
                    a_x_mps2: 1.0,
                })
                .collect(),
        }
    }

    fn with(effect: &str) -> Series {
        let mut changed = series();
        effect.parse::<Effect>().unwrap().apply(&mut changed);
        changed
    }

    #[test]
    fn the_road_wheel_follows_the_recorded_command_through_the_effect() {
        let truth = series().drive;
        let delayed = with("steering_delay=0.05").drive;
        let gained = with("steering_gain=0.08").drive;
        let offset = with("steering_offset=-0.02").drive;
        for k in 0..truth.len() {
            assert_eq!(delayed[k].stamp_ns + 50_000_000, truth[k].stamp_ns);
            assert_eq!(delayed[k].steering_angle_rad, truth[k].steering_angle_rad);
            assert_abs_diff_eq!(
                1.08 * gained[k].steering_angle_rad,
                truth[k].steering_angle_rad,
                epsilon = 1e-12
            );
            assert_abs_diff_eq!(
                offset[k].steering_angle_rad - 0.02,
                truth[k].steering_angle_rad,
                epsilon = 1e-12
            );
        }
        // tau d' + d = u, u held, by ten thousand small steps.
        let lagged = with("steering_lag=0.06").drive;
        let mut d = truth[0].steering_angle_rad;
        for k in 1..truth.len() {
            for _ in 0..10_000 {
                d += 1e-6 / 0.06 * (lagged[k - 1].steering_angle_rad - d);
            }
            assert_abs_diff_eq!(d, truth[k].steering_angle_rad, epsilon = 1e-4);
        }
    }

    #[test]
    fn sensors_report_what_their_equation_says() {
        let truth = series();
        let odometry = |effect: &str| with(effect).odometry;
        let [scale, bias] = [odometry("gyro_scale=0.05"), odometry("gyro_bias=0.01")];
        let [arm, v_y_bias] = [odometry("v_y_lever_arm=0.4"), odometry("v_y_bias=0.1")];
        let [v_x, late] = [odometry("v_x_scale=-0.03"), odometry("odometry_delay=0.035")];
        let tilted = with("imu_tilt=0.03").imu;
        let moved = with("imu_lever_arm=x_m:0.2,y_m:0.1").imu;
        for (k, m) in truth.odometry.iter().enumerate() {
            assert_eq!(scale[k].yaw_rate_radps, 1.05 * m.yaw_rate_radps);
            assert_eq!(bias[k].yaw_rate_radps, m.yaw_rate_radps + 0.01);
            assert_eq!(arm[k].v_y_mps, m.v_y_mps + 0.4 * m.yaw_rate_radps);
            assert_eq!(v_y_bias[k].v_y_mps, m.v_y_mps + 0.1);
            assert_eq!(v_x[k].v_x_mps, 0.97 * m.v_x_mps);
            let t = 0.01 * k as f64;
            assert_abs_diff_eq!(late[k].v_y_mps, (3.0 * (t - 0.035).max(0.0)).sin(), epsilon = 2e-4);
            assert_abs_diff_eq!(
                tilted[k].a_y_mps2,
                t * 0.03f64.cos() + 9.81 * 0.03f64.sin(),
                epsilon = 1e-12
            );
            if (1..199).contains(&k) {
                assert_abs_diff_eq!(moved[k].a_y_mps2, t + 0.2 * 2.0 * t - 0.1 * t.powi(4), epsilon = 1e-9);
            }
        }
        assert_eq!(with("gyro_scale=0.05").imu[7].yaw_rate_radps, 1.05 * truth.imu[7].yaw_rate_radps);
    }

    #[test]
    fn the_low_pass_solves_its_differential_equation() {
        let input = series().odometry;
        let output = with("odometry_low_pass=0.08").odometry;
        let mut y = input[0].v_y_mps;
        for k in 1..input.len() {
            let [u0, u1] = [input[k - 1].v_y_mps, input[k].v_y_mps];
            for i in 0..10_000 {
                let u = u0 + (u1 - u0) * (f64::from(i) + 0.5) / 1e4;
                y += 1e-6 / 0.08 * (u - y);
            }
            assert_abs_diff_eq!(output[k].v_y_mps, y, epsilon = 1e-5);
        }
    }

    #[test]
    fn nothing_else_changes_and_the_null_value_changes_nothing() {
        for (name, _) in EFFECTS {
            assert_eq!(with(&format!("{name}=0")), series(), "{name}");
            assert_eq!(format!("{name}=0").parse::<Effect>().unwrap().name(), name);
        }
        let changed = with("v_y_bias=0.1");
        assert_eq!((changed.drive, changed.imu), (series().drive, series().imu));
    }

    #[test]
    fn what_cannot_be_is_refused() {
        for given in [
            "steering_delay",
            "steering_delay=",
            "steering_delay=nan",
            "steering_delay=-0.1",
            "steering_lag=-1",
            "steering_gain=-1",
            "v_x_scale=-2",
            "imu_lever_arm=z_m:0.1",
            "imu_lever_arm=1,2,3",
            "imu_tilt=1,2",
            "tire_wear=0.1",
        ] {
            let error = given.parse::<Effect>().unwrap_err();
            assert!(matches!(&error, BagError::Effect { given: g, .. } if g == given), "{error}");
        }
    }
}
