//! What the effects switch on in the car, its actuators and its sensors.

use serde::{Deserialize, Serialize};

use crate::effect_table::effect_spec;
use crate::effects::EffectSetting;
use crate::error::ReferenceCarError;

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
