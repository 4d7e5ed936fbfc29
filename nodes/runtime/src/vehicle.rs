//! The `vehicle` block that the nodes share: the same parameter file as the offline command's `--vehicle`.

use std::collections::BTreeMap;

use gripsight_vehicle::{FIGURES, VehicleError, VehicleParameters};

use crate::{Descriptor, Error, Node};

/// Declares the parameters `vehicle.*` and gives the car that they describe. They are read-only: another car means another run.
///
/// # Errors
/// [`Error::Parameter`] for the first that is missing or out of range: there is no default car, since a wrong one gives wrong tires.
pub fn vehicle_parameters(node: &mut Node) -> Result<VehicleParameters, Error> {
    let mut number = |name: &str, default: f64, meaning: &str| {
        node.parameter(&format!("vehicle.{name}"), default, Descriptor::new(meaning).read_only())
            .map(|p| p.get())
    };
    const NOT_STATED: f64 = -1.0;
    let known = VehicleParameters::f1tenth();
    let mut sigma = BTreeMap::new();
    for figure in FIGURES {
        let meaning =
            format!("How well {figure} is known, one standard deviation; 0: as teams mostly know it");
        sigma.insert(figure.to_owned(), number(&format!("sigma.{figure}"), 0.0, &meaning)?);
    }
    sigma.retain(|_, sigma| *sigma != 0.0);
    let vehicle = VehicleParameters {
        mass_kg: number("mass_kg", 0.0, "Mass [kg]; required")?,
        yaw_inertia_kgm2: number("yaw_inertia_kgm2", 0.0, "Yaw inertia [kg m2]; required")?,
        l_f_m: number("l_f_m", 0.0, "Centre of gravity to front axle [m]; required")?,
        l_r_m: number("l_r_m", 0.0, "Centre of gravity to rear axle [m]; required")?,
        h_cg_m: number("h_cg_m", 0.0, "Height of the centre of gravity [m]")?,
        track_width_m: Some(number(
            "track_width_m",
            0.0,
            "Distance between the wheels of an axle [m]; 0: not known",
        )?)
        .filter(|&track| track != 0.0),
        drive_front_share: Some(number(
            "drive_front_share",
            NOT_STATED,
            "Share of the drive force at the front axle [-]; negative: not known",
        )?)
        .filter(|&share| share >= 0.0),
        brake_front_share: Some(number(
            "brake_front_share",
            NOT_STATED,
            "Share of the brake force at the front axle [-]; negative: not known",
        )?)
        .filter(|&share| share >= 0.0),
        max_steering_rad: number(
            "max_steering_rad",
            known.max_steering_rad,
            "Largest road-wheel angle [rad]",
        )?,
        wheel_radius_m: Some(number("wheel_radius_m", 0.0, "Radius of the driven wheels [m]; 0: not known")?)
            .filter(|&r| r != 0.0),
        name: None,
        sigma,
    };
    let name = node.parameter(
        "vehicle.name",
        String::new(),
        Descriptor::new("Names the files that are written").read_only(),
    )?;
    let vehicle = VehicleParameters { name: Some(name.get()).filter(|n| !n.is_empty()), ..vehicle };
    vehicle.checked().map_err(|error| match error {
        VehicleError::Parameter { name, got, must } => {
            let is_missing = if got == 0.0 { "; the car's own file comes by --params-file" } else { "" };
            Error::parameter(&format!("vehicle.{name}"), format!("it is {got}, must be {must}{is_missing}"))
        }
        other => Error::parameter("vehicle", other.to_string()),
    })
}
