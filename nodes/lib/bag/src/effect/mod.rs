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

mod filters;
mod table;

use std::ops::Bound;
use std::str::FromStr;

use gripsight_signals::{DriveSample, ImuSample, OdometrySample};

use crate::{BagError, Role};

pub use table::EFFECTS;

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

/// A row of the module's table.
#[derive(Debug)]
pub struct EffectKind {
    /// Its name.
    pub name: &'static str,
    /// Its parameters, with their units.
    pub parameters: &'static [&'static str],
    /// The stream that must be recorded for it to show.
    pub stream: Role,
    /// What the first parameter must reach.
    least: Bound<f64>,
    apply: fn([f64; 2], &mut Series),
}

/// An effect with its size.
#[derive(Debug, Clone, Copy)]
pub struct Effect {
    kind: &'static EffectKind,
    values: [f64; 2],
}

impl Effect {
    /// Its name in the table.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.kind.name
    }

    /// The stream that must be recorded for the effect to show.
    #[must_use]
    pub fn stream(&self) -> Role {
        self.kind.stream
    }

    /// Applies the effect. Numbers of samples stay; stamps move with `steering_delay` only.
    pub fn apply(&self, series: &mut Series) {
        (self.kind.apply)(self.values, series);
    }
}

impl FromStr for Effect {
    type Err = BagError;

    /// Reads `NAME=VALUE` or `NAME=PARAMETER:VALUE,PARAMETER:VALUE`, SI units; a parameter not named is zero.
    fn from_str(given: &str) -> Result<Self, BagError> {
        let refuse = |why: String| BagError::Effect { given: given.to_owned(), why };
        let (name, values) = given.split_once('=').ok_or_else(|| refuse("expected NAME=VALUE".to_owned()))?;
        let Some(kind) = EFFECTS.iter().find(|kind| kind.name == name) else {
            let names: Vec<&str> = EFFECTS.iter().map(|kind| kind.name).collect();
            return Err(refuse(format!("can be injected: {}", names.join(", "))));
        };
        let values = parse_values(values, kind.parameters).map_err(refuse)?;
        let is_possible = match kind.least {
            Bound::Included(least) => values[0] >= least,
            Bound::Excluded(least) => values[0] > least,
            Bound::Unbounded => true,
        };
        if !is_possible {
            return Err(refuse(format!("{} cannot be {}", kind.parameters[0], values[0])));
        }
        Ok(Self { kind, values })
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
        for EffectKind { name, .. } in &EFFECTS {
            assert_eq!(with(&format!("{name}=0")), series(), "{name}");
            assert_eq!(format!("{name}=0").parse::<Effect>().unwrap().name(), *name);
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
