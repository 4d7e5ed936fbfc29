//! From the steering command to the road wheels: delay, map, second-order servo with a rate limit, play.
//!
//! ```text
//! target      u' = (1 + g) u(t - T) (1 + c (u/u_max)^2) + offset
//! servo       d'' = w^2 (u' - d) - 2 z w d',   |d'| <= rate,   w = 2 z/tau: its delay at low frequency is tau
//! play        wheel = clamp(wheel, d - half width, d + half width)
//! ```

use std::collections::VecDeque;

use crate::mechanisms::SteeringMechanisms;

/// Damping ratio of the servo.
const DAMPING: f64 = 0.8;

/// The steering actuator and linkage of one car.
#[derive(Debug, Clone)]
pub(crate) struct Steering {
    mechanisms: SteeringMechanisms,
    limit_rad: f64,
    step_s: f64,
    waiting: VecDeque<f64>,
    servo_rad: f64,
    servo_radps: f64,
    wheel_rad: f64,
}

impl Steering {
    pub(crate) fn new(mechanisms: SteeringMechanisms, limit_rad: f64, step_s: f64) -> Self {
        let late = (mechanisms.delay_s / step_s).round() as usize;
        let start = mechanisms.offset_rad;
        Self {
            mechanisms,
            limit_rad,
            step_s,
            waiting: std::iter::repeat_n(0.0, late).collect(),
            servo_rad: start,
            servo_radps: 0.0,
            wheel_rad: start,
        }
    }

    /// Takes the command of this step; the road-wheel angles at its beginning and in its middle.
    ///
    /// Without a servo the wheels follow at once and hold through the step.
    pub(crate) fn step(&mut self, command_rad: f64) -> (f64, f64) {
        let before_rad = self.wheel_rad;
        self.waiting.push_back(command_rad.clamp(-self.limit_rad, self.limit_rad));
        let late_rad = self.waiting.pop_front().unwrap_or(command_rad);
        let relative = late_rad / self.limit_rad;
        let m = &self.mechanisms;
        let target_rad = (1.0 + m.gain) * late_rad * (1.0 + m.cubic * relative * relative) + m.offset_rad;
        self.move_servo(target_rad);
        let play = self.mechanisms.play_rad;
        self.wheel_rad = self.wheel_rad.clamp(self.servo_rad - play, self.servo_rad + play);
        if self.mechanisms.lag_s > 0.0 {
            (before_rad, (before_rad + self.wheel_rad) / 2.0)
        } else {
            (self.wheel_rad, self.wheel_rad)
        }
    }

    fn move_servo(&mut self, target_rad: f64) {
        let rate = self.mechanisms.rate_limit_radps.unwrap_or(f64::INFINITY);
        let dt = self.step_s;
        if self.mechanisms.lag_s > 0.0 {
            // Implicit in the rate, so that no lag is too short for the step.
            let w = 2.0 * DAMPING / self.mechanisms.lag_s;
            let push = self.servo_radps + dt * w * w * (target_rad - self.servo_rad);
            self.servo_radps = (push / (1.0 + dt * w * (2.0 * DAMPING + dt * w))).clamp(-rate, rate);
            self.servo_rad += dt * self.servo_radps;
        } else {
            let most = rate * dt;
            self.servo_rad += (target_rad - self.servo_rad).clamp(-most, most);
        }
    }
}
