//! State, inputs and evaluation of the plant.

use crate::tire::TireForce;

/// Motion and internal states of the car.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlantState {
    pub(crate) x_m: f64,
    pub(crate) y_m: f64,
    pub(crate) heading_rad: f64,
    pub(crate) v_x_mps: f64,
    pub(crate) v_y_mps: f64,
    pub(crate) yaw_rate_radps: f64,
    pub(crate) roll_rad: f64,
    pub(crate) roll_rate_radps: f64,
    pub(crate) pitch_rad: f64,
    pub(crate) pitch_rate_radps: f64,
    pub(crate) compliance_rad: f64,
    pub(crate) wheel_radps: [f64; 4],
    pub(crate) tan_alpha: [f64; 4],
}

/// What acts on the car from outside during a step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Surroundings {
    pub(crate) friction: [f64; 4],
    pub(crate) bank_rad: f64,
    pub(crate) slope_rad: f64,
    pub(crate) wind_x_mps: f64,
    pub(crate) wind_y_mps: f64,
}

/// Steering and longitudinal force at work.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Actuation {
    pub(crate) steering_rad: f64,
    /// Sum of the driving or, negative, braking forces asked of the wheels.
    pub(crate) force_n: f64,
}

/// A wheel during an evaluation.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct WheelForces {
    pub(crate) load_n: f64,
    pub(crate) kappa: f64,
    pub(crate) tan_alpha_now: f64,
    pub(crate) force: TireForce,
    pub(crate) steering_rad: f64,
    pub(crate) v_cx_mps: f64,
    pub(crate) torque_nm: f64,
    pub(crate) brake_nm: f64,
    pub(crate) rolling_nm: f64,
}

/// Forces and accelerations of a state.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Evaluation {
    pub(crate) wheels: [WheelForces; 4],
    /// Acceleration as an accelerometer at the centre of gravity shows it, along and across the road plane.
    pub(crate) specific_x_mps2: f64,
    pub(crate) specific_y_mps2: f64,
    pub(crate) v_x_dot_mps2: f64,
    pub(crate) v_y_dot_mps2: f64,
    pub(crate) yaw_acceleration_radps2: f64,
    pub(crate) roll_acceleration_radps2: f64,
    pub(crate) pitch_acceleration_radps2: f64,
    pub(crate) compliance_target_rad: f64,
}

impl PlantState {
    /// The car rolling straight ahead at `v_x_mps`.
    pub(crate) fn rolling(x_m: f64, y_m: f64, heading_rad: f64, v_x_mps: f64, wheel_radius_m: f64) -> Self {
        Self {
            x_m,
            y_m,
            heading_rad,
            v_x_mps,
            v_y_mps: 0.0,
            yaw_rate_radps: 0.0,
            roll_rad: 0.0,
            roll_rate_radps: 0.0,
            pitch_rad: 0.0,
            pitch_rate_radps: 0.0,
            compliance_rad: 0.0,
            wheel_radps: [v_x_mps / wheel_radius_m; 4],
            tan_alpha: [0.0; 4],
        }
    }

    pub(crate) fn is_finite(&self) -> bool {
        let body = [self.x_m, self.y_m, self.heading_rad, self.v_x_mps, self.v_y_mps, self.yaw_rate_radps];
        let springs = [self.roll_rad, self.roll_rate_radps, self.pitch_rad, self.pitch_rate_radps];
        body.iter().chain(&springs).chain(&self.wheel_radps).chain(&self.tan_alpha).all(|v| v.is_finite())
    }
}
