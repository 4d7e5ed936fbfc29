//! What is known of the car, as a ROS 2 parameter file.
//!
//! ```yaml
//! /**:
//!   ros__parameters:
//!     vehicle:
//!       name: car        # optional: names the output files
//!       mass_kg: 3.3
//!       yaw_inertia_kgm2: 0.045
//!       l_f_m: 0.15      # centre of gravity to front axle
//!       l_r_m: 0.17      # centre of gravity to rear axle
//!       h_cg_m: 0.06
//!       track_width_m: 0.25  # optional: middle of the left wheel to middle of the right one
//!       sigma:           # optional: how well a figure is known, one standard deviation in its unit
//!         mass_kg: 0.02
//! ```

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::VehicleError;

/// Parameters of the single-track model, and what the outputs for other stacks need.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VehicleParameters {
    /// Names the output files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Mass with driver or computer.
    pub mass_kg: f64,
    /// Inertia about the vertical axis through the centre of gravity.
    pub yaw_inertia_kgm2: f64,
    /// Centre of gravity to front axle.
    pub l_f_m: f64,
    /// Centre of gravity to rear axle.
    pub l_r_m: f64,
    /// Height of the centre of gravity.
    pub h_cg_m: f64,
    /// Middle of the left wheel to middle of the right one, where stated ([`Self::track_m`]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub track_width_m: Option<f64>,
    /// Share of the drive force at the front axle, where stated: 0 rear drive, 1 front drive ([`Self::front_drive_share`]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive_front_share: Option<f64>,
    /// Share of the brake force at the front axle, where stated ([`Self::front_brake_share`]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brake_front_share: Option<f64>,
    /// Largest road-wheel angle.
    #[serde(default = "default_max_steering_rad")]
    pub max_steering_rad: f64,
    /// Radius of the driven wheels, where known: turns wheel effort into force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wheel_radius_m: Option<f64>,
    /// How well figures are known, where stated: one standard deviation of some of [`FIGURES`], in the figure's unit. The others are known as teams
    /// mostly know them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub sigma: BTreeMap<String, f64>,
}

/// Figures whose uncertainty may be stated: those of the car, and the scales of signals.
pub const FIGURES: [&str; 9] = [
    "mass_kg",
    "yaw_inertia_kgm2",
    "l_f_m",
    "h_cg_m",
    "drive_front_share",
    "brake_front_share",
    "steering_scale",
    "v_x_scale",
    "yaw_rate_scale",
];

/// Wheelbase up to which a car is a model car.
const MODEL_CAR_M: f64 = 1.0;

/// Track over wheelbase: 0.55 of long road cars to 0.8 of formula and 1:10 cars.
const USUAL_TRACK_SHARE: f64 = 0.7;

/// A common lock of 1:10 cars; full-size cars have more and use less.
fn default_max_steering_rad() -> f64 {
    0.45
}

// Other nodes and other blocks of the file may hold anything: unknown keys are passed over down to `vehicle`, none in it.
#[derive(Deserialize)]
struct Node {
    #[serde(rename = "ros__parameters")]
    parameters: Option<Parameters>,
}

#[derive(Deserialize)]
struct Parameters {
    vehicle: Option<VehicleParameters>,
}

impl VehicleParameters {
    /// Reads a ROS 2 parameter file: the `vehicle` block of the first node (by name) that has one.
    ///
    /// # Errors
    /// [`VehicleError`] names what cannot be read, is missing, unknown or out of range.
    pub fn from_ros_yaml(text: &str) -> Result<Self, VehicleError> {
        let nodes: BTreeMap<String, Node> =
            serde_saphyr::from_str(text).map_err(|e| VehicleError::Yaml(e.to_string()))?;
        let found = nodes.keys().cloned().collect::<Vec<_>>().join(", ");
        let vehicle = nodes.into_values().find_map(|node| node.parameters?.vehicle);
        vehicle.ok_or(VehicleError::NoVehicle { found })?.checked()
    }

    /// Gives the parameters back where all are in range.
    ///
    /// # Errors
    /// [`VehicleError::Parameter`] names the first that is not.
    pub fn checked(self) -> Result<Self, VehicleError> {
        let positive = [
            ("mass_kg", self.mass_kg),
            ("yaw_inertia_kgm2", self.yaw_inertia_kgm2),
            ("l_f_m", self.l_f_m),
            ("l_r_m", self.l_r_m),
            ("max_steering_rad", self.max_steering_rad),
            ("wheel_radius_m", self.wheel_radius_m.unwrap_or(1.0)),
            ("track_width_m", self.track_m()),
        ];
        if let Some(&(name, got)) = positive.iter().find(|(_, v)| !(v.is_finite() && *v > 0.0)) {
            return Err(VehicleError::Parameter { name, got, must: "positive and finite" });
        }
        if !(self.h_cg_m.is_finite() && self.h_cg_m >= 0.0) {
            return Err(VehicleError::Parameter {
                name: "h_cg_m",
                got: self.h_cg_m,
                must: "at least 0 and finite",
            });
        }
        let shares = [
            ("drive_front_share", self.front_drive_share()),
            ("brake_front_share", self.front_brake_share()),
        ];
        if let Some(&(name, got)) = shares.iter().find(|(_, v)| !(0.0..=1.0).contains(v)) {
            return Err(VehicleError::Parameter { name, got, must: "between 0 and 1" });
        }
        for (name, &got) in &self.sigma {
            let Some(&name) = FIGURES.iter().find(|figure| *figure == name) else {
                let known = FIGURES.join(", ");
                return Err(VehicleError::Yaml(format!("vehicle.sigma has `{name}`; it may have {known}")));
            };
            if !(got.is_finite() && got > 0.0) {
                let must = "positive and finite (vehicle.sigma)";
                return Err(VehicleError::Parameter { name, got, must });
            }
        }
        Ok(self)
    }

    /// Share of the drive force at the front axle; where it is not stated, what cars of this size mostly have: 1:10 cars drive all wheels, others the
    /// rear.
    #[must_use]
    pub fn front_drive_share(&self) -> f64 {
        let usual = if self.wheelbase_m() < MODEL_CAR_M { 0.5 } else { 0.0 };
        self.drive_front_share.unwrap_or(usual)
    }

    /// Share of the brake force at the front axle; where it is not stated, what cars of this size mostly have: 1:10 cars brake with the motor.
    #[must_use]
    pub fn front_brake_share(&self) -> f64 {
        let usual = if self.wheelbase_m() < MODEL_CAR_M { 0.5 } else { 0.6 };
        self.brake_front_share.unwrap_or(usual)
    }

    /// Distance between the axles.
    #[must_use]
    pub fn wheelbase_m(&self) -> f64 {
        self.l_f_m + self.l_r_m
    }

    /// Distance between the wheels of an axle; where it is not stated, what cars mostly have.
    #[must_use]
    pub fn track_m(&self) -> f64 {
        self.track_width_m.unwrap_or(USUAL_TRACK_SHARE * self.wheelbase_m())
    }

    /// A number that changes with any parameter: results carry it, so that they are not used with another car.
    #[must_use]
    pub fn hash(&self) -> u64 {
        let numbers = [
            self.mass_kg,
            self.yaw_inertia_kgm2,
            self.l_f_m,
            self.l_r_m,
            self.h_cg_m,
            self.front_drive_share(),
            self.front_brake_share(),
            self.max_steering_rad,
            self.wheel_radius_m.unwrap_or(0.0),
        ];
        // FNV-1a over the bits: stable across builds, and nothing here needs to resist an attacker.
        numbers
            .into_iter()
            .chain(self.track_width_m)
            .flat_map(|v| v.to_bits().to_le_bytes())
            .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
    }

    /// Values of an F1TENTH-class 1:10 car, the default where no file is given.
    #[must_use]
    pub fn f1tenth() -> Self {
        Self {
            name: None,
            mass_kg: 3.54,
            yaw_inertia_kgm2: 0.05,
            l_f_m: 0.162,
            l_r_m: 0.145,
            h_cg_m: 0.06,
            track_width_m: None,
            drive_front_share: None,
            brake_front_share: None,
            max_steering_rad: default_max_steering_rad(),
            wheel_radius_m: None,
            sigma: BTreeMap::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "/**:\n  ros__parameters:\n    vehicle:\n      mass_kg: 3.3\n      yaw_inertia_kgm2: 0.045\n      l_f_m: 0.15\n      l_r_m: 0.17\n      h_cg_m: 0.06\n";

    #[test]
    fn a_ros_parameter_file_is_read() {
        let other =
            format!("/planner:\n  ros__parameters:\n    rate: 3\n    list: [1, 2]\n{GOOD}    rate: 50.0\n");
        for text in [GOOD, &other] {
            let car = VehicleParameters::from_ros_yaml(text).unwrap();
            assert_eq!((car.mass_kg, car.l_r_m), (3.3, 0.17));
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        let error = |text: &str| VehicleParameters::from_ros_yaml(text).unwrap_err().to_string();
        assert!(error(&GOOD.replace("3.3", "-3.3")).contains("mass_kg is -3.3"));
        assert!(error(&GOOD.replace("      l_f_m: 0.15\n", "")).contains("l_f_m"));
        assert!(error(&GOOD.replace("mass_kg", "mass_lb")).contains("mass_lb"));
        assert!(error("/car:\n  ros__parameters:\n    mass: 1\n").contains("/car"));
        assert!(error("][").starts_with("vehicle file"));
    }

    #[test]
    fn how_well_a_figure_is_known_may_be_stated() {
        let stated = |text: &str| VehicleParameters::from_ros_yaml(&format!("{GOOD}      sigma: {text}\n"));
        assert_eq!(stated("{mass_kg: 0.02}").unwrap().sigma["mass_kg"], 0.02);
        let error = |text: &str| stated(text).unwrap_err().to_string();
        assert!(error("{mass_lb: 1.0}").contains("`mass_lb`; it may have mass_kg, "));
        assert!(error("{v_x_scale: 0.0}").contains("v_x_scale is 0, must be positive"));
    }

    #[test]
    fn the_hash_sees_every_parameter() {
        let car = VehicleParameters::f1tenth();
        let heavier = VehicleParameters { mass_kg: car.mass_kg + 1e-9, ..car.clone() };
        assert_ne!(car.hash(), heavier.hash());
    }
}
