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

/// Names of the built-in cars.
pub const CAR_NAMES: [&str; 4] = ["f1tenth", "formula_student", "race_car", "passenger_car"];

impl CarParameters {
    /// A built-in car by name.
    ///
    /// # Errors
    /// `UnknownName` with the names that exist.
    pub fn by_name(name: &str) -> Result<Self, ReferenceCarError> {
        match name {
            "f1tenth" => Ok(f1tenth()),
            "formula_student" => Ok(formula_student()),
            "race_car" => Ok(race_car()),
            "passenger_car" => Ok(passenger_car()),
            _ => Err(ReferenceCarError::UnknownName {
                kind: "car",
                name: name.to_owned(),
                known: CAR_NAMES.join(", "),
            }),
        }
    }

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

fn f1tenth() -> CarParameters {
    CarParameters {
        name: "f1tenth".to_owned(),
        mass_kg: 3.54,
        yaw_inertia_kgm2: 0.0523,
        l_f_m: 0.162,
        l_r_m: 0.145,
        track_width_m: 0.25,
        h_cg_m: 0.06,
        max_steering_rad: 0.42,
        tire_front: TireParameters {
            cornering_stiffness_per_rad: 8.6,
            longitudinal_stiffness: 12.0,
            grip: 0.97,
            sliding_share: 0.76,
        },
        tire_rear: TireParameters {
            cornering_stiffness_per_rad: 10.2,
            longitudinal_stiffness: 12.0,
            grip: 1.0,
            sliding_share: 0.76,
        },
        load_sensitivity: 0.4,
        roll: RollParameters {
            gradient_rad_per_g: 0.05,
            frequency_hz: 4.5,
            damping_ratio: 0.5,
            front_share: 0.5,
        },
        pitch: PitchParameters { gradient_rad_per_g: 0.03, frequency_hz: 5.0, damping_ratio: 0.5 },
        drive: DriveParameters {
            wheel_radius_m: 0.052,
            wheel_inertia_kgm2: 1.2e-4,
            drive_front_share: 0.5,
            brake_front_share: 0.5,
            power_w: 250.0,
            drive_limit: 0.8,
            brake_limit: 0.9,
        },
        side_area_m2: 0.05,
        side_pressure_x_m: 0.02,
        drag_1pm: 0.006,
        rolling_resistance: 0.02,
        top_speed_mps: 8.0,
        track_scale: 0.05,
    }
}

fn formula_student() -> CarParameters {
    CarParameters {
        name: "formula_student".to_owned(),
        mass_kg: 270.0,
        yaw_inertia_kgm2: 130.0,
        l_f_m: 0.80,
        l_r_m: 0.73,
        track_width_m: 1.22,
        h_cg_m: 0.29,
        max_steering_rad: 0.42,
        tire_front: TireParameters {
            cornering_stiffness_per_rad: 15.5,
            longitudinal_stiffness: 20.0,
            grip: 1.0,
            sliding_share: 0.72,
        },
        tire_rear: TireParameters {
            cornering_stiffness_per_rad: 17.5,
            longitudinal_stiffness: 20.0,
            grip: 1.03,
            sliding_share: 0.72,
        },
        load_sensitivity: 0.35,
        roll: RollParameters {
            gradient_rad_per_g: 0.02,
            frequency_hz: 3.5,
            damping_ratio: 0.6,
            front_share: 0.49,
        },
        pitch: PitchParameters { gradient_rad_per_g: 0.015, frequency_hz: 4.0, damping_ratio: 0.6 },
        drive: DriveParameters {
            wheel_radius_m: 0.23,
            wheel_inertia_kgm2: 0.25,
            drive_front_share: 0.0,
            brake_front_share: 0.6,
            power_w: 60_000.0,
            drive_limit: 0.9,
            brake_limit: 1.6,
        },
        side_area_m2: 0.9,
        side_pressure_x_m: 0.1,
        drag_1pm: 0.0022,
        rolling_resistance: 0.015,
        top_speed_mps: 28.0,
        track_scale: 0.32,
    }
}

fn race_car() -> CarParameters {
    CarParameters {
        name: "race_car".to_owned(),
        mass_kg: 790.0,
        yaw_inertia_kgm2: 1000.0,
        l_f_m: 1.60,
        l_r_m: 1.38,
        track_width_m: 1.58,
        h_cg_m: 0.29,
        max_steering_rad: 0.33,
        tire_front: TireParameters {
            cornering_stiffness_per_rad: 18.0,
            longitudinal_stiffness: 22.0,
            grip: 1.0,
            sliding_share: 0.70,
        },
        tire_rear: TireParameters {
            cornering_stiffness_per_rad: 21.0,
            longitudinal_stiffness: 22.0,
            grip: 1.04,
            sliding_share: 0.70,
        },
        load_sensitivity: 0.35,
        roll: RollParameters {
            gradient_rad_per_g: 0.008,
            frequency_hz: 4.0,
            damping_ratio: 0.6,
            front_share: 0.48,
        },
        pitch: PitchParameters { gradient_rad_per_g: 0.006, frequency_hz: 4.5, damping_ratio: 0.6 },
        drive: DriveParameters {
            wheel_radius_m: 0.31,
            wheel_inertia_kgm2: 1.1,
            drive_front_share: 0.0,
            brake_front_share: 0.57,
            power_w: 330_000.0,
            drive_limit: 0.9,
            brake_limit: 1.8,
        },
        side_area_m2: 1.8,
        side_pressure_x_m: 0.25,
        drag_1pm: 0.0009,
        rolling_resistance: 0.012,
        top_speed_mps: 70.0,
        track_scale: 1.0,
    }
}

fn passenger_car() -> CarParameters {
    CarParameters {
        name: "passenger_car".to_owned(),
        mass_kg: 1480.0,
        yaw_inertia_kgm2: 2350.0,
        l_f_m: 1.22,
        l_r_m: 1.46,
        track_width_m: 1.54,
        h_cg_m: 0.54,
        max_steering_rad: 0.55,
        tire_front: TireParameters {
            cornering_stiffness_per_rad: 13.5,
            longitudinal_stiffness: 17.0,
            grip: 0.96,
            sliding_share: 0.76,
        },
        tire_rear: TireParameters {
            cornering_stiffness_per_rad: 17.0,
            longitudinal_stiffness: 17.0,
            grip: 1.0,
            sliding_share: 0.76,
        },
        load_sensitivity: 0.3,
        roll: RollParameters {
            gradient_rad_per_g: 0.08,
            frequency_hz: 1.6,
            damping_ratio: 0.35,
            front_share: 0.56,
        },
        pitch: PitchParameters { gradient_rad_per_g: 0.04, frequency_hz: 1.7, damping_ratio: 0.35 },
        drive: DriveParameters {
            wheel_radius_m: 0.31,
            wheel_inertia_kgm2: 1.3,
            drive_front_share: 1.0,
            brake_front_share: 0.65,
            power_w: 140_000.0,
            drive_limit: 0.45,
            brake_limit: 1.1,
        },
        side_area_m2: 2.6,
        side_pressure_x_m: 0.3,
        drag_1pm: 0.00027,
        rolling_resistance: 0.011,
        top_speed_mps: 45.0,
        track_scale: 0.7,
    }
}
