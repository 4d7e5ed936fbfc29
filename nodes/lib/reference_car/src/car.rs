//! The cars: what a data sheet would say of each, and the checks that keep the physics meaningful.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::effects::EffectSetting;
use crate::error::ReferenceCarError;
use crate::tire::TireParameters;

/// Standard gravity.
pub const GRAVITY_MPS2: f64 = 9.81;

/// Body roll on the springs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RollParameters {
    /// Steady roll angle per g of lateral acceleration.
    pub gradient_rad_per_g: f64,
    /// Undamped natural frequency.
    pub frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Share of the roll stiffness at the front axle.
    pub front_share: f64,
}

/// Body pitch on the springs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PitchParameters {
    /// Steady pitch angle per g of longitudinal acceleration.
    pub gradient_rad_per_g: f64,
    /// Undamped natural frequency.
    pub frequency_hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
}

/// Wheels, motor and brakes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DriveParameters {
    /// Rolling radius of every wheel.
    pub wheel_radius_m: f64,
    /// Spin inertia of one wheel with its share of the drivetrain.
    pub wheel_inertia_kgm2: f64,
    /// Share of the driving force at the front axle.
    pub drive_front_share: f64,
    /// Share of the braking force at the front axle.
    pub brake_front_share: f64,
    /// Motor power at the wheels.
    pub power_w: f64,
    /// Largest driving force over the weight.
    pub drive_limit: f64,
    /// Largest braking force over the weight.
    pub brake_limit: f64,
}

/// A car.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CarParameters {
    /// Name, used in file names.
    pub name: String,
    /// Mass.
    pub mass_kg: f64,
    /// Yaw inertia about the centre of gravity.
    pub yaw_inertia_kgm2: f64,
    /// Front axle ahead of the centre of gravity.
    pub l_f_m: f64,
    /// Rear axle behind the centre of gravity.
    pub l_r_m: f64,
    /// Distance between the left and the right wheels.
    pub track_width_m: f64,
    /// Height of the centre of gravity.
    pub h_cg_m: f64,
    /// Largest road-wheel angle.
    pub max_steering_rad: f64,
    /// Front tires.
    pub tire_front: TireParameters,
    /// Rear tires.
    pub tire_rear: TireParameters,
    /// Load sensitivity of the tires' friction: its relative loss per relative growth of the load, at the natural size of
    /// `lateral_load_transfer`.
    pub load_sensitivity: f64,
    /// Roll.
    pub roll: RollParameters,
    /// Pitch.
    pub pitch: PitchParameters,
    /// Wheels, motor, brakes.
    pub drive: DriveParameters,
    /// Side force of the wind over dynamic pressure: side area times coefficient.
    pub side_area_m2: f64,
    /// Centre of pressure of the side wind ahead of the centre of gravity.
    pub side_pressure_x_m: f64,
    /// Air drag over mass and square of the speed, at its natural size.
    pub drag_1pm: f64,
    /// Rolling resistance over load, at its natural size.
    pub rolling_resistance: f64,
    /// Speed that the car's tracks are laid out for.
    pub top_speed_mps: f64,
    /// Size of its tracks; 1 is a full-size circuit.
    pub track_scale: f64,
}

impl CarParameters {
    /// Wheelbase.
    pub fn wheelbase_m(&self) -> f64 {
        self.l_f_m + self.l_r_m
    }

    /// What this car has of its own beyond a single track, on a road of friction `road_friction`: load transfers,
    /// relaxation, combined slip, drag and rolling resistance at their natural size.
    pub fn own_effects(&self, road_friction: f64) -> Vec<EffectSetting> {
        let own = |name: &str, parameter: &str, value: f64| EffectSetting {
            name: name.to_owned(),
            parameters: BTreeMap::from([(parameter.to_owned(), value)]),
        };
        vec![
            own("lateral_load_transfer", "k", self.own_load_transfer_loss(road_friction)),
            own("longitudinal_load_transfer", "h_m", self.h_cg_m),
            own("tire_relaxation", "sigma_m", self.drive.wheel_radius_m),
            own("combined_slip", "k", 1.0),
            own("aero_drag", "c_1pm", self.drag_1pm),
            own("rolling_resistance", "c", self.rolling_resistance),
        ]
    }

    /// Share of its grip that an axle loses at the limit by the lateral load transfer of this car as it stands: the
    /// natural size of `lateral_load_transfer`.
    pub fn own_load_transfer_loss(&self, road_friction: f64) -> f64 {
        let limit = road_friction * (self.tire_front.grip + self.tire_rear.grip) / 2.0;
        self.load_sensitivity * (2.0 * self.h_cg_m * limit / self.track_width_m).min(1.0).powi(2)
    }

    /// This car as a ROS 2 parameter file, under a name.
    pub fn vehicle_file(&self, name: &str) -> String {
        let rows = [
            ("mass_kg", self.mass_kg),
            ("yaw_inertia_kgm2", self.yaw_inertia_kgm2),
            ("l_f_m", self.l_f_m),
            ("l_r_m", self.l_r_m),
            ("h_cg_m", self.h_cg_m),
            ("track_width_m", self.track_width_m),
            ("drive_front_share", self.drive.drive_front_share),
            ("brake_front_share", self.drive.brake_front_share),
            ("max_steering_rad", self.max_steering_rad),
            ("wheel_radius_m", self.drive.wheel_radius_m),
        ];
        let rows: String = rows.iter().map(|(name, value)| format!("      {name}: {value:?}\n")).collect();
        format!("/**:\n  ros__parameters:\n    vehicle:\n      name: {name}\n{rows}")
    }

    /// Speed below which slips are taken over this speed, so that standstill stays well posed.
    pub fn low_speed_mps(&self) -> f64 {
        0.3 * (GRAVITY_MPS2 * self.wheelbase_m()).sqrt()
    }

    /// Checks that every number is finite and physically possible.
    ///
    /// # Errors
    /// `InvalidParameter` naming the first that is not.
    pub fn validate(&self) -> Result<(), ReferenceCarError> {
        let positive: [(&str, f64); 23] = [
            ("load_sensitivity", self.load_sensitivity),
            ("mass_kg", self.mass_kg),
            ("yaw_inertia_kgm2", self.yaw_inertia_kgm2),
            ("l_f_m", self.l_f_m),
            ("l_r_m", self.l_r_m),
            ("track_width_m", self.track_width_m),
            ("h_cg_m", self.h_cg_m),
            ("max_steering_rad", self.max_steering_rad),
            ("tire_front.cornering_stiffness_per_rad", self.tire_front.cornering_stiffness_per_rad),
            ("tire_front.longitudinal_stiffness", self.tire_front.longitudinal_stiffness),
            ("tire_front.grip", self.tire_front.grip),
            ("tire_rear.cornering_stiffness_per_rad", self.tire_rear.cornering_stiffness_per_rad),
            ("tire_rear.longitudinal_stiffness", self.tire_rear.longitudinal_stiffness),
            ("tire_rear.grip", self.tire_rear.grip),
            ("roll.gradient_rad_per_g", self.roll.gradient_rad_per_g),
            ("roll.frequency_hz", self.roll.frequency_hz),
            ("pitch.gradient_rad_per_g", self.pitch.gradient_rad_per_g),
            ("pitch.frequency_hz", self.pitch.frequency_hz),
            ("drive.wheel_radius_m", self.drive.wheel_radius_m),
            ("drive.wheel_inertia_kgm2", self.drive.wheel_inertia_kgm2),
            ("drive.power_w", self.drive.power_w),
            ("top_speed_mps", self.top_speed_mps),
            ("track_scale", self.track_scale),
        ];
        for (name, value) in positive {
            check(name, value, value > 0.0, "a finite number above zero")?;
        }
        let shares = [
            ("tire_front.sliding_share", self.tire_front.sliding_share),
            ("tire_rear.sliding_share", self.tire_rear.sliding_share),
            ("roll.front_share", self.roll.front_share),
            ("drive.drive_front_share", self.drive.drive_front_share),
            ("drive.brake_front_share", self.drive.brake_front_share),
        ];
        for (name, value) in shares {
            check(name, value, (0.0..=1.0).contains(&value), "between 0 and 1")?;
        }
        let not_negative = [
            ("roll.damping_ratio", self.roll.damping_ratio),
            ("pitch.damping_ratio", self.pitch.damping_ratio),
            ("drive.drive_limit", self.drive.drive_limit),
            ("drive.brake_limit", self.drive.brake_limit),
            ("side_area_m2", self.side_area_m2),
            ("drag_1pm", self.drag_1pm),
            ("rolling_resistance", self.rolling_resistance),
        ];
        for (name, value) in not_negative {
            check(name, value, value >= 0.0, "a finite number, not negative")?;
        }
        check("side_pressure_x_m", self.side_pressure_x_m, true, "a finite number")?;
        check("max_steering_rad", self.max_steering_rad, self.max_steering_rad < 1.4, "below 1.4 rad")
    }
}

fn check(name: &str, value: f64, holds: bool, expected: &'static str) -> Result<(), ReferenceCarError> {
    if value.is_finite() && holds {
        Ok(())
    } else {
        Err(ReferenceCarError::InvalidParameter { name: format!("car.{name}"), value, expected })
    }
}
