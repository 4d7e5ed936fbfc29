//! The built-in cars. Figures of the classes they stand for, not of one car.

use crate::car::{CarParameters, DriveParameters, PitchParameters, RollParameters};
use crate::error::ReferenceCarError;
use crate::tire::TireParameters;

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
