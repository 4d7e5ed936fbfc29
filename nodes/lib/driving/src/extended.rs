//! What a diagnosis names, as a controller's model takes it in.
//!
//! | effect | in the model |
//! | --- | --- |
//! | `steering_delay`, `steering_lag` | the wheels follow later: the car is predicted so far ahead, with the wheels where they then are |
//! | `steering_gain`, `steering_offset` | the command that gives the angle asked for |
//! | `v_y_lever_arm`, `v_y_bias`, `gyro_bias`, `gyro_scale` | taken out of the state before anything is made of it |
//! | `grip_scale`, `grip_balance` | peak of the axles, over those of the set in use |

use gripsight_vehicle::{MagicFormula, PacejkaParameters};

use crate::{Actuator, CarState, TireSet};

/// What is named; `None` of what is not.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Named {
    /// From the command to the wheels.
    pub steering_delay_s: Option<f64>,
    /// Time constant of what follows.
    pub steering_lag_s: Option<f64>,
    /// Road-wheel angle over command.
    pub steering_gain: Option<f64>,
    /// Road-wheel angle at command zero.
    pub steering_offset_rad: Option<f64>,
    /// Point where v_y is measured, ahead of the centre of gravity.
    pub v_y_lever_arm_m: Option<f64>,
    /// Added to v_y by the sensor.
    pub v_y_bias_mps: Option<f64>,
    /// Added to the yaw rate by the sensor.
    pub yaw_rate_bias_radps: Option<f64>,
    /// Yaw rate reported over yaw rate.
    pub yaw_rate_scale: Option<f64>,
    /// Grip of the front and the rear axle over that of the set in use.
    pub grip: Option<[f64; 2]>,
}

impl Named {
    /// Takes an effect of the library in by its name; `value` gives its parameters. False where a controller has no use for it.
    pub fn take_in(&mut self, effect: &str, value: impl Fn(&str) -> Option<f64>) -> bool {
        let axles = |front: f64, rear: f64| {
            let [f, r] = self.grip.unwrap_or([1.0; 2]);
            Some([f * front, r * rear])
        };
        let one_more = |v: f64| 1.0 + v;
        match effect {
            "steering_delay" => self.steering_delay_s = value("delay_s"),
            "steering_lag" => self.steering_lag_s = value("tau_s"),
            "steering_gain" => self.steering_gain = value("gain").map(one_more),
            "steering_offset" => self.steering_offset_rad = value("offset_rad"),
            "v_y_lever_arm" => self.v_y_lever_arm_m = value("x_m"),
            "v_y_bias" => self.v_y_bias_mps = value("bias_mps"),
            "gyro_bias" => self.yaw_rate_bias_radps = value("bias_radps"),
            "gyro_scale" => self.yaw_rate_scale = value("scale").map(one_more),
            "grip_scale" => self.grip = value("m").and_then(|m| axles(1.0 + m, 1.0 + m)),
            "grip_balance" => self.grip = value("b").and_then(|b| axles(1.0 + b, 1.0 - b)),
            _ => return false,
        }
        true
    }

    /// Which figures are named.
    pub(crate) fn kinds(&self) -> [bool; 9] {
        [
            self.steering_delay_s.is_some(),
            self.steering_lag_s.is_some(),
            self.steering_gain.is_some(),
            self.steering_offset_rad.is_some(),
            self.v_y_lever_arm_m.is_some(),
            self.v_y_bias_mps.is_some(),
            self.yaw_rate_bias_radps.is_some(),
            self.yaw_rate_scale.is_some(),
            self.grip.is_some(),
        ]
    }

    /// Whether every figure is one that a car can have.
    pub(crate) fn is_plausible(&self) -> bool {
        let within =
            |figure: Option<f64>, low: f64, high: f64| figure.is_none_or(|f| (low..=high).contains(&f));
        within(self.steering_delay_s, 0.0, 0.5)
            && within(self.steering_lag_s, 0.0, 0.5)
            && within(self.steering_gain, 0.3, 3.0)
            && within(self.steering_offset_rad, -0.3, 0.3)
            && within(self.v_y_lever_arm_m, -5.0, 5.0)
            && within(self.v_y_bias_mps, -5.0, 5.0)
            && within(self.yaw_rate_bias_radps, -1.0, 1.0)
            && within(self.yaw_rate_scale, 0.3, 3.0)
            && self.grip.is_none_or(|grip| grip.iter().all(|g| (0.2..=3.0).contains(g)))
    }

    /// The actuator with what is named in place of what identification found.
    pub(crate) fn actuator(&self, identified: &Actuator) -> Actuator {
        Actuator {
            // Identification finds delay and lag together.
            delay_s: self.steering_delay_s.unwrap_or(if self.steering_lag_s.is_some() {
                0.0
            } else {
                identified.delay_s
            }),
            lag_s: self.steering_lag_s.unwrap_or(if self.steering_delay_s.is_some() {
                0.0
            } else {
                identified.lag_s
            }),
            gain: self.steering_gain.unwrap_or(identified.gain),
            offset_rad: self.steering_offset_rad.unwrap_or(identified.offset_rad),
        }
    }

    /// The car's state from what is measured.
    pub(crate) fn state(&self, measured: &CarState) -> CarState {
        let yaw_rate = (measured.yaw_rate_radps - self.yaw_rate_bias_radps.unwrap_or(0.0))
            / self.yaw_rate_scale.unwrap_or(1.0);
        CarState {
            v_y_mps: measured.v_y_mps
                - self.v_y_bias_mps.unwrap_or(0.0)
                - self.v_y_lever_arm_m.unwrap_or(0.0) * yaw_rate,
            yaw_rate_radps: yaw_rate,
            ..*measured
        }
    }

    /// What would be measured of a lateral velocity and a yaw rate.
    pub(crate) fn measured(&self, [v_y_mps, yaw_rate_radps]: [f64; 2]) -> [f64; 2] {
        [
            v_y_mps + self.v_y_bias_mps.unwrap_or(0.0) + self.v_y_lever_arm_m.unwrap_or(0.0) * yaw_rate_radps,
            yaw_rate_radps * self.yaw_rate_scale.unwrap_or(1.0) + self.yaw_rate_bias_radps.unwrap_or(0.0),
        ]
    }

    /// The tires with the named grip: cornering stiffness and shape stay.
    pub(crate) fn tires(&self, set: &PacejkaParameters) -> PacejkaParameters {
        scaled(set, self.grip)
    }

    /// The set to plan and steer with: both axles with the grip of the one that lost more, and what was shown and is likely of it with them. A steering
    /// table of a car that oversteers asks for less angle the more the car is to turn, and spins it.
    pub(crate) fn planned(&self, set: &TireSet) -> TireSet {
        let over = self.grip.map_or(1.0, |[front, rear]| front.min(rear));
        TireSet {
            tires: scaled(&set.tires, Some([over; 2])),
            // The same curve, smaller: a slip that gave a force gives a share of it at that share of the slip.
            valid_slip_rad: set.valid_slip_rad.map(|slip_rad| over * slip_rad),
            likely_peaks: set.likely_peaks.map(|peaks| peaks.map(|peak| over * peak)),
            ..*set
        }
    }
}

fn scaled(set: &PacejkaParameters, grip: Option<[f64; 2]>) -> PacejkaParameters {
    let Some([front, rear]) = grip else { return *set };
    let axle =
        |t: &MagicFormula, g: f64| MagicFormula::from_stiffness(t.normalized_stiffness(), t.c, t.d * g, t.e);
    PacejkaParameters { front: axle(&set.front, front), rear: axle(&set.rear, rear) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn named_effects_are_taken_in_and_others_are_not() {
        let mut named = Named::default();
        assert!(named.take_in("steering_delay", |p| (p == "delay_s").then_some(0.08)));
        assert!(named.take_in("grip_scale", |_| Some(-0.1)));
        assert!(named.take_in("grip_balance", |_| Some(0.1)));
        assert!(!named.take_in("aero_downforce", |_| Some(0.1)));
        assert_eq!(named.steering_delay_s, Some(0.08));
        let [front, rear] = named.grip.unwrap();
        approx::assert_relative_eq!(front, 0.99, epsilon = 1e-12);
        approx::assert_relative_eq!(rear, 0.81, epsilon = 1e-12);
        assert!(named.is_plausible());
        assert!(!Named { steering_delay_s: Some(-0.1), ..named }.is_plausible());
        assert!(!Named { v_y_bias_mps: Some(f64::NAN), ..named }.is_plausible());
    }

    #[test]
    fn what_is_measured_of_the_state_is_what_was_measured() {
        let named = Named {
            v_y_lever_arm_m: Some(0.2),
            v_y_bias_mps: Some(-0.05),
            yaw_rate_bias_radps: Some(0.02),
            yaw_rate_scale: Some(1.1),
            ..Named::default()
        };
        let measured = CarState {
            stamp_s: 1.0,
            x_m: 0.0,
            y_m: 0.0,
            heading_rad: 0.0,
            v_x_mps: 3.0,
            v_y_mps: 0.3,
            yaw_rate_radps: 1.5,
        };
        let state = named.state(&measured);
        let [v_y, yaw_rate] = named.measured([state.v_y_mps, state.yaw_rate_radps]);
        approx::assert_relative_eq!(v_y, 0.3, epsilon = 1e-12);
        approx::assert_relative_eq!(yaw_rate, 1.5, epsilon = 1e-12);
    }
}
